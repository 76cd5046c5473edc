"""Every formulation, on every model and choice it fits, is the same motion; where it does not fit
it says why."""

from __future__ import annotations

import functools

import casadi as ca
import numpy as np
import pytest

from derive.diagnostics import AssumptionError, ModelError
from derive.formulations import FORMULATIONS, equations, misfits
from derive.formulations.records import Equations
from derive.mechanics.records import System
from derive.model import load, load_text
from derive.states import system
from derive.states.sampling import states
from hamel.verify.reference.saddle import condition_of, row_condition, saddle, solved
from tests.evaluation import accelerations, arguments, functions
from tests.scenes import MODELS, derived, is_tree, mechanics

EXACT = 1e-10  # per condition number
KINDS = ("orthonormal", "frozen", "mass_orthogonal")
QUICK = {
    "four_bar",
    "snake3",
    "bead_in_bowl",
    "car_axis",
    "chaplygin_sleigh",
}  # the other models' further choices are slow tests
NONE = {("snake3", "world")}  # rates of x and y depend on each other through the wheel of link 1


@functools.cache
def reasons(name: str) -> dict[str, str]:
    return misfits(mechanics(name))


@functools.cache
def judged(name: str, count: int):
    """Admissible states with v̇, λ and the condition there, from the System's terms alone."""
    s = mechanics(name)
    return truth(s, states(s, count, seed=5))


def truth(s: System, found):
    terms = ca.Function(
        "f", [s.t, s.q, s.v, s.u, s.p], [ca.densify(x) for x in (s.M, s.h, s.Q, s.A, s.beta)]
    )
    rows = []
    for state in zip(found.t, found.q, found.v, found.u, found.p):
        M, h, Q, A, beta = (x.full() for x in terms(*state))
        redundant = len(A) > 0 and np.linalg.matrix_rank(A, tol=1e-9) < len(A)
        z = solved(saddle(M, A), np.concatenate([Q - h, beta]).ravel(), redundant)[0]
        rows.append((A, z[: len(M)], -z[len(M) :], condition_of(saddle(M, A))))
    return found, rows


def combinations():
    """Quick: every formulation, with the declared choices of quasi-velocities. Slow: every pair
    there is, at 100 states."""
    for path in sorted(MODELS.glob("*.yaml")):
        name = path.stem
        declared = [choice.name for choice in load(path).choices if (name, choice.name) not in NONE]
        for formulation in FORMULATIONS:
            chosen = (
                [*declared, *(kind for kind in KINDS if kind not in declared)]
                if formulation.chooses
                else [None]
            )
            for k, choice in enumerate(chosen):
                own = formulation.name == "quasi_velocities" and choice in declared
                quick = (
                    own
                    or not formulation.chooses
                    or (name in QUICK and (k == 0 or formulation.name != "maggi"))
                )
                label = f"{name}-{formulation.name}" + (f"-{choice}" if choice else "")
                if quick:
                    yield pytest.param(name, formulation.name, choice, 20, id=label)
                yield pytest.param(
                    name, formulation.name, choice, 100, id=f"{label}-100", marks=pytest.mark.slow
                )


@pytest.mark.parametrize(("name", "formulation", "choice", "count"), list(combinations()))
def test_the_motion_does_not_depend_on_how_it_is_formed(name, formulation, choice, count) -> None:
    s, reason = mechanics(name), reasons(name)[formulation]
    assert bool(reason) == (formulation == "recursive" and not is_tree(s.model)), reason
    if reason:
        with pytest.raises(AssumptionError, match="formulation recursive does not fit"):
            equations(s, choice, formulation)
        return
    compare(derived(name, choice, formulation), *judged(name, count))


def compare(e: Equations, found, rows, exact: float = EXACT) -> None:
    f, conditions = functions(e), stretched(e, found, [row[3] for row in rows])
    vdot = np.array([row[1] for row in rows])
    scale = 1 + np.max(np.abs(vdot), axis=1)
    error = np.max(np.abs(accelerations(e, found) - vdot), axis=1) / scale
    assert np.max(error / conditions) < exact
    if "reactions" not in f:
        return
    for at, (A, _, lam, _), condition in zip(arguments(f, found), rows, conditions):
        ours = f["reactions"](*at).full().ravel()
        if np.linalg.matrix_rank(A, tol=1e-8) < len(A):  # only Aᵀ λ is unique then
            ours, lam = A.T @ ours, A.T @ lam
        assert np.max(np.abs(ours - lam)) / (1 + np.max(np.abs(lam))) / condition < exact


def stretched(e: Equations, found, conditions) -> np.ndarray:
    """Condition of the augmented system times that of the choice's own [A; B]."""
    Y = next((n.value for n in e.named if n.name == "Y"), None)
    if Y is None:
        return np.array(conditions)
    f = functions(e)
    at = ca.Function("Y", [a.symbols for a in e.arguments], [ca.densify(Y)])
    return np.array(
        [
            c * max(1.0, row_condition(at(*a).full()))
            for c, a in zip(conditions, arguments(f, found))
        ]
    )


def test_names_are_unique_and_have_a_source() -> None:
    assert len({f.name for f in FORMULATIONS}) == len(FORMULATIONS)
    assert all(f.source and f.about for f in FORMULATIONS)


TWO_MASSES = """
model: two_masses
description: Udwadia and Phohomsiri's kind of example; the middle coordinate is there to describe the spring and has no mass.
coordinates: {x1: m, s: m, x2: m}
parameters: {m1: 1 kg, m2: 2 kg, l: 0.3 m, k: 50 N/m, g: 9.81 m/s^2}
kinetic: m1/2*der(x1)**2 + m2/2*der(x2)**2
potential: k/2*s**2 - m2*g*x2
constraints: {chain: {holonomic: x2 - x1 - l - s}}
quasi_velocities: {best: auto}
initial: {x1: 0 m, s: 0.1 m}
"""

MASSLESS_SPIN = """
model: massless_spin
plane: xy
parameters: {m: 2 kg, r: 0.3 m, M: 0.7 kg}
bodies:
  cart: {mass: m, com: [0, 0], inertia: 0}
  wheel: {mass: M, com: [0, 0], inertia: 0}
joints:
  slide: {type: prismatic, parent: ground, child: cart, axis: x, coordinate: x}
  axle: {type: revolute, parent: cart, child: wheel, at: [0, 0], coordinate: th}
constraints: {rolls: {nonholonomic: der(x) + r*der(th)}}
inputs: {drive: {joint: axle}}
quasi_velocities: {best: auto}
"""

QUATERNION = """
model: quaternion
coordinates: {q0: "1", q1: "1", q2: "1", q3: "1"}
parameters: {J1: 0.1 kg*m^2, J2: 0.2 kg*m^2, J3: 0.25 kg*m^2, c: 0.3 N*m}
where:
  w1: 2*(-q1*der(q0) + q0*der(q1) + q3*der(q2) - q2*der(q3))
  w2: 2*(-q2*der(q0) - q3*der(q1) + q0*der(q2) + q1*der(q3))
  w3: 2*(-q3*der(q0) + q2*der(q1) - q1*der(q2) + q0*der(q3))
kinetic: (J1*w1**2 + J2*w2**2 + J3*w3**2)/2
potential: c*(q1*q2 + q0*q3)
constraints: {unit: {holonomic: q0**2 + q1**2 + q2**2 + q3**2 - 1}}
quasi_velocities: {best: auto}
initial: {q0: 1, der(q1): 0.3, der(q2): 1, der(q3): 0.1}
"""

SINGULAR = {"two_masses": TWO_MASSES, "massless_spin": MASSLESS_SPIN, "quaternion": QUATERNION}
PLACES = {
    "two_masses": "coordinate s",
    "massless_spin": "body wheel (der(th))",
    "quaternion": "coordinates q0, q1, q2, q3",
}


@pytest.mark.parametrize("name", SINGULAR)
@pytest.mark.parametrize("formulation", [f.name for f in FORMULATIONS])
def test_singular_mass_matrices(name, formulation) -> None:
    """Where rank [M; A] = nv the acceleration is unique; methods that need M⁻¹ say where M has
    none."""
    s = system(load_text(SINGULAR[name]))
    reason = misfits(s)[formulation]
    if formulation in ("quasi_velocities", "maggi", "udwadia_phohomsiri"):
        for choice in ("best", *KINDS) if formulation != "udwadia_phohomsiri" else (None,):
            compare(
                equations(s, choice, formulation), *truth(s, states(s, 20, seed=1)), exact=1e-12
            )
        return
    if formulation != "recursive":
        assert (
            reason
            == f"the mass matrix is singular at {PLACES[name]}: use udwadia_phohomsiri or quasi_velocities"
        )
    with pytest.raises(AssumptionError, match=f"formulation {formulation} does not fit"):
        equations(s, None, formulation)


@pytest.mark.parametrize("formulation", [f.name for f in FORMULATIONS if f.name != "recursive"])
def test_what_nothing_determines_is_refused_by_name(formulation) -> None:
    s = system(load_text(TWO_MASSES.replace("x2 - x1 - l - s", "x2 - x1 - l")))
    with pytest.raises(
        AssumptionError, match=r"rank \[M; A\] is less than 3: nothing determines .* coordinate s"
    ):
        equations(s, None, formulation)


def test_the_pseudo_inverse_formula_itself() -> None:
    """v̇ = [(1 − A⁺A) M; A]⁺ [F; β], evaluated as it stands."""
    s = system(load_text(QUATERNION))
    found = states(s, 10, seed=2)
    terms = ca.Function(
        "f", [s.t, s.q, s.v, s.u, s.p], [ca.densify(x) for x in (s.M, s.Q - s.h, s.A, s.beta)]
    )
    wanted = []
    for state in zip(found.t, found.q, found.v, found.u, found.p):
        M, F, A, beta = (x.full() for x in terms(*state))
        stacked = np.vstack([(np.eye(4) - np.linalg.pinv(A) @ A) @ M, A])
        wanted.append((np.linalg.pinv(stacked, rcond=1e-12) @ np.vstack([F, beta])).ravel())
    np.testing.assert_allclose(
        accelerations(equations(s, None, "udwadia_phohomsiri"), found),
        wanted,
        rtol=1e-11,
        atol=1e-11,
    )


@pytest.mark.parametrize("name", ["four_bar", "slider_crank", "snake3"])
def test_partitions_by_name(name) -> None:
    """Every independent set of generalized velocities can be asked for, in any of its spellings."""
    s = mechanics(name)
    first = s.model.velocities[0 if name != "snake3" else 3]
    by_name = [
        equations(s, word)
        for word in (
            [first.name, first.rate_of] if name != "snake3" else ["phi1,phi2", "phi1_dot phi2_dot"]
        )
    ]
    assert len({e.choice for e in by_name}) == 1
    assert by_name[0].reason == "it was asked for by name"
    with pytest.raises(ModelError, match="unknown choice"):
        equations(s, f"{first.name},{first.name}")


@pytest.mark.parametrize("name", ["four_bar", "snake3", "car_axis", "rolling_disk"])
def test_momenta_make_the_kinetic_energy_block_diagonal(name) -> None:
    """RᵀM S = 0, so that 2 T = wᵀ (SᵀM S) w + cᵀ (RᵀM R) c."""
    s = mechanics(name)
    e, found = equations(s, "mass_orthogonal"), states(s, 20, seed=3)
    named = {n.name: n.value for n in e.named}
    mixed = ca.mtimes(named["R"].T, ca.mtimes(s.M, named["S"]))
    sizes = [ca.mtimes(named[x].T, ca.mtimes(s.M, named[x])) for x in "RS"]
    at = ca.Function(
        "f", [a.symbols for a in e.arguments], [ca.densify(x) for x in (mixed, *sizes)]
    )
    for a in arguments(functions(e), found):
        off, R, S = (x.full() for x in at(*a))
        assert np.max(np.abs(off) / np.sqrt(np.outer(np.diag(R), np.diag(S)))) < 1e-9


def test_the_frozen_rows_are_constant_and_orthonormal_at_the_initial_state() -> None:
    s = mechanics("four_bar")
    B = next(n.value for n in equations(s, "frozen").named if n.name == "B")
    assert B.is_constant()
    np.testing.assert_allclose(np.array(ca.DM(B) @ ca.DM(B).T), np.eye(1), atol=1e-11)


def test_a_singular_position_is_refused_by_every_formulation_that_divides() -> None:
    """Where A loses rank the guard vanishes; nothing is returned as if it were good."""
    s = mechanics("four_bar")
    for name in ("udwadia_kalaba", "udwadia_phohomsiri", "augmented"):
        guards = next(f for f in equations(s, None, name).functions if f.name == "dynamics").guards
        assert guards and all(guard.tolerance > 0 for guard in guards)
