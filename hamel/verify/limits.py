"""The tolerances and limits that several checks share, with unit and reason."""

import numpy as np

EPS = float(np.finfo(float).eps)

# Of what is summed: no sum of a mechanism's size is expected to be better than so many units in the
# last place. Sums along a tree of a dozen joints differ by some twenty between two orders of them.
ROUNDING = 128 * EPS

FLOOR = 1e-3  # a component counts as at least this part of the largest component's typical size …
# … and as at least this in its unit, so that the rounding of a quantity that is zero is not
# compared with itself
SMALL = 1e-6

# Relative tolerances; where a condition number excuses an error, it is divided by it first.
TERMS = 1e-11  # sums in which little cancels: M, A, φ, q̇
CANCELLING = 1e-9  # h, Q, β, power: sums of many terms that cancel to a part of them
ENERGIES = 1e-10  # T and V of the system
OWN_ENERGIES = 1e-12  # the function `energy`, at the very velocities that it is given
SOLVED = 1e-10  # v̇ and λ, per condition number
MOST_EXCUSED = 1e7  # a larger one excuses no more: an error of v̇ of 1e-3 is one
ROUNDED = 4.0  # times the likely roundoff of a matrix is what a product with it may be off by
UNDONE = 1e-12  # products with an inverse, and state ↔ velocity, per condition number
