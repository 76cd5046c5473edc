"""The numbers that decide what passes do, each with its unit and its reason.

Sizes are counted in operations, statements or nodes of a graph; tolerances are relative.
"""

from __future__ import annotations

# ---- rounding of constants (relative)

EPSILON = 2.220446049250313e-16  # the unit of rounding of double
NEARLY = 8 * EPSILON  # factors closer than this differ by rounding only
CLOSE = 2 * EPSILON  # a short decimal or a fraction this close stands for the factor

# ---- what passes do (nodes and operations)

MOST_MULTIPLIED_OUT = 16  # integer powers up to this become multiplications: cheaper than a call

# ---- scales: which multiple of each node is computed

MODEST = (
    1e30  # scales stay within this and its inverse, so that products of several are no overflow
)
WIDE_SCALE = 16  # sums with more distinct factors than this are not searched for the best scale
BUSY_SCALE = 24  # nodes with more users than this keep their scale: a trial looks at all of them
NEAR_SCALE = 1.0 + 1e-12  # scales differ by rounding only up to this ratio, far above rounding
MOST_GAIN = 0.6  # rescaling leaves at least this part of the multiplications (measured: 0.7)
SCALE_SWEEPS = 4  # later ones have found nothing
LONG_SCALES = 2_000  # graphs with more nodes than this are swept once

# ---- rounds of passes (operations of a function)

MOST_ROUNDS = 4  # as long as a round of passes helps
LONG_FUNCTION = 2_000  # from which one round has to do
LONGEST_FUNCTION = 10_000  # from which only what comes of all passes is counted
SHORT_FUNCTION = 1_000  # up to which operations are counted after every pass, not estimated

# ---- texts

MANY_RESULTS = 200  # from which each is stored at once, in a file of its own: no register holds it
