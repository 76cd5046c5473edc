"""Gradients of one-sided potentials: the same numbers without the steps that change nothing.

Of derive.expressions: one_sided.
"""

import casadi as ca
import numpy as np
import pytest

from derive.expressions.instructions import listing
from derive.expressions.one_sided import gradient

q, k, t = ca.SX.sym("q", 3), ca.SX.sym("k"), ca.SX.sym("t")
COMPARISONS = {ca.OP_LT, ca.OP_LE, ca.OP_DIV}
WITHOUT_STEPS = {
    "a spring": 0.5 * k * ca.fmax(0, q[0] * q[1] - 1) ** 2,
    "a cube": k * ca.fmax(q[1], 0) ** 3 * ca.sin(q[2]),
    "the other side": 0.5 * ca.fmin(0, q[0] - q[1]) ** 2 * t,
    "one in another": ca.fmax(0, ca.fmax(0, q[0]) ** 2 - 0.2) ** 2,
    "no side": q[0] * q[1],
    "a number": ca.SX(3),
}
WITH_STEPS = {
    "a constant force": k * ca.fmax(0, q[0]),
    "a product": ca.fmax(0, q[0]) * ca.fmax(0, q[1]) + q[2] ** 2,
    "a square times another": ca.fmax(0, q[0]) ** 2 * ca.fmax(0, q[0] - 0.3),
    "two values": ca.fmax(q[0], q[1]) * q[2],
    "one straight in another": ca.fmax(0, ca.fmax(0, q[0]) - 0.2) ** 2,
}


@pytest.mark.parametrize("name", [*WITHOUT_STEPS, *WITH_STEPS])
def test_values_are_those_of_the_derivative(name):
    """On either side, and where both meet."""
    value = ca.SX({**WITHOUT_STEPS, **WITH_STEPS}[name])
    both = ca.Function("both", [q, k, t], [gradient(value, q), ca.gradient(value, q)])
    states = [*np.random.default_rng(0).normal(size=(100, 3)), np.zeros(3), [0.2, 0.2, 0.0]]
    for state in states:
        found, wanted = (np.array(x) for x in both(state, 1.3, 0.7))
        np.testing.assert_allclose(found, wanted, rtol=1e-15)


@pytest.mark.parametrize("name", WITHOUT_STEPS)
def test_steps_that_change_nothing_are_left_out(name):
    found = ca.densify(gradient(ca.SX(WITHOUT_STEPS[name]), q))
    program = listing(ca.Function("found", [q, k, t], [found]))
    assert not COMPARISONS & {read.code for read in program.instructions}
