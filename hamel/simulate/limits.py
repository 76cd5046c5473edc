"""The limits and tolerances of simulations, with unit and reason."""

from __future__ import annotations

from fractions import Fraction

# compiled
ROWS = 500  # of the output when no step is given
MOST_ROWS = 10_000_000  # of the output: 80 MB a column

# method
TIGHTEST = 1e-15  # rtol; below it a step's error is rounding

# motion
FINEST = 1e-10  # rtol; rounding grows near singular positions
# of the smallest singular value of A at the start: what is a loss of rank, with and without a
# status that says so
BELOW, LOST = 0.5, 0.01
MOST_STEPS = 10**9  # enough for a night; Ctrl-C ends it any time
LOOKED_BACK = 16  # looks at a motion, 5,000 steps apart; as many before are compared with these
STANDING = 1e-6  # of the whole time: what both cover together where a motion stands still
SLOWER = 0.8  # of what the earlier ones covered

# stiffness
# |λ| of the fastest motion times the mean step, from which on stability and not accuracy makes the
# steps: explicit pairs of orders 5 to 9 are stable up to 3 to 6 (Hairer, Wanner, 1996, IV.2), and
# steps by the accuracy of a motion that takes part are below 2.
HELD = 2.5
LOOKS = (5_000, 50_000)  # steps after which it is looked at

# solution
VERSION = 3  # of stored solutions: another one is computed anew
MORE = 4  # digits carried beyond those asked for
FIRST_CORRECTIONS = 6  # each gains as many digits as a double holds

# taylor
FINE = 256  # steps are whole parts of powers of two
MOST_EXACT_STEPS = 20_000
FORESEEN = 1_000  # steps after which it is looked at how far they come
TOO_LONG = 1.5  # times too many steps, as long as those so far, are not begun
LOOKS_FOR_KINKS = 16  # places of a step
FIRST = Fraction(1, 2**10)  # s, of the first step; it grows eightfold where that is short

# sundials
UNCHECKED = 1e10  # the absolute tolerance of multipliers
MOST_LIBRARY_STEPS = 10_000_000

# energies
ROUNDING = 64 * 2.0**-52  # of |V|: what is exchanged below that is the rounding of V

# figure
ALIKE = 10.0  # curves whose sizes differ by more are drawn apart

# view
SHOWN = 10.0  # seconds in which another one is shown
LOOKED_AT = (2.0, 20.0)  # seconds of a motion that is shown at its own speed

# inputs
MOST_POINTS = 10_000_000  # rows of a table
