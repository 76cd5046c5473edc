"""Random mechanisms: trees with every joint type, closures and constraints that can be met, loads
of every type.

Each is a Model made by hand, so that neither the loader nor the model files decide what is tried.
The suite compares it with the independent reference: M, h, Q, φ, A, β, v̇, λ, energies, power
balance, inverse dynamics.
"""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import HealthCheck, Phase, given, reject, settings
from hypothesis import strategies as st

from derive.diagnostics import AssumptionError
from derive.formulations import equations
from derive.mechanics.records import System
from derive.model import load_text
from derive.model.records import (
    Model,
)
from derive.states import system
from hamel.verify import verification
from hamel.verify.checks.samples import samples
from hamel.verify.mutation.errors import wrong_systems
from hamel.verify.reference.outcome import reference
from tests.mechanisms import EVERY_LOAD, LOOPS, MEETINGS, TREE, mechanism

# ---- checking them
# --------------------------------------------------------------------------------------------------------


# random lengths and masses cancel worse than those of a designed machine; a wrong sign errs by 1
LOOSER = 10.0


def check(model: Model, formulation: str = "augmented", states: int = 2) -> System:
    """The suite: v̇ to 1e-9 × condition, power balance, M symmetric and semidefinite, inverse
    dynamics, and the terms apart."""
    try:
        mechanics = system(model)
        chosen = equations(mechanics, None, formulation)
    except AssumptionError:
        reject()  # no regular configuration near enough: nothing is claimed of it
    # as it was derived: where rows repeat, points may meet along other axes
    found = verification(chosen.system.model, chosen, states=states)
    wrong = {c.name: c.value for c in found.checks if c.value > LOOSER * c.tolerance}
    assert not wrong, (wrong, model.joints, model.closures, model.constraints, model.loads)
    return mechanics


ENDS = st.tuples(st.integers(0, 5), st.integers(0, 5))
SEEDS = st.integers(0, 10**6)


def some(kinds, least: int, most: int, ends=ENDS):
    return st.lists(st.tuples(st.sampled_from(tuple(kinds)), ends), min_size=least, max_size=most)


def trees(most: int):
    return some(TREE, 1, most, st.integers(0, 5))


def profile(examples: int):
    """The same examples every time, and no stopwatch: these are checks of mathematics on machines
    of any speed."""
    quiet = (HealthCheck.too_slow, HealthCheck.filter_too_much)
    steps = (Phase.explicit, Phase.generate)  # a smaller example is not worth five minutes
    return settings(
        max_examples=examples,
        derandomize=True,
        deadline=None,
        database=None,
        phases=steps,
        suppress_health_check=quiet,
    )


def one_rolling(meetings):
    """Rods, surfaces and gears, then one rolling body at most."""
    rolling = [m for m in meetings if m[0] in ("sphere", "disk", "torus")]
    return [m for m in meetings if m not in rolling] + rolling[:1]


@profile(12)
@given(tree=trees(4), loads=some(EVERY_LOAD, 0, 3), seed=SEEDS)
@pytest.mark.slow
def test_trees(tree, loads, seed):
    check(mechanism(tree, loads=loads, seed=seed), "quasi_velocities")


@profile(14)
@given(tree=trees(5), loops=some(LOOPS, 1, 3), loads=some(EVERY_LOAD, 0, 2), seed=SEEDS)
def test_loops(tree, loops, loads, seed):
    check(mechanism(tree, loops, loads=loads, seed=seed))


@profile(8)
@given(tree=trees(4), loops=some(LOOPS, 0, 1), meetings=some(MEETINGS, 1, 2), seed=SEEDS)
def test_constraints(tree, loops, meetings, seed):
    check(mechanism(tree, loops, one_rolling(meetings), seed=seed))


@profile(3)
@given(loop=some(LOOPS, 1, 1), seed=SEEDS)
@pytest.mark.slow
def test_loops_without_multipliers(loop, seed):
    check(mechanism([("free", 0)], loop, seed=seed), "quasi_velocities")


@pytest.mark.slow
@profile(150)
@given(
    tree=trees(7),
    loops=some(LOOPS, 0, 3),
    meetings=some(MEETINGS, 0, 2),
    loads=some(EVERY_LOAD, 0, 4),
    seed=SEEDS,
)
def test_large_mechanisms(tree, loops, meetings, loads, seed):
    check(mechanism(tree, loops, one_rolling(meetings), loads, seed), states=4)


@pytest.mark.slow
@profile(25)
@given(
    tree=trees(4),
    loops=some(LOOPS, 0, 2),
    meetings=some(MEETINGS, 0, 1),
    loads=some(EVERY_LOAD, 0, 2),
    seed=SEEDS,
)
def test_large_mechanisms_without_multipliers(tree, loops, meetings, loads, seed):
    check(mechanism(tree, loops, meetings, loads, seed), "quasi_velocities", states=4)


# ---- one of each
# ----------------------------------------------------------------------------------------------------------

TWO_FREE = [("free quaternion", 0), ("revolute", 1), ("ball", 0), ("universal", 3)]


@pytest.mark.parametrize("kind", LOOPS)
def test_every_closure(kind):
    mechanics = check(mechanism(TWO_FREE, [(kind, (1, 4))], seed=7))
    assert len(mechanics.rows) == LOOPS[kind]


@pytest.mark.parametrize("kind", LOOPS)
def test_every_closure_to_the_ground(kind):
    assert len(check(mechanism(TWO_FREE, [(kind, (1, 0))], seed=8)).rows) == LOOPS[kind]


@pytest.mark.parametrize("kind", MEETINGS)
def test_every_constraint(kind):
    assert len(check(mechanism(TWO_FREE, meetings=[(kind, (1, 4))], seed=9)).rows) == MEETINGS[kind]


def test_every_joint_and_every_load_at_once():
    tree = [(kind, i) for i, kind in enumerate(TREE)]
    loads = [(kind, (i, i + 2)) for i, kind in enumerate(EVERY_LOAD)]
    check(mechanism(tree, loads=loads, seed=10), "augmented")


@pytest.mark.parametrize("plane", ["xy", "xz", "yz"])
@pytest.mark.parametrize("kind", ["revolute", "prismatic", "fixed"])
def test_planar_closures(kind, plane):
    check(
        load_text(
            PLANAR.format(
                kind=kind,
                plane=plane,
                axis=f"axis: {plane[1]}" if kind == "prismatic" else "about: x",
            )
        )
    )


PLANAR = """
model: planar
plane: {plane}
gravity: [0.4, -9.81 m/s^2]
bodies:
  a: {{mass: 1 kg, com: [0.5, 0.1], inertia: 0.1}}
  b: {{mass: 2 kg, com: [0.4, 0], inertia: 0.2}}
  c: {{mass: 1 kg, com: [0, 0.3], inertia: 0.3}}
  w: {{mass: 1 kg, com: [0.05, 0], inertia: 0.1}}
joints:
  A: {{type: revolute, parent: ground, child: a, coordinate: q1}}
  B: {{type: revolute, parent: a, child: b, at: [1, 0], coordinate: q2}}
  C: {{type: planar, parent: ground, child: c, coordinates: [x, y, th]}}
  W: {{type: planar, parent: ground, child: w, coordinates: [wx, wy, wth]}}
closures:
  loop: {{type: {kind}, between: [b, c], at: [[1, 0], [0.2, 0]], {axis}}}
constraints:
  wheel: {{type: rolling, body: w, shape: {{disk: {{radius: 0.3 m}}}}, plane: {{normal: {plane[1]}}}}}
"""

# A closed chain of parallel hinges in space: 5 rows of which 2 say something new.
FLAT_LOOP = """
model: flat_loop
gravity: [0.4, -9.81 m/s^2, 0.3]
bodies:
  a: {mass: 1 kg, com: [0.5, 0.1, 0.2], inertia: [0.1, 0.2, 0.25, 0.01, 0, 0]}
  b: {mass: 2 kg, com: [0.4, 0, 0.1], inertia: [0.2, 0.2, 0.3, 0, 0.02, 0.01]}
  c: {mass: 1 kg, com: [0.2, 0.3, 0], inertia: [0.3, 0.1, 0.3]}
joints:
  A: {type: revolute, parent: ground, child: a, axis: z, coordinate: q1}
  B: {type: revolute, parent: a, child: b, at: [0.5, 0, 0], axis: z, coordinate: q2}
  D: {type: revolute, parent: ground, child: c, at: [1, 0, 0], axis: z, coordinate: q3}
closures:
  C: {type: revolute, between: [b, c], at: [[0.9, 0, 0], [0.7, 0, 0]], axis: z}
initial: {guess: {q1: 1 rad, q2: -1 rad, q3: 1 rad}}
"""


@pytest.mark.parametrize("formulation", ["quasi_velocities", "augmented"])
def test_redundant_rows_in_space(formulation):
    """λ is not unique then: the suite compares Aᵀ λ, v̇ and the number of independent rows."""
    model = load_text(FLAT_LOOP)
    check(model, formulation)
    ref = reference(model)
    seen = samples(system(model), ref, 3, 0)
    assert [(s.outcome.rank, len(s.outcome.lam)) for s in seen] == [(2, 5)] * 3


@pytest.mark.parametrize(
    "kind",
    ["cylindrical", "universal", "screw", "planar", "prismatic", "fixed", "ball", "revolute"],
)
def test_the_suite_sees_a_wrong_closure_row(kind):
    """A sign in A, an entry of β and of φ: the reference's own rows are not the system's."""
    model = mechanism(TWO_FREE, [(kind, (1, 4))], seed=7)
    chosen = equations(system(model), None, "augmented")
    planted = dict(wrong_systems(chosen.system))
    for what, check in (("constraint row", "A, c"), ("constraint drift", "β"), ("position", "φ")):
        found = verification(chosen.system.model, replace(chosen, system=planted[what]), states=2)
        assert check in {check.name for check in found.failed}, what
