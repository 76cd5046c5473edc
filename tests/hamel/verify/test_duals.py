"""Derivatives by dual numbers are exact for every operation, and a wrong linear equation is seen."""

from __future__ import annotations

import casadi as ca
import numpy as np

from hamel.verify.checks.duals import tangents


def test_every_operation_has_its_derivative():
    """Against CasADi's own, which knows nothing of the table."""
    a, b, c = ca.SX.sym("a"), ca.SX.sym("b"), ca.SX.sym("c")
    value = ca.vertcat(
        a + b, a - b, a * b, a / b, -a, a**2, 2 * a, 1 / b, ca.sin(a), ca.cos(a), ca.sqrt(b),
        ca.tan(a), ca.exp(a), ca.log(b), ca.atan2(a, b), b**a, ca.fabs(-a), ca.fmax(a, b),
        ca.fmin(a, b), ca.tanh(c), ca.if_else(a > c, a * b, a - c),
    )  # fmt: skip
    place = np.array([0.3, 1.7, -0.4])
    directions = np.random.default_rng(0).normal(size=(5, 3))
    jacobian = ca.Function("J", [ca.vertcat(a, b, c)], [ca.jacobian(value, ca.vertcat(a, b, c))])
    wanted = jacobian(place).full() @ directions.T
    got = tangents([a, ca.vertcat(b, c)], value, [place[:1], place[1:]], directions)
    np.testing.assert_allclose(got, wanted, rtol=1e-14, atol=1e-14)
