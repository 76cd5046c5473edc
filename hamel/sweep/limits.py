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
WRITERS = 4  # threads that wait for the disk
WAITING = 64  # answers to be written, beyond which no more work is handed out
LOOK = 1.0  # s between two looks at whether the engine is still there

# folder
GROUP = 256  # chunks whose summaries are kept as one file

# plan
ROWS = 500  # looked at where something of the whole motion is kept, and no step is given
MOST_METHODS = 64  # each is a module of its own

# modes
WORTH = 100_000  # points from which it takes less time to compile than to go without
STATES = 3  # that compiled code is checked at
BESIDE = 0.01  # relative: how far these are from each other

# summary
BINS = 512  # with a number inside, where half a per cent of it does not ask for more
FINEST = 12  # binary digits dropped at least: what is left is 1e-12 of a number
COARSEST = 52 - 7  # and at most: of 128 bins in a power of two the middle is 0.4 % off
FLUSH = 65_536  # bins of parts that wait to be put together
LEAST = 1e-30  # a magnitude below it counts as zero
SAME = 1e-12  # relative: values no farther apart differ by rounding, and fill no bars
BARS = 60  # of a histogram
ENDS = 5  # smallest and largest motions that are remembered

# work
REASONS = 3  # that an answer tells
