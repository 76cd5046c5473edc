"""How long motions of a book are, and how much work they may be, with unit and reason."""

from __future__ import annotations

# course
SPANS = (5.0, 0.5, 0.05)  # seconds of a motion; a shorter one where a longer one takes too long
ROWS = 300  # of a motion: more than a plot shows
LIMIT = 6.0  # seconds of computing for one motion
MOST_STEPS = 20_000  # of a motion; with more a shorter one says as much
TOLERANCES = tuple(10.0**-k for k in range(3, 12))  # of the dots of a chart of errors
TIGHT = 1e-13  # of the reference; below it a step's error is rounding
SHARE = 0.03  # seconds for repeating a run, whose least time counts
LEAST = 1e-16  # a smaller error is shown as this one, so that its logarithm exists

# exercises
DIGITS = 6  # of a number
NOTHING = 1e-12  # of the largest number beside it: a smaller one is rounding

# printing
PATIENCE = 600.0  # seconds for a browser to print a book
