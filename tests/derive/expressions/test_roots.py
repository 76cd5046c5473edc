"""Roots of what is kept from below zero: derivatives are numbers on both sides.

Of derive.expressions: roots.
"""

import casadi as ca
import numpy as np
import pytest

import hamel
from derive.expressions.roots import has_bounded_roots, with_finite_slopes

TANK = """
model: tank
plane: xy
parameters: {A: 0.5 m^2, a: 5 cm^2, g: 9.81 m/s^2, k: 2000 N/m, s: 1e5 N/m^1.5}
bodies: {swimmer: {mass: 1 kg}}
joints: {guide: {type: prismatic, parent: ground, child: swimmer, axis: y, coordinate: y}}
states: {h: {rate: "-a/A*sqrt(max(2*g*h, 0))", initial: 0.5 m}}
loads:
  lift: {type: expression, joint: guide, expression: "k*max(h - y, 0 m) - s*max(y - 0.6 m, 0 m)^1.5"}
initial: {y: 0.4 m}
"""
DERIVED = (
    "jacobian",
    "jacobian_p",
    "derivatives",
    "dynamics_forward",
    "dynamics_adjoint",
    "jacobian_forward",
    "contraction",
    "dynamics_hessian",
    "step_sensitivity",
    "linearization",
)


@pytest.mark.parametrize(
    ("root", "is_one"),
    [
        (lambda x: ca.sqrt(19.62 * ca.fmax(x, 0)), True),
        (lambda x: ca.fmax(0, x - 1) ** 1.5, True),
        (lambda x: ca.sqrt(ca.fmin(ca.fmax(x, 0), 4)), True),
        (lambda x: ca.sqrt(ca.fmax(x, 1)), False),
        (lambda x: ca.sqrt(1 + ca.fmax(x, 0)), False),
        (lambda x: ca.sqrt(x) * ca.fmax(x, 0), False),
        (lambda x: ca.sqrt(x / ca.fmax(x, 0)), False),
    ],
)
def test_slopes_are_finite_below_zero_and_the_same_above(root, is_one):
    x = ca.SX.sym("x")
    value = root(x)
    assert has_bounded_roots(value) == is_one
    slopes = ca.densify(ca.vertcat(ca.jacobian(value, x), ca.hessian(value, x)[0]))
    plain, finite = (ca.Function("f", [x], [f]) for f in (slopes, with_finite_slopes(slopes)))
    assert np.array_equal(np.array(plain(2.0)), np.array(finite(2.0)))
    if is_one:
        assert not np.isfinite(np.array(plain(-2.0))).all()
        assert np.array(finite(-2.0)).tolist() == [[0.0], [0.0]]


def test_every_derivative_of_a_tank_is_verified(tmp_path):
    """Below its outlet nothing flows, and above the stop nothing presses."""
    path = tmp_path / "tank.yaml"
    path.write_text(TANK)
    built = hamel.build(path, out=tmp_path / "tank", functions=("default", *DERIVED))
    module = hamel.load(built.folder)
    slopes = module.jacobian(0.0, np.array([0.3, 0.0, -0.1]), np.zeros(0), module.defaults)
    assert slopes[2].tolist() == [0.0, 0.0, 0.0]
    emptied = hamel.simulate(path, time=700.0, integrator="radau", rtol=1e-4)
    assert emptied.motion["h"][-1] < 1e-6
