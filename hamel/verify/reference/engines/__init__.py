"""Other people's engines, given the same mechanism: each is compared where it is installed and the
model fits it.

An engine is a file here and a line in checks/engines.py. benchmarks/ builds its peers from the same
files.
"""
