"""Contenders for `make bench`: each module makes shared libraries with the two functions that
driver.c calls."""
