"""What keeps a simulation on the constraints, on its branch and within one piece of the forces is
held to the reference, and every planted error in it is seen.

Of hamel.verify.checks: manifold, kinks.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import casadi as ca
import pytest

import hamel
from derive.formulations import equations
from derive.formulations.evaluate import evaluator
from derive.formulations.records import Equations
from derive.model import load, load_text
from derive.states import system
from hamel.verify.checks import kinks, manifold
from hamel.verify.checks.evidence import Evidence
from hamel.verify.mutation.mutations import mutations
from hamel.verify.reference.outcome import reference
from hamel.verify.suite import evidence, results
from tests.scenes import MODELS
from tests.texts import CAR_AXIS, PARALLELOGRAM

OWN = (*manifold.CHECKS, *kinks.CHECKS)
FEW = 4  # states: planted errors show at any of them
ON_REQUEST = ("closure", "slip", "pull", "constraint_rows", "guards", "kinks")
NEEDED = ("dynamics", "velocity", "state")  # what the checks themselves call
# a ball that rolls: a quaternion, a height and rows of velocities
BALL = """
model: ball
gravity: [0, 0, -9.81 m/s^2]
bodies: {ball: {mass: 1 kg, com: [0.01, 0, 0.02], inertia: [0.004, 0.005, 0.006]}}
joints: {J: {type: free, parent: ground, child: ball}}
constraints:
  floor: {type: rolling, body: ball, shape: {sphere: {radius: 0.1 m}}, plane: {normal: z}}
initial: {guess: {J_z: 0.1 m}}
"""
# a ramp, a sign, and a limit on both sides
PIECES = """
model: pieces
coordinates: {x: m, y: m}
kinetic: 1 kg*(der(x)^2 + der(y)^2)/2
parameters: {k: 3 N/m, mu: 0.4 N}
inputs: {F: {unit: N}}
forces: {x: "F - k*ramp(x - 0.2 m) - mu*sign(der(x))", y: "-k*clip(y, -0.3 m, 0.4 m)"}
"""
# a ball that may be on the floor or above it; deep in it, it is damping that ends on its way up
BOUNCE = """
model: bounce
plane: xz
gravity: [0, -9.81 m/s^2]
bodies: {ball: {mass: 1 kg, inertia: 0.01}}
joints: {J: {type: planar, parent: ground, child: ball, coordinates: [x, z, turn]}}
loads:
  floor: {type: contact, body: ball, plane: {normal: z}, stiffness: 200 N/m, damping: 20 s/m}
initial: {z: -0.2 m}
"""
DEEP = BOUNCE.replace("-0.2 m", "-5 m")
CASES = {
    "loop": ("four_bar", "quasi_velocities"),
    "loop in momenta": ("four_bar", "quasi_velocities", "mass_orthogonal"),
    "loop with multipliers": ("four_bar", "augmented"),
    "loop with weights": ("four_bar", "udwadia_phohomsiri"),
    "bicycle": ("bicycle", "quasi_velocities"),
    "ball": (BALL, "quasi_velocities"),
    "ball with multipliers": (BALL, "augmented"),
    "prescribed motion": (CAR_AXIS, "augmented"),
}


@cache
def seen(model: str, formulation: str = "quasi_velocities", choice: str | None = None) -> Evidence:
    """With all that there is on request of these functions."""
    found = load(MODELS / f"{model}.yaml") if "\n" not in model else load_text(model)
    chosen = equations(system(found), choice, formulation)
    return evidence(reference(found), requested(chosen), None, FEW)


def requested(chosen: Equations) -> Equations:
    names = [name for name in ON_REQUEST if chosen.offers(name)]
    further = tuple(chosen.request(name).function for name in names)
    return replace(chosen, functions=(*chosen.functions, *further))


def spoiled(e: Evidence, name: str, value: ca.SX) -> Evidence:
    """With that value of one function."""
    chosen = e.graph.equations
    function = chosen.function(name)
    wrong = replace(function, result=replace(function.result, value=value))
    functions = tuple(wrong if f.name == name else f for f in chosen.functions)
    return replace(e, graph=evaluator(replace(chosen, functions=functions)))


def red(e: Evidence) -> set[str]:
    return {result.name for result in results(e, OWN) if not result.passed}


def own_functions(e: Evidence) -> list[str]:
    return [name for name in ON_REQUEST if e.graph.has(name)]


@pytest.mark.parametrize("case", CASES)
def test_every_check_looks_and_is_green(case: str) -> None:
    e = seen(*CASES[case])
    looked = {result.name for result in results(e, OWN)}
    assert red(e) == set()
    assert {"closure", "∂ψ/∂q", "rows of A"} <= looked
    assert ("slip" in looked) is e.graph.equations.generalized_velocities
    assert ("pull" in looked) is not e.graph.equations.generalized_velocities
    assert ("guards" in looked) is e.graph.has("guards") is (case != "ball")
    assert ("product of pivots" in looked) is e.graph.has("guards")


@pytest.mark.parametrize("case", CASES)
def test_an_entry_that_is_wrong_by_a_thousandth_is_seen_in_every_function(case: str) -> None:
    """Every entry that is not zero, and an entry that should be."""
    e, unseen = seen(*CASES[case]), []
    for name in own_functions(e):
        value = ca.densify(ca.SX(e.graph.equations.function(name).result.value))
        for k in {0, value.numel() // 2, value.numel() - 1}:
            wrong = ca.SX(value)
            wrong[k] = 1.001 * wrong[k] + 1e-4
            if not red(spoiled(e, name, wrong)):
                unseen.append((name, k))
    assert unseen == []


@pytest.mark.parametrize(
    "case",
    [
        "loop",
        "loop in momenta",
        "loop with multipliers",
        "loop with weights",
        pytest.param("bicycle", marks=pytest.mark.slow),
    ],
)
def test_a_pivot_of_another_matrix_is_seen(case: str) -> None:
    """What the motion divides by and the function `guards` wrong alike, so that they agree: the
    determinant tells."""
    e = seen(*CASES[case])
    chosen = e.graph.equations
    q, first = chosen.system.q, chosen.function("dynamics").guards[0]
    wrong = replace(first, value=first.value * (1.0 + 0.01 * ca.sin(q[0])))
    dynamics = chosen.function("dynamics")
    other = replace(dynamics, guards=(wrong, *dynamics.guards[1:]))
    value = ca.SX(chosen.function("guards").result.value)
    value[0] = wrong.value / wrong.tolerance
    guards = chosen.function("guards")
    instead = {
        "dynamics": other,
        "guards": replace(guards, result=replace(guards.result, value=value)),
    }
    functions = tuple(instead.get(f.name, f) for f in chosen.functions)
    spoilt = replace(e, graph=evaluator(replace(chosen, functions=functions)))
    assert red(spoilt) == {"product of pivots"}


def test_determinants_too_small_for_a_number_are_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    """As those of many loops are."""
    given, e = manifold._divided_by, seen("four_bar")
    monkeypatch.setattr(manifold, "_divided_by", lambda *of: 1e-200 * given(*of))
    found = manifold.pivots(e)
    assert found is not None
    assert found < 1e-12


def test_the_sign_of_a_large_block_is_seen() -> None:
    """The delta robot solves six rows by reflections: what tells how near they are to singular is no
    determinant, and has its sign."""
    e = seen("gallery/delta_robot")
    assert red(e) == set()
    value = ca.SX(e.graph.equations.function("guards").result.value)
    turned = value * ca.sin(50.0 * e.graph.equations.system.q[0])
    assert "product of pivots" in red(spoiled(e, "guards", turned))


def test_an_orthonormal_choice_divides_by_lengths_of_its_own() -> None:
    """Looked at as the motion has them, in the chart whose frame moves, too."""
    model = load(MODELS / "gallery" / "governor.yaml")
    chosen = equations(system(model), "orthonormal", moving=True)
    e = evidence(reference(model), requested(chosen), None, FEW)
    assert red(e) == set()
    value = ca.SX(e.graph.equations.function("guards").result.value)
    assert red(spoiled(e, "guards", 1.001 * value)) == {"guards"}


def test_rows_that_repeat_others_are_left_out() -> None:
    """What a loop says already is said again: independent rows are looked at, and a dependent one among them is
    seen."""
    text = PARALLELOGRAM + "constraints:\n  same: {holonomic: q1 - q3}\n"
    e = seen(text)
    assert red(e) == set()
    twice = replace(e.graph.equations, kept=(0, 0))
    assert "rows of A" in red(replace(e, graph=evaluator(twice)))


@pytest.mark.parametrize(
    ("model", "entries"),
    # no line between these states crosses y = 0.4 m, which is the entry 1 of PIECES
    [(PIECES, (0, 2, 3)), (BOUNCE, (0,)), (DEEP, (1,))],
    ids=["formulas", "touching", "damping"],
)
def test_a_kink_that_is_left_out_or_elsewhere_is_seen(model: str, entries: tuple[int, ...]) -> None:
    e = seen(model)
    value = ca.SX(e.graph.equations.function("kinks").result.value)
    assert results(e, kinks.CHECKS) and red(e) == set()
    for k in entries:
        for wrong in (1.0, value[k] + 0.02):
            other = ca.SX(value)
            other[k] = wrong
            assert red(spoiled(e, "kinks", other)) == {"kinks"}, (k, wrong)


def test_a_factor_and_the_sign_of_a_kink_are_no_errors() -> None:
    e = seen(PIECES)
    value = ca.SX(e.graph.equations.function("kinks").result.value)
    assert red(spoiled(e, "kinks", -3.0 * value)) == set()


@pytest.mark.slow
@pytest.mark.parametrize("case", ["loop", "loop with multipliers", "ball"])
def test_the_mutations_in_these_functions_are_caught(case: str) -> None:
    """Operations swapped, negated, left out: the suite sees each."""
    e = seen(*CASES[case])
    chosen = e.graph.equations
    kept = tuple(f for f in chosen.functions if f.name in {*NEEDED, *own_functions(e)})
    found = mutations(chosen.system.model, replace(chosen, functions=kept), most=80)
    planted = [x for x in found.list if x.where.removesuffix("()") in own_functions(e)]
    assert len(planted) >= 10
    assert [x for x in planted if not x.caught_by] == []


NEARLY = """
model: nearly
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {l: 1 m}
bodies: {a: {mass: 1 kg, com: [0.5, 0], inertia: 0.1}, b: {mass: 1 kg, com: [0.5, 0], inertia: 0.1}}
joints:
  h: {type: revolute, parent: ground, child: a, coordinate: q}
  g: {type: revolute, parent: a, child: b, at: [l, 0], coordinate: r}
closures: {C: {type: revolute, between: [ground, b], at: [[APART m, 0], [l, 0]]}}
initial: {guess: {q: 10 deg, r: -20 deg}}
"""


def test_what_is_nearly_stretched_is_as_right_as_its_check_says(tmp_path: Path) -> None:
    """With other lengths a row is a thousand times as long, and it was told to be not finite."""
    file = tmp_path / "nearly.yaml"
    file.write_text(NEARLY.replace("APART", "1.9999999"), encoding="utf-8")
    assert hamel.check(file).degrees_of_freedom == 0
    hamel.build(file, out=tmp_path / "nearly")


def test_parameters_that_do_not_close_are_no_motion_near_by(tmp_path: Path) -> None:
    """`verify` ended with the message that no configuration satisfies the constraints."""
    file = tmp_path / "nearly.yaml"
    file.write_text(NEARLY.replace("APART", "1.999999"), encoding="utf-8")
    assert hamel.verify(file, states=10).passed
