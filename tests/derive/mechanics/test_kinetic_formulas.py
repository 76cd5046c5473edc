"""Kinetic energies by formula in the own velocities of a joint: what a body carries along.

Of derive.mechanics: analytic. Of derive.joints: planar, ball, free. Of derive.formulations:
control. Of hamel.verify.reference: analytic.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from derive.formulations import equations
from derive.mechanics.records import System
from derive.model import load_text
from derive.states import system
from derive.states.sampling import states
from hamel.verify.reference.outcome import evaluate, reference, state_of

TEXT = """
model: carried
{plane}
parameters: {{m: 3 kg, a: 0.4 m, b: 0.3 m, c: -0.2 m, J1: 0.3 kg*m^2, J2: 0.4 kg*m^2, J3: 0.6 kg*m^2}}
bodies:
  hull: {{mass: 2 kg, com: {com}, inertia: {J}}}
  arm: {{mass: 1 kg, com: {com}, inertia: {J}}}
{cargo}
joints:
  base: {{type: {kind}, parent: ground, child: hull{euler}}}
  j: {{type: revolute, parent: hull, child: arm, coordinate: q, {axis}at: {com}}}
"""
PLANE = {"com": "[0.1, 0.2]", "J": "0.1", "axis": "", "plane": "plane: xy"}
SPACE = {
    "com": "[0.1, 0.2, -0.1]",
    "J": "[0.1, 0.2, 0.25]",
    "axis": "axis: [0.6, 0, 0.8], ",
    "plane": "",
}
# T of a body of mass m at (a, b, c) with main inertias J about its centre
FLAT = (
    "m*((base.vx - base.w*b)^2 + (base.vy + base.w*a)^2)/2 + J3*base.w^2/2",
    "mass: m, com: [a, b], inertia: J3",
)
SPIN = "(J1*base.wx^2 + J2*base.wy^2 + J3*base.wz^2)/2"
LINEAR = ("base.wy*c - base.wz*b", "base.wz*a - base.wx*c", "base.wx*b - base.wy*a")
WHOLE = "mass: m, com: [a, b, c], inertia: [J1, J2, J3]"
MOVED = " + ".join(f"m*(base.v{x} + {w})^2/2" for x, w in zip("xyz", LINEAR)) + f" + {SPIN}"
SWUNG = " + ".join(f"m*({w})^2/2" for w in LINEAR) + f" + {SPIN}"
EULER = ", orientation: {euler: zyx}"
CASES = {
    "planar": ("planar", "", PLANE, *FLAT),
    "planar, upright": ("planar", "", PLANE | {"plane": "plane: xz"}, *FLAT),
    "free": ("free", "", SPACE, MOVED, WHOLE),
    "free, angles": ("free", EULER, SPACE, MOVED, WHOLE),
    "ball": ("ball", "", SPACE, SWUNG, WHOLE),
    "ball, angles": ("ball", EULER, SPACE, SWUNG, WHOLE),
}


def made(name: str, formula: bool) -> System:
    kind, euler, sizes, energy, cargo = CASES[name]
    body = "" if formula else f"  cargo: {{{cargo}}}"
    text = TEXT.format(kind=kind, euler=euler, cargo=body, **sizes)
    text += (
        f"kinetic: {energy}\n" if formula else "  k: {type: fixed, parent: hull, child: cargo}\n"
    )
    return system(load_text(text))


@pytest.mark.parametrize("name", CASES)
def test_a_body_and_the_formula_of_its_energy_are_the_same(name: str) -> None:
    """M, h and T of a body fixed to the hull. The formula was in T alone."""
    given, whole = made(name, True), made(name, False)
    found = states(given, 3, seed=1)
    values = [
        ca.Function("terms", [s.t, s.q, s.v, s.p], [ca.densify(s.M), ca.densify(s.h), s.T])
        for s in (given, whole)
    ]
    for k in range(len(found.t)):
        at = (found.t[k], found.q[k], found.v[k], found.p[k])
        for own, expected in zip(*(f(*at) for f in values)):
            np.testing.assert_allclose(own.full(), expected.full(), atol=1e-12, rtol=1e-12)


MIXED = {
    "planar": "m*base.vx*der(x)*0.1 + m*(1 + 0.1*sin(q))*base.vy^2/2 + m*b*base.vy*der(q)*cos(th)"
    " + J1*base.w^2/2",
    "in time": "m*(1 + 0.1*sin((2 rad/s)*t))*base.vx^2/2 + m*base.vy*(1 m/s)",
    "free": "m*base.vx^2/2 + m*base.vx*base.vy*0.1 + m*base.vz*der(q)*a*sin(q) + J1*base.wx^2/2",
    "ball": "J1*base.wx^2/2 + 0.1*J2*base.wy*der(q)",
}


def mixed(name: str) -> System:
    kind = name if name != "in time" else "planar"
    sizes = PLANE if kind == "planar" else SPACE
    names = ", coordinates: [x, y, th]" if kind == "planar" else ""
    text = TEXT.format(kind=kind, euler=names, cargo="", **sizes)
    return system(load_text(f"{text}kinetic: {MIXED[name]}\n"))


@pytest.mark.parametrize("name", MIXED)
def test_the_reference_says_the_same_of_velocities_beside_rates(name: str) -> None:
    """By brackets of twists, where T is of rates, velocities, coordinates and time."""
    s = mixed(name)
    found = states(s, 3, seed=2)
    terms = ca.Function("terms", [s.t, s.q, s.v, s.u, s.p], [s.M, s.Q - s.h, s.T])
    ref = reference(s.model)
    for k in range(len(found.t)):
        at = [x[k] for x in (found.t, found.q, found.v, found.u, found.p)]
        M, force, T = (x.full() for x in terms(*at))
        known = evaluate(ref, state_of(ref, *at))
        np.testing.assert_allclose(M, known.M, atol=1e-12)
        np.testing.assert_allclose(force.ravel(), known.Q - known.h, atol=1e-11)
        np.testing.assert_allclose(T, known.T, rtol=1e-12)


@pytest.mark.parametrize(
    "name", [*CASES, *(f"mixed {name}" for name in MIXED if "time" not in name)]
)
def test_coriolis_matrix_makes_the_rate_of_the_mass_matrix(name: str) -> None:
    """Ṁ = C + Cᵀ and C w = bias without gravity."""
    s = mixed(name.removeprefix("mixed ")) if name.startswith("mixed") else made(name, True)
    e = equations(s)
    x = e.argument("x").symbols
    M, C, bias, gravity = (
        e.request(n).function.result.value for n in ("mass_w", "coriolis_w", "bias_w", "gravity_w")
    )
    nq = s.q.numel()
    rates = e.function("dynamics").result.value[:nq]
    rate = ca.reshape(ca.jtimes(ca.vec(ca.densify(M)), x[:nq], rates), *M.shape)
    gaps = [rate - C - C.T, ca.mtimes(C, x[nq:]) + gravity - bias]
    slots = [slot.symbols for slot in e.arguments]
    found = ca.Function("gaps", slots, [ca.densify(gap) for gap in gaps])
    at = np.random.default_rng(3).normal(size=x.numel())
    u, p = np.zeros(slots[2].numel()), np.array(e.parameters, dtype=float)
    for gap in found(0.2, at, u, p):
        np.testing.assert_allclose(gap.full(), 0.0, atol=1e-12)


def test_a_body_in_a_fluid_moves_by_kirchhoffs_equations() -> None:
    """Munk's moment: (m₁ − m₂) v_x v_y turns a slender body across."""
    text = """
model: slender
plane: xy
bodies: {hull: {mass: 2 kg, inertia: 0.1}}
joints: {base: {type: planar, parent: ground, child: hull}}
kinetic: (1 kg)*base.vx^2/2 + (6 kg)*base.vy^2/2 + (0.05 kg*m^2)*base.w^2/2
"""
    s = system(load_text(text))
    h = ca.Function("h", [s.q, s.v], [ca.densify(s.h)])([0, 0, 0.7], [2, 0.5, 0.3]).full().ravel()
    np.testing.assert_allclose(h, [-8 * 0.5 * 0.3, 3 * 2 * 0.3, (8 - 3) * 2 * 0.5], atol=1e-14)
