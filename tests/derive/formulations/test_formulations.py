"""Choices of quasi-velocities: what is refused, what is preferred, what it costs, and that all of
them mean the same.

Of derive.formulations: assembly, dependence, fitness, formulation, functions, limits,
manifold, motion, multipliers, projection.
Of derive.formulations.methods: augmented, maggi, quasi_velocities, recursive, udwadia_phohomsiri.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from codegen.passes import program
from derive.diagnostics import AssumptionError, ModelError
from derive.expressions.counting import operations
from derive.formulations import choices, equations
from derive.formulations.multipliers import least_change
from derive.formulations.records import Equations
from derive.mechanics.elimination.pivoting import pivot_order
from derive.mechanics.records import System
from derive.model import load, load_text
from derive.states import system
from derive.states.sampling import states
from tests.evaluation import accelerations, arguments, functions
from tests.scenes import MODELS, derived, mechanics

EVERY = [
    (path, choice.name) for path in sorted(MODELS.glob("*.yaml")) for choice in load(path).choices
]
FITTING = [x for x in EVERY if x != (MODELS / "snake3.yaml", "world")]

PRESCRIBED = """
model: arm
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {{l: 0.3 m, m: 1 kg}}
repeat: {{i: 1..{}}}
bodies:
  b0: {{mass: m, com: [l/2, 0], inertia: 0.008}}
  b{{i}}: {{mass: m, com: [l/2, 0], inertia: 0.008}}
joints:
  j0: {{type: revolute, parent: ground, child: b0, coordinate: q0}}
  j{{i}}: {{type: revolute, parent: "b{{i-1}}", child: "b{{i}}", at: [l, 0], coordinate: "q{{i}}"}}
constraints:
  h{{i}}: {{type: prescribed, coordinate: "q{{i}}", motion: "(0.3 rad)*sin((2 rad/s)*t + i)"}}
"""


def bordered(s: System, found) -> tuple[np.ndarray, np.ndarray]:
    """v̇ and λ of [M −Aᵀ; A 0] by dense least squares."""
    f = ca.Function(
        "f", [s.t, s.q, s.v, s.u, s.p], [ca.densify(x) for x in (s.M, s.h, s.Q, s.A, s.beta)]
    )
    rows = []
    for state in zip(found.t, found.q, found.v, found.u, found.p):
        M, h, Q, A, beta = (x.full() for x in f(*state))
        K = np.block([[M, -A.T], [A, np.zeros((len(A), len(A)))]])
        rows.append(np.linalg.lstsq(K, np.concatenate([Q - h, beta]).ravel(), rcond=None)[0])
    z, nv = np.array(rows), s.v.numel()
    return z[:, :nv], z[:, nv:]


@pytest.mark.parametrize(("path", "choice"), FITTING, ids=lambda x: getattr(x, "stem", x))
def test_block_inverse(path, choice) -> None:
    """[A; B] [R S] = 1, and v = S w + R c gives back v."""
    s, e = mechanics(path.stem), derived(path.stem, choice)
    f, found = functions(e), states(s, 10, seed=6)
    named = {n.name: n.value for n in e.named}
    if "Y" not in named:
        return
    t, x, u, p = (a.symbols for a in e.arguments)
    both = ca.mtimes(named["Y"], ca.horzcat(named["R"], named["S"]))
    g = ca.Function("g", [t, x, u, p], [ca.densify(both)])
    for a, v in zip(arguments(f, found), found.v):
        np.testing.assert_allclose(g(*a).full(), np.eye(s.v.numel()), atol=1e-9)
        np.testing.assert_allclose(f["velocity"](*a).full().ravel(), v, atol=1e-9)


@pytest.mark.parametrize(
    ("model", "choice", "most"),
    [("snake3", "head", 150), ("snake3", "best", 150), ("four_bar", "crank", 120)],
)
def test_operations_stay_small(model, choice, most) -> None:
    e = equations(system(load(MODELS / f"{model}.yaml"), "all"), choice)
    dynamics = program(e, ("dynamics",)).kernels[0]
    assert dynamics.operations["total"] <= most


@pytest.mark.parametrize(
    "rows",
    [
        [[0, 1, 0, 0, 0], [0, 0, 0, -2, 0]],
        [[0, 3, 0, 0, 0]],
        [[1, 1, 1, 1, 1], [0, 0, 4, 0, 0], [0, 0, 1, 0, 2]],  # the last one is left with one entry
        [[1, 2, 0, 0, 0], [0, 1, 1, 0, 1]],
        [[0, 0, 0, 0, 2], [0, 0, 0, 2, 1], [0, 0, 3, 2, 1], [0, 1, 1, 1, 1], [1, 1, 1, 1, 1]],
    ],
)
def test_the_least_change_is_that_of_the_bordered_matrix(rows) -> None:
    random = np.random.default_rng(3)
    root, change = random.normal(size=(5, 5)), random.normal(size=len(rows))
    M, A = root @ root.T + np.eye(5), np.array(rows, dtype=float)
    n = len(rows)
    matrix = np.block([[M, A.T], [A, np.zeros((n, n))]])
    expected = np.linalg.solve(matrix, [*np.zeros(5), *change])[:5]
    found = least_change(ca.SX(M), ca.sparsify(ca.SX(A)), list(change))
    np.testing.assert_allclose([float(x) for x in found], expected, atol=1e-12)


def test_projection_of_prescribed_coordinates_solves_for_the_free_ones_alone() -> None:
    """Of n prescribed joints the matrix was bordered by n rows, which cost some n³: 22,727 operations
    of 24 links."""
    counts = [
        operations(
            equations(system(load_text(PRESCRIBED.format(n)))).function("project").result.value
        )
        for n in (5, 11, 23)
    ]
    assert counts[2] < 5 * counts[1] < 25 * counts[0] and counts[2] < 3000


def test_auto_prefers_pivots_that_cannot_vanish() -> None:
    ranked = choices(system(load(MODELS / "snake3.yaml")))
    assert ranked[0].constant_pivots and ranked[0].rows == ("v", "om")
    assert equations(system(load(MODELS / "snake3.yaml")), "best").reason.startswith(
        "w = (v, om): no pivot can vanish"
    )
    assert [r.constant_pivots for r in ranked] == sorted(
        (r.constant_pivots for r in ranked), reverse=True
    )


def test_no_guard_where_no_pivot_varies() -> None:
    head = equations(system(load(MODELS / "snake3.yaml")), "head")
    hinges = equations(system(load(MODELS / "snake3.yaml")), "hinges")
    assert not head.functions[0].guards
    assert len(hinges.functions[0].guards) == 1


def test_the_hinges_guard_vanishes_only_where_the_choice_does() -> None:
    """φ₁ = φ₂ makes the wheel axes meet in a point; anywhere else the joint rates determine the
    motion."""
    e = equations(system(load(MODELS / "snake3.yaml")), "hinges")
    guard = ca.Function("g", [a.symbols for a in e.arguments], [e.functions[0].guards[0].value])
    at = lambda a, b: abs(float(guard(0, [0.2, -0.1, 0.7, a, b, 0, 0], [0, 0], e.parameters)))  # noqa: E731
    assert at(0.4, -0.4) > 1e-3 and at(0.0, 0.9) > 1e-3 and at(0.5, 0.2) > 1e-3
    assert at(0.0, 0.0) < 1e-12


def test_a_dependent_speed_is_refused_with_its_place_and_the_constraint() -> None:
    s = system(load(MODELS / "snake3.yaml"))
    with pytest.raises(AssumptionError) as problem:
        equations(s, "world")
    (diagnostic,) = problem.value.diagnostics
    assert "depends on the constraints" in diagnostic.message and "wheel1" in diagnostic.message
    assert "world" in s.model.text.splitlines()[diagnostic.line - 1]


def test_speeds_that_are_one_are_refused_as_dependent() -> None:
    """No position is singular: base.w, of which neither speed knows, has no pivot anywhere."""
    text = (MODELS / "chaplygin_sleigh.yaml").read_text()
    same = text.replace("{v: base.vx, om: base.w}", "{v: base.vx, om: 2*base.vx}")
    with pytest.raises(AssumptionError, match=r"the speed 'om' depends on .* \(with v, om\)"):
        equations(system(load_text(same)), "body")


def test_a_wrong_number_of_speeds_is_refused() -> None:
    text = (
        (MODELS / "four_bar.yaml")
        .read_text()
        .replace("  crank: [der(q1)]", "  crank: [der(q1), der(q2)]")
    )
    with pytest.raises(AssumptionError, match="2 speeds, but the system has 1 degree of freedom"):
        equations(system(load_text(text)), "crank")


def test_unknown_names_offer_the_nearest() -> None:
    s = system(load(MODELS / "four_bar.yaml"))
    with pytest.raises(ModelError, match="did you mean 'crank'"):
        equations(s, "cranc")
    with pytest.raises(ModelError, match="did you mean 'augmented'"):
        equations(s, "crank", "augmentd")


REDUNDANT = """
model: redundant
coordinates: {x: m, y: m, z: m}
parameters: {m: 1 kg, g: 9.81 m/s^2, l: 1 m}
kinetic: m/2*(der(x)**2 + der(y)**2 + der(z)**2)
potential: m*g*y
constraints:
  one: {holonomic: x - 2*y}
  two: {holonomic: 3*x - 6*y}
  three: {nonholonomic: der(z) - x*der(y)/l}
quasi_velocities: {best: auto, user: [der(y)], even: orthonormal}
"""


@pytest.mark.parametrize("choice", ["best", "user", "even"])
def test_redundant_rows_do_not_disturb_the_answer(choice) -> None:
    s = system(load_text(REDUNDANT))
    e, found = equations(s, choice), states(s, 10, seed=1)
    np.testing.assert_allclose(accelerations(e, found), bordered(s, found)[0], atol=1e-10)


MOVING = """
model: moving
coordinates: {x: m, y: m}
parameters: {m: 1 kg, g: 9.81 m/s^2, a: 0.3 m^-1, k: 2 rad/s}
kinetic: m/2*(der(x)**2 + der(y)**2)
potential: m*g*y
constraints:
  rail: {holonomic: y - a*sin(k*t)*x**2}
quasi_velocities: {along: [der(x)], best: auto, even: orthonormal}
initial: {x: 0.5 m}
"""


@pytest.mark.parametrize("choice", ["along", "best", "even"])
def test_constraints_that_move_with_time(choice) -> None:
    """The rheonomic terms: v = S w + R c, β with φ_tt and φ_qt, power λᵀ c."""
    s = system(load_text(MOVING))
    e, found = equations(s, choice), states(s, 15, seed=3)
    np.testing.assert_allclose(accelerations(e, found), bordered(s, found)[0], atol=1e-9)
    f = functions(e)
    for a, v in zip(arguments(f, found), found.v):
        np.testing.assert_allclose(f["velocity"](*a).full().ravel(), v, atol=1e-10)
        assert abs(f["power"](*a) - energy_rate(e, a)) < 1e-5 * (1 + abs(f["power"](*a)))


def energy_rate(e: Equations, at: tuple) -> float:
    """d(T + V)/dt along the motion by central differences."""
    f, (t, x, u, p), step = functions(e), at, 1e-6

    def total(s: float) -> float:
        energy = f["energy"](t + s, x + s * f["dynamics"](t, x, u, p).full().ravel(), u, p)
        return float(ca.sum1(energy))

    return (total(step) - total(-step)) / (2 * step)


def test_a_rotation_between_unknowns_is_inverted_as_a_whole() -> None:
    angle = np.linspace(-3, 3, 40)
    values = np.moveaxis(
        np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]), 2, 0
    )
    (block,) = pivot_order(values, np.ones((2, 2), bool), np.zeros((2, 2), bool))
    assert block.rows == (0, 1) and block.grade == 1


def test_nothing_left_to_move() -> None:
    """Two constraints on two coordinates: no speeds, no quasi-velocities, still a system."""
    text = MOVING.replace("  rail:", "  wall: {holonomic: x - 0.5 m}\n  rail:").replace(
        "along: [der(x)], ", ""
    )
    e = equations(system(load_text(text)), "best")
    assert e.w == () and functions(e)["dynamics"](0.3, [0.5, 0.0], [], e.parameters).numel() == 2


ROW = """model: row
bodies:
  base: {{mass: 3 kg, inertia: [1, 2, 3]}}
  first: {{mass: 0}}
  second: {{mass: 0}}
  tip: {{mass: 1 kg, inertia: [0.1, 0.2, 0.3]}}
joints:
  turn: {{type: revolute, parent: ground, child: base, axis: y}}
  a: {{type: {}, parent: base, child: first, axis: {}}}
  b: {{type: {}, parent: first, child: second, axis: {}}}
  c: {{type: {}, parent: second, child: tip, axis: {}}}
"""
SLIDE, HINGE = "prismatic", "revolute"


@pytest.mark.parametrize(
    ("joints", "names", "line"),
    [
        ((SLIDE, "x", SLIDE, "y", SLIDE, "[1, 1, 0]"), "a, b, c", 11),
        ((SLIDE, "x", HINGE, "y", SLIDE, "z"), "", 0),
        ((SLIDE, "x", SLIDE, "x", SLIDE, "y"), "a, b", 10),
        ((HINGE, "z", SLIDE, "x", HINGE, "z, at: [[0, 0.5, 0], [0, 0.5, 0]]"), "", 0),
        ((HINGE, "z", SLIDE, "z", HINGE, "z"), "a, c", 11),
    ],
)
def test_dependent_axes_of_joints_are_named(joints, names, line) -> None:
    found = system(load_text(ROW.format(*joints)))
    if not names:
        equations(found, "auto")
        return
    with pytest.raises(AssumptionError, match=f"the axes of the joints {names} depend") as caught:
        equations(found, "auto")
    assert caught.value.diagnostics[0].line == line
