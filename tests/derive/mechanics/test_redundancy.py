"""Constraint rows that repeat others: named, dropped or kept, and the motion is the same.

Of derive.choices: redundancy.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from derive.diagnostics import AssumptionError, ModelError
from derive.formulations import equations
from derive.formulations.equations import misfits
from derive.formulations.records import Equations
from derive.mechanics.closures import CLOSINGS
from derive.model import load_text
from derive.states import system
from derive.states.sampling import States, states
from hamel.verbs import check
from hamel.verify import verification
from hamel.verify.reference.outcome import Outcome, evaluate, reference, state_of
from hamel.verify.reference.saddle import condition_of, saddle
from tests.loops import IN_SPACE, TWICE
from tests.scenes import MODELS

TEXTS = {
    "in_space": IN_SPACE,
    "twice": TWICE,
    "bricard": (MODELS / "extremes" / "bricard.yaml").read_text(),
    "lines": (MODELS / "extremes" / "redundant.yaml").read_text().replace("redundant: keep\n", ""),
}
KEEP = "\nredundant: keep\n"
DROPPED = "at the sampled states and are dropped: the reactions of all of these are not unique"
TOLD = {
    "in_space": [f"rows 3, 4 and 5 of closure C (C.z, C.turn1, C.turn2) say nothing {DROPPED}"],
    "twice": [
        f"rows 3, 4 and 5 of closure C (C.z, C.turn1, C.turn2) say nothing {DROPPED}",
        "row 3 of closure E (E.z) says nothing and rows 1 and 2 of closure E (E.x, E.y) repeat rows 1 and 2 of closure C "
        f"(C.x, C.y) {DROPPED}",
    ],
    "bricard": [
        "row 4 of closure F (F.turn1) repeats rows 1, 2, 3 and 5 of closure F (F.x, F.y, F.z, F.turn2) "
        + DROPPED.replace(" are dropped", " is dropped")
    ],
    "lines": [
        "constraint third repeats constraint first and constraint second "
        + DROPPED.replace(" are dropped", " is dropped"),
        "constraint again repeats constraint first "
        + DROPPED.replace(" are dropped", " is dropped"),
    ],
}


@pytest.mark.parametrize("name", TEXTS)
def test_one_sentence_for_each_closure_or_constraint(name: str) -> None:
    assert list(equations(system(load_text(TEXTS[name]))).assumptions) == TOLD[name]
    kept = equations(system(load_text(TEXTS[name] + KEEP))).assumptions
    assert list(kept) == [
        x.replace("dropped", "kept") + ", the least ones are given" for x in TOLD[name]
    ]


def evaluated(e: Equations, name: str, found: States) -> np.ndarray:
    """A function of the module at sampled (q, v)."""
    f = {x.name: x for x in e.functions}
    given = [a.symbols for a in e.arguments]
    assert f["state"].x is not None
    state = ca.Function(
        "x", [given[0], f["state"].x.symbols, *given[2:]], [f["state"].result.value]
    )
    made = ca.Function("f", given, [f[name].result.value])
    rows = zip(found.t, np.hstack([found.q, found.v]), found.u, found.p)
    return np.array([made(t, state(t, x, u, p), u, p).full().ravel() for t, x, u, p in rows])


def condition(outcome: Outcome) -> float:
    return condition_of(saddle(outcome.M, outcome.kinematics.A))


@pytest.mark.parametrize(
    "formulation",
    ["quasi_velocities", "maggi", "udwadia_kalaba", "udwadia_phohomsiri", "augmented"],
)
@pytest.mark.parametrize("name", TEXTS)
def test_motion_and_forces_are_those_of_the_reference_under_both_policies(
    name: str, formulation: str
) -> None:
    """v̇ and Aᵀ λ to 1e-10 per condition number, and λ of kept rows is the least of all with that
    Aᵀ λ."""
    models = [load_text(TEXTS[name]), load_text(TEXTS[name] + KEEP)]
    systems = [system(model) for model in models]
    if misfits(systems[0])[formulation]:
        pytest.skip("the formulation does not fit the model")
    found = states(systems[0], 5, seed=3)
    judge = reference(models[0])
    wanted = [
        evaluate(judge, state_of(judge, t, q, v, u, p))
        for t, q, v, u, p in zip(*(getattr(found, k) for k in "tqvup"))
    ]
    both = [equations(s, None, formulation) for s in systems]
    rates = [evaluated(e, "dynamics", found) for e in both]
    size = 1 + np.max(np.abs(rates[0]))
    for row, other, outcome in zip(*rates, wanted):
        assert np.max(np.abs(row - other)) < 1e-10 * condition(outcome) * size
    lam = [evaluated(e, "reactions", found) for e in both]
    for dropped, kept, outcome in zip(*lam, wanted):
        A, force = outcome.kinematics.A, outcome.constraint_force
        allowed = 1e-10 * condition(outcome) * (1 + np.max(np.abs(force)))
        assert (
            np.max(np.abs(A.T @ dropped - force)) < allowed
            and np.max(np.abs(A.T @ kept - force)) < allowed
        )
        assert np.max(np.abs(kept - np.linalg.pinv(A.T, rcond=1e-9) @ force)) < allowed
    if both[0].generalized_velocities:
        nq = systems[0].q.numel()
        for row, outcome in zip(rates[1], wanted):
            assert np.max(np.abs(row[nq:] - outcome.vdot)) < 1e-10 * condition(outcome) * size


@pytest.mark.parametrize("name", ["in_space", "twice", "lines"])
@pytest.mark.parametrize("policy", ["", KEEP], ids=["drop", "keep"])
def test_every_choice_passes_the_suite(name: str, policy: str) -> None:
    model = load_text(TEXTS[name] + policy)
    s = system(model)
    for choice in model.choices:
        found = verification(model, equations(s, choice.name), states=6)
        assert found.passed, [c for c in found.checks if not c.passed]


def test_a_share_that_is_not_the_least_one_is_seen() -> None:
    """A planted error: the force goes where a dropped row would leave it. It does the same to the
    motion."""
    kept, dropped = (equations(system(load_text(TEXTS["lines"] + policy))) for policy in (KEEP, ""))
    names = [a.symbols for a in dropped.arguments], [a.symbols for a in kept.arguments]
    right = next(f for f in dropped.functions if f.name == "reactions").result.value
    wrong = ca.substitute([right], [ca.vertcat(*names[0])], [ca.vertcat(*names[1])])[0]
    functions = [
        replace(f, result=replace(f.result, value=wrong)) if f.name == "reactions" else f
        for f in kept.functions
    ]
    found = verification(kept.system.model, replace(kept, functions=tuple(functions)), states=5)
    assert {c.name for c in found.checks if not c.passed} == {"λ", "outputs"}


@pytest.mark.parametrize("policy", ["", KEEP], ids=["drop", "keep"])
def test_the_violation_of_a_repeated_row_is_reported(policy: str) -> None:
    e = equations(system(load_text(TEXTS["lines"] + policy)), None, "augmented")
    f = next(f for f in e.functions if f.name == "constraints")
    assert f.result.labels[:4] == ("phi first", "phi second", "phi third", "phi again")
    value = ca.Function("f", [a.symbols for a in e.arguments], [f.result.value])
    off = value(0, [1e-3, 0, 0, 0, 0, 0], [], e.parameters).full().ravel()
    assert np.allclose(off[:4], [1e-3, 0, 1e-3, 2e-3])


def test_rows_that_contradict_each_other_are_no_repetition(tmp_path) -> None:
    file = tmp_path / "lines.yaml"
    file.write_text(TEXTS["lines"].replace("2*x", "2*x - 1 mm"))
    with pytest.raises(ModelError, match="no configuration"):
        check.run(file)


DRIVES = """
model: drives
coordinates: {x: m, y: m}
kinetic: 1 kg*(der(x)^2 + der(y)^2)/2
constraints:
  steady: {nonholonomic: "der(x) - 1 m/s"}
  swinging: {nonholonomic: "der(x) - 1 m/s*cos(t/(1 s))"}
"""


def test_rates_that_contradict_each_other_are_refused_by_name() -> None:
    """At t = 0 they agree, later they do not."""
    with pytest.raises(AssumptionError, match="steady and swinging cannot be met together") as told:
        equations(system(load_text(DRIVES)))
    assert told.value.diagnostics[0].line == 6  # where `steady` stands


SKATES = """
model: skates
plane: xy
bodies: {sled: {mass: 4 kg, com: [0.2, 0], inertia: 0.3}}
joints: {base: {type: planar, parent: ground, child: sled, coordinates: [x, y, heading]}}
constraints:
  front: {type: no_slip, body: sled, at: [0.3, 0], direction: y}
  back: {type: no_slip, body: sled, at: [-0.3, 0], direction: y}
  again: {type: no_slip, body: sled, at: [0.3, 0], direction: y}
  middle: {type: no_slip, body: sled, at: [0, 0], direction: y}
initial: {base.vx: 1 m/s}
"""


@pytest.mark.parametrize("policy", ["", KEEP], ids=["drop", "keep"])
def test_each_says_what_it_repeats_itself_and_nothing_pulls_at_all(policy: str) -> None:
    model = load_text(SKATES + policy)
    e = equations(system(model))
    again, middle = e.assumptions
    assert again.startswith("constraint again repeats constraint front at")
    assert middle.startswith("constraint middle repeats constraint front and constraint back at")
    found = verification(model, e, states=5)
    assert found.passed, [c for c in found.checks if not c.passed]


def test_a_policy_has_two_words() -> None:
    with pytest.raises(ModelError, match="unknown redundant 'maybe'"):
        load_text(IN_SPACE + "redundant: maybe\n")


def test_check_says_it(tmp_path) -> None:
    file = tmp_path / "twice.yaml"
    file.write_text(TWICE)
    assert list(check.run(file).assumptions) == TOLD["twice"]


SEAT = "{position: [0.3, 0.1, 0.2], rpy: [0.31, 0.7, -0.4]}"
WELDED = """\
model: welded
bodies: {a: {mass: 2, inertia: [0.1, 0.2, 0.15]}, b: {mass: 1, inertia: [0.1, 0.1, 0.1]}}
joints:
  h: {type: revolute, parent: ground, child: a, axis: [0.3, 0.5, 0.8], coordinate: th}
  f: {type: fixed, parent: a, child: b, at: {parent: SEAT}}
closures:
  c: {between: [a, b], at: [SEAT, [0, 0, 0]], KIND}
  d: {between: [a, b], at: [SEAT, [0, 0, 0]], type: revolute, axis: z}
constraints:
  e: {type: distance, between: [a, b], at: [[0, 0, 0], [0, 0, 0]], length: 0.3741657386773941}
"""
KINDS = {closing.name: f"type: {closing.name}, axis: x" for closing in CLOSINGS} | {
    "ball": "type: ball",
    "fixed": "type: fixed",
    "universal": "type: universal, axis: x, axis2: y",
    "screw": "type: screw, axis: x, pitch: 1e-3",
}


@pytest.mark.parametrize("kind", KINDS)
def test_what_joints_have_made_rigid_is_not_tied_again_by_rounding(kind: str) -> None:
    model = load_text(WELDED.replace("SEAT", SEAT).replace("KIND", KINDS[kind]))
    welded = system(model)
    assert welded.A.nnz() == 0 and not ca.depends_on(welded.phi, welded.q)
    judge = reference(model)
    outcome = evaluate(judge, state_of(judge, 0.0, [0.7], [1.3]))
    assert outcome.rank == 0 and not outcome.kinematics.A.any()


def test_a_weld_beside_the_first_is_told_by_what_it_is_off(tmp_path: Path) -> None:
    text = WELDED.replace("SEAT", SEAT, 1).replace("SEAT", SEAT.replace("0.3,", "0.31,"))
    (tmp_path / "m.yaml").write_text(text.replace("KIND", KINDS["ball"]))
    with pytest.raises(ModelError, match=r"c.\w is off by"):
        check.run(tmp_path / "m.yaml")
