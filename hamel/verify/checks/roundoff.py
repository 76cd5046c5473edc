"""How far roundoff alone moves the results of a straight-line program: a bound, and an estimate.

Every operation z = f(a, b) adds half a unit in the last place of z and passes on what its operands
carry. The bound takes all of it at its worst,
    δz = |∂f/∂a| δa + |∂f/∂b| δb + ε |z|          (Wilkinson; Higham, Accuracy and Stability of
    Numerical Algorithms, §3.3)
and grows with every link of a chain, to any size: what cancels in a recursion does not cancel in
it. The estimate draws a number σ between -1 and 1 for every operation,
    δz = ∂f/∂a δa + ∂f/∂b δb + σ ε |z|,           (to first order; Parker, Monte Carlo arithmetic)
and takes the largest of several draws, which is never above the bound.
Two orderings of the same sums and products agree within a small multiple of either, a wrong sign
does not. For that a sum counts as large as its largest term in the bound: a − b of two near numbers
is exact, but a − b + c may be added up as a + c − b, which is not. Roots and products of what is
rounding itself are bounded beyond the first order.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from codegen.reals import FLOAT64, Real
from hamel.verify.checks.carried import Changes, carried
from hamel.verify.reference.vectors import Array

EPSILON = float(np.finfo(float).eps) / 2
DRAWS = 8  # the largest of them is below an eighth of the standard deviation once in 10⁸ times
EXACT = (ca.OP_NEG, ca.OP_TWICE, ca.OP_FABS, ca.OP_ASSIGN)
SUMS = (ca.OP_ADD, ca.OP_SUB)
PRODUCTS = (ca.OP_MUL, ca.OP_SQ)


def bound(arguments: list[ca.SX], value: ca.SX, states: Array, real: Real = FLOAT64) -> Array:
    """The bound of each entry of a dense `value` (row by row), states × entries.

    `value` is an expression over the arguments; `states` holds their entries, states × all
    arguments, and counts as exact. The bound is in terms of double's unit of rounding, whatever the
    precision `real`; constants that it rounds carry one unit.
    """

    nothing = np.zeros(1)

    def passed(code: int, slope: Any, error: Array) -> Array:
        # |√(a + δa) − √a| ≤ √δa, which is less than the first order where a is rounding itself
        steep = abs(slope) * error
        return np.fmin(steep, np.sqrt(error)) if code == ca.OP_SQRT else steep

    def added(code: int, z: Array, operands: list[Array], errors: list[Array]) -> Array:
        if code in EXACT:
            return nothing
        terms = operands if code in SUMS else []
        rounded = EPSILON * np.max(np.abs([z, *terms]), axis=0)
        return rounded + _of_second_order(code, errors)

    changes = Changes(np.zeros_like, lambda numbers: _lost(numbers, real), passed, added)
    return carried(arguments, value, states, changes, 1)[0]


def estimate(
    arguments: list[ca.SX], value: ca.SX, states: Array, real: Real = FLOAT64, seed: int = 0
) -> Array:
    """The largest roundoff of each entry of a dense `value` in DRAWS draws; arguments, result and
    unit are those of `bound`. Arguments that `real` rounds carry one unit, too."""
    random, nothing = np.random.default_rng(seed), np.zeros(1)

    def drawn(size: Array) -> Array:
        many = np.broadcast_to(size, (len(size), DRAWS, size.shape[-1]))
        return many * random.uniform(-1.0, 1.0, many.shape) if np.any(size) else many

    def given(numbers: Array) -> Array:
        return drawn(_lost(numbers, real))

    def passed(_: int, slope: Any, change: Array) -> Array:
        return slope * change

    def added(code: int, z: Array, _: list[Array], __: list[Array]) -> Array:
        return drawn(EPSILON * abs(z)) if code not in EXACT else nothing

    changes = Changes(given, given, passed, added)
    return np.max(np.abs(carried(arguments, value, states, changes, DRAWS)), axis=0)


def _of_second_order(code: int, errors: list[Array]) -> Array:
    """δa δb of a product, which is all there is of it where both factors are rounding: the length
    of a vector that is zero is no more than the rounding of its parts. A large one is left out: the
    bound says nothing there, and would overflow."""
    if code not in PRODUCTS:
        return np.zeros(1)
    product = errors[0] * errors[-1]
    return np.where(product < 1.0, product, 0.0)


def _lost(numbers: Array, real: Real) -> Array:
    """What numbers may be off by where `real` cannot hold them."""
    kept = np.reshape([real.nearest(number) for number in numbers.flat], numbers.shape)
    return np.where(kept != numbers, EPSILON * abs(numbers), 0.0)
