"""Derivatives by structure are those of CasADi: every way there is, on the constraints and beside
them.

Of derive.formulations: contraction, derivatives.
Of derive.formulations.structured: afloat, displacements, factors, records, reduction, tree.
Of derive.mechanics.recursions: flows, slopes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import hamel
from derive.diagnostics import VerificationError
from derive.expressions.counting import operations
from derive.expressions.scalars import Matrix
from derive.formulations import assembly, derivatives, equations
from derive.formulations.contraction import contractions
from derive.formulations.evaluate import slots_of
from derive.formulations.motion import Motion
from derive.formulations.records import Equations
from derive.formulations.structured import reduction, tree
from derive.mechanics.records import System
from derive.mechanics.recursions import slopes
from derive.mechanics.recursions.slopes import Tree
from derive.mechanics.system import inertial_forces
from derive.model import load, load_text
from derive.robots.reading import imported
from derive.states import axes, sampling, system
from tests.scenes import MODELS

ROBOTS = Path(__file__).parents[2] / "robots"
BESIDE = 0.01  # how far off the constraints
QUICK = (
    "four_bar",
    "stanford_arm",
    "snake3",
    "rolling_disk",
    "free_body",
    "screw_press",
    "pendulum",
)
REST = (
    "andrews",
    "ball_on_beam",
    "bead_in_bowl",
    "bead_on_wire",
    "bicycle",
    "car_axis",
    "cart_pole",
    "chaplygin_sleigh",
    "gear_train",
    "hoop",
    "mobile_manipulator_6r",
    "rolling_sphere",
    "rolling_torus",
    "slider_crank",
    "snakeboard",
    "spatial_four_bar",
    "tractor_trailers",
    "universal_shaft",
    "waveboard",
)

PARALLEL_BARS = """
model: parallel_bars
plane: xy
gravity: [0, -9.81 m/s^2]
redundant: {fate}
bodies:
  a: {{mass: 1 kg, com: [0.1 m, 0], inertia: 0.01 kg*m^2}}
  b: {{mass: 2 kg, com: [0.25 m, 0], inertia: 0.05 kg*m^2}}
  c: {{mass: 1.5 kg, com: [0.1 m, 0], inertia: 0.03 kg*m^2}}
  d: {{mass: 0.8 kg, com: [0.1 m, 0], inertia: 0.02 kg*m^2}}
joints:
  A: {{type: revolute, parent: ground, child: a, coordinate: q1}}
  B: {{type: revolute, parent: a, child: b, at: [0.2 m, 0], coordinate: q2}}
  D: {{type: revolute, parent: ground, child: c, at: [0.5 m, 0], coordinate: q3}}
  E: {{type: revolute, parent: ground, child: d, at: [0.3 m, 0], coordinate: q4}}
closures:
  C1: {{type: revolute, between: [b, c], at: [[0.5 m, 0], [0.2 m, 0]]}}
  C2: {{type: revolute, between: [b, d], at: [[0.3 m, 0], [0.2 m, 0]]}}
initial: {{q1: 1 rad, guess: {{q2: -1 rad, q3: 1 rad, q4: 1 rad}}}}
"""


def mechanics_of(name: str) -> System:
    """A model of models/, or a robot of the tests with a free root."""
    if (ROBOTS / name).exists():
        return system(imported(ROBOTS / name, True).model, "all")
    return system(load(MODELS / f"{name}.yaml"), "all")


def derived(
    mechanics: System, monkeypatch: pytest.MonkeyPatch, choice: str | None = None
) -> tuple[Equations, Motion]:
    """With the motion that the derivatives are made of."""
    seen: list[Motion] = []
    whole = assembly.derivatives

    def watched(arguments, functions, found):
        seen.append(found[1])
        return whole(arguments, functions, found)

    monkeypatch.setattr(assembly, "derivatives", watched)
    return equations(mechanics, choice), seen[-1]


def states_of(found: Equations, count: int) -> Iterator[tuple]:
    """Arguments of `dynamics` at admissible states and beside them."""
    s = sampling.states(found.system, count, 5)
    state = found.function("state")
    at = ca.Function("state", slots_of(found, state), [ca.densify(state.result.value)])
    rng = np.random.default_rng(0)
    for t, q, v, u in zip(s.t, s.q, s.v, s.u):
        x = np.array(at(t, np.r_[q, v], u, found.parameters)).ravel()
        yield t, x, u, found.parameters
        yield t, x + BESIDE * rng.normal(size=len(x)), u, found.parameters


def all_ways(found: Equations, motion: Motion) -> list[ca.SX]:
    dynamics = found.function("dynamics")
    slots = {argument.name: argument for argument in found.arguments}
    ways = derivatives.Ways(dynamics, slots, (found.system, motion)).all
    return [ca.densify(ca.horzcat(x.rates, x.by_x, x.by_u)) for x in ways]


def agree(found: Equations, values: list[ca.SX], tolerance: float = 1e-9) -> None:
    at = ca.Function("ways", [a.symbols for a in found.arguments], values)
    for row in states_of(found, 2):
        first, *others = (np.array(x) for x in at(*row))
        for other in others:
            scale = np.abs(first) + 1e-3 * np.abs(first).max()
            assert np.max(np.abs(other - first) / scale) < tolerance


def every_way(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found, motion = derived(mechanics_of(name), monkeypatch)
    values = all_ways(found, motion)
    assert len(values) >= 3
    agree(found, values)


@pytest.mark.parametrize("name", QUICK)
def test_every_way_is_the_same(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    every_way(name, monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize("name", REST)
def test_every_way_of_the_other_models(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    every_way(name, monkeypatch)


@pytest.mark.parametrize("fate", ["drop", "keep"])
@pytest.mark.parametrize("choice", ["auto", "orthonormal", "mass_orthogonal", "frozen"])
def test_every_way_where_rows_repeat_others(
    choice: str, fate: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A parallelogram with a third bar, whose rows depend on each other on the constraints
    alone."""
    mechanics = system(load_text(PARALLEL_BARS.format(fate=fate)), "all")
    found, motion = derived(mechanics, monkeypatch, choice)
    values = all_ways(found, motion)
    assert len(values) >= 2
    agree(found, values)


def test_structure_is_of_no_use_where_s_is_of_other_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Along axes that turn rows hold terms that vanish on the constraints, and the elimination
    leaves these out: by structure ∂ẋ/∂x was off by as much as it is large."""
    monkeypatch.setattr(axes, "_share", lambda s: float(s.model.closures[0].along == 1))
    s = system(load_text(PARALLEL_BARS.format(fate="drop")), "all")
    assert [x.along for x in s.model.closures] == [1, 1]
    found, motion = derived(s, monkeypatch)
    assert len(all_ways(found, motion)) == 1
    monkeypatch.setattr(reduction, "_is_null_space", lambda *_: True)
    with pytest.raises(AssertionError):
        agree(found, all_ways(found, motion))


def test_a_robot_afloat(monkeypatch: pytest.MonkeyPatch) -> None:
    """A free root with a quaternion: what it does not feel is not solved for, and the structure is
    what is chosen."""
    monkeypatch.setattr(tree, "UNROLLED", 10**9)
    found, motion = derived(mechanics_of("quadruped.urdf"), monkeypatch)
    values = all_ways(found, motion)
    agree(found, values)
    counts = [operations(value) for value in values]
    assert min(counts) < 0.7 * counts[0]
    assert operations(found.request("derivatives").function.result.value) == min(counts)


def test_slopes_of_a_tree_are_those_of_newton_euler() -> None:
    """M, ½ ∂h/∂v and the displacements against the differentiated recursion; ½ ∂h/∂v v is h less
    gravity."""
    mechanics = mechanics_of("quadruped.urdf")
    n, v = mechanics.v.numel(), mechanics.v
    vdot = ca.SX.sym("vdot", n)
    tree = Tree(
        mechanics.links,
        mechanics.inertias[0],
        [v[j] for j in range(n)],
        [mechanics.gravity for _ in mechanics.links],
    )
    M, H = tree.masses()
    D = tree.displacements([vdot[j] for j in range(n)])
    forces = inertial_forces(mechanics, vdot)
    still = ca.substitute(forces, ca.vertcat(v, vdot), ca.SX.zeros(2 * n))
    known = [
        (_matrix(M), ca.jacobian(forces, vdot)),
        (_matrix(H), 0.5 * ca.jacobian(forces, v)),
        (_matrix(D), ca.mtimes(ca.jacobian(forces, mechanics.q), mechanics.N)),
        (ca.vertcat(*tree.weights()), still),
        (ca.mtimes(_matrix(H), v) + still, ca.substitute(forces, vdot, ca.SX.zeros(n))),
    ]
    at = ca.Function(
        "known", [mechanics.q, v, vdot], [ca.densify(x) for pair in known for x in pair]
    )
    rng = np.random.default_rng(2)
    found = [
        np.array(x) for x in at(rng.normal(size=mechanics.q.numel()), *rng.normal(size=(2, n)))
    ]
    for ours, wanted in zip(found[::2], found[1::2]):
        np.testing.assert_allclose(ours, wanted, atol=1e-11 * max(1.0, np.abs(wanted).max()))


def _matrix(rows: Matrix) -> ca.SX:
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))


@pytest.mark.parametrize("planted", ["flow_couple", "flow_wrench", "_crossed"])
def test_a_wrong_recursion_is_seen(planted: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is carried to the base, too large by a thousandth."""
    right = getattr(slopes, planted)

    def wrong(*arguments):
        result = right(*arguments)
        if isinstance(result, tuple):
            return [1.001 * x for x in result[0]], result[1]
        return [1.001 * x for x in result]

    monkeypatch.setattr(slopes, planted, wrong)
    with pytest.raises(AssertionError):
        every_way("stanford_arm", monkeypatch)


def test_without_the_multipliers_it_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    """∂(Aᵀλ)/∂q is part of what a loop's motion depends on."""
    found, motion = derived(mechanics_of("four_bar"), monkeypatch)
    assert motion.minimal is not None
    without = replace(motion, minimal=replace(motion.minimal, lam=0.0 * motion.minimal.lam))
    agree(found, all_ways(found, motion))
    with pytest.raises(AssertionError):
        agree(found, all_ways(found, without))


@pytest.mark.parametrize("name", ["stanford_arm", "four_bar", "snake3", "free_body"])
def test_contractions_are_the_same(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """And symmetric: d·(H e) = e·(H d)."""
    found, motion = derived(mechanics_of(name), monkeypatch)
    slots = [argument.symbols for argument in found.arguments]
    z, rates = ca.vertcat(slots[1], slots[2]), found.function("dynamics").result.value
    y, d, e = (ca.SX(ca.DM(np.random.default_rng(k).normal(size=z.numel()))) for k in range(3))
    y = y[: rates.numel()]
    seeds = ca.SX.sym("y", rates.numel()), ca.SX.sym("d", z.numel())
    ways = [
        ca.substitute(x, ca.vertcat(*seeds), ca.vertcat(y, d))
        for x in contractions(found.system, motion, z, *seeds)
    ]
    plain = ca.jtimes(ca.gradient(ca.dot(y, rates), z), z, d)
    agree(found, [plain, *ways], 1e-8)
    along = ca.jtimes(ca.gradient(ca.dot(y, rates), z), z, e)
    agree(found, [1e3 + ca.dot(e, ways[0]), 1e3 + ca.dot(d, along)], 1e-8)


@pytest.fixture
def looped(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Where a loop over columns is used however short it is."""
    monkeypatch.setattr(tree, "UNROLLED", 0)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path


def test_a_loop_over_columns_gives_the_same(looped: Path) -> None:
    """In C and NumPy, one state and many, against the graph without it: the build verifies them."""
    functions = ("default", "derivatives", "dynamics")
    hamel.build(MODELS / "stanford_arm.yaml", out=looped / "arm", functions=functions)
    text = (looped / "arm" / "stanford_arm.c").read_text("utf-8")
    assert "stanford_arm_derivatives_solve" in text + _long(looped / "arm")


def _long(folder: Path) -> str:
    return "".join(path.read_text("utf-8") for path in folder.glob("*_derivatives.c"))


def test_a_wrong_loop_is_not_published(looped: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One factor of the elimination off by a thousandth."""
    whole = tree._elimination

    def wrong(*arguments):
        found = whole(*arguments)
        factor = ca.DM.ones(found.values.numel())
        factor[0] = 1.001
        return replace(found, values=found.values * factor)

    monkeypatch.setattr(tree, "_elimination", wrong)
    with pytest.raises(VerificationError, match="nothing is written"):
        hamel.build(
            MODELS / "double_pendulum.yaml",
            out=looped / "pendulum",
            functions=("default", "derivatives"),
        )
    assert not (looped / "pendulum").exists()
