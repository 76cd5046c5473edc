"""The limits and tolerances of sweeps, with unit and reason."""

from __future__ import annotations

# axes
BLOCK = 256  # samples that one generator draws
MOST = 10**12  # motions
WHOLE = 10**7  # numbers of a design that is only known as a whole, or of a file
COUNT = 101  # places of a range that does not say how many

# drive
AHEAD = 2  # chunks for each that can run at once: a worker never waits for the next
TRIES = 20  # times that a chunk may lose its worker
LOOK = 1.0  # s between two looks at whether the engine is still there

# folder
GROUP = 256  # chunks whose summaries are kept as one file

# plan
ROWS = 500  # looked at where something of the whole motion is kept, and no step is given
MOST_METHODS = 64  # each is a module of its own

# summary
ACCURACY = 0.005  # relative, of every quantile
LEAST = 1e-30  # a magnitude below it counts as zero
ENDS = 5  # smallest and largest motions that are remembered

# work
REASONS = 3  # that an answer tells
