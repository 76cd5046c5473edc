"""Long trees with rows: what is prescribed or coupled costs by link, as the tree itself does.

Of derive.choices: few_rows.
Of derive.formulations: projection.
Of derive.formulations.methods: quasi_velocities.
Of derive.mechanics.recursions: articulated.
Of derive.mechanics.elimination: gauss.
"""

from __future__ import annotations

import casadi as ca
import mpmath
import numpy as np
import pytest

from derive.expressions.counting import operations
from derive.formulations import equations
from derive.formulations.multipliers import bordered_solution
from derive.mechanics import records
from derive.mechanics import system as mechanics
from derive.mechanics.records import System
from derive.model import load_text
from derive.states import system
from derive.states.sampling import states
from tests.evaluation import accelerations, arguments, functions

HEAD = """
model: beam
plane: xy
gravity: [0, -9.81 m/s^2]
repeat: {{i: 1..{0}}}
bodies:
  hub: {{mass: 1 kg, com: [0.1, 0], inertia: 0.1}}
  b0: {{mass: 0.1 kg, com: [0.02, 0.01], inertia: 0.01}}
  b{{i}}: {{mass: 0.1 kg, com: [0.02, 0.01], inertia: 0.01}}
joints:
  base: {1}
  j0: {{type: revolute, parent: hub, child: b0, coordinate: q0}}
  j{{i}}: {{type: revolute, parent: "b{{i-1}}", child: "b{{i}}", at: [0.05, 0], coordinate: "q{{i}}", spring: {{stiffness: 5 N*m/rad}}}}
constraints:
"""
HINGE = "{type: revolute, parent: ground, child: hub, coordinate: turn}"
PLANAR = "{type: planar, parent: ground, child: hub, coordinates: [x, y, turn]}"
TURN = "  pt: {type: prescribed, coordinate: turn, motion: sin((3 rad/s)*t)}\n"
SLIDE = "  px: {type: prescribed, coordinate: x, motion: (0.1 m)*sin((3 rad/s)*t)}\n"
COUPLED = '  c{i}: {type: coupling, joints: ["j{i-1}", "j{i}"], ratio: -1}\n'
SPACE = """
model: rope
gravity: [0, 0, -9.81 m/s^2]
repeat: {{i: 1..{0}}}
bodies:
  hub: {{mass: 1 kg, com: [0.1, 0, 0], inertia: [0.1, 0.2, 0.3]}}
  b0: {{mass: 0.1 kg, com: [0.02, 0.01, 0], inertia: [0.01, 0.02, 0.02]}}
  b{{i}}: {{mass: 0.1 kg, com: [0.02, 0.01, 0], inertia: [0.01, 0.02, 0.02]}}
joints:
  base: {{type: revolute, parent: ground, child: hub, coordinate: yaw, axis: z}}
  j0: {{type: ball, parent: hub, child: b0}}
  j{{i}}: {{type: revolute, parent: "b{{i-1}}", child: "b{{i}}", at: [0.05, 0, 0], axis: [0.6, 0, 0.8]}}
constraints:
  pt: {{type: prescribed, coordinate: yaw, motion: sin((3 rad/s)*t)}}
  half: {{type: prescribed, coordinate: j2, motion: sin((2 rad/s)*t)}}
"""
CHAIN = """
model: chain
plane: xy
gravity: [0, -9.81 m/s^2]
repeat: {{i: 1..{0}}}
bodies:
  b0: {{mass: 0.1 kg, com: [0.05, 0.01], inertia: 0.001}}
  b{{i}}: {{mass: 0.1 kg, com: [0.05, 0.01], inertia: 0.001}}
joints:
  j0: {1}
  j{{i}}: {{type: revolute, parent: "b{{i-1}}", child: "b{{i}}", at: [0.1, 0], coordinate: "q{{i}}", damper: 0.02}}
{2}
"""
HUNG = "{type: revolute, parent: ground, child: b0, coordinate: q0}"
LOOSE = "{type: planar, parent: ground, child: b0, coordinates: [x, y, q0]}"


def held(n: int) -> str:
    closed = f"  k: {{type: revolute, between: [b{n}, ground], at: [[0.1, 0], [{0.06 * n}, 0]]}}"
    return CHAIN.format(n, HUNG, f"closures:\n{closed}\ninitial: {{guess: {{q0: -1, q1: 0.1}}}}")


def ring(n: int) -> str:
    closed = f"  k: {{type: revolute, between: [b{n}, b0], at: [[0.1, 0], [0, 0]]}}"
    guess = f'initial: {{guess: {{"q{{i}}": {6.283 / (n + 1)}}}}}'
    return CHAIN.format(n, LOOSE, f"closures:\n{closed}\n{guess}")


def mixed(n: int) -> str:
    """Every third joint prescribed, the height of the tip a function of time, a knife that moves."""
    rows = [
        *(
            f"  p{k}: {{type: prescribed, coordinate: q{k}, motion: 0.1*sin((3 rad/s)*t)}}"
            for k in range(3, n, 3)
        ),
        f'  tip: {{holonomic: "position(b{n}, [0.1, 0]).y + 0.2 m + (0.05 m)*sin((2 rad/s)*t)"}}',
        f'  knife: {{nonholonomic: "dot(velocity(b{n // 2}), direction(b{n // 2}, y)) - (0.1 m/s)*sin((2 rad/s)*t)"}}',
    ]
    return CHAIN.format(n, LOOSE, "constraints:\n" + "\n".join(rows))


def held_in_sums(n: int) -> str:
    """Quasi-velocities that are no single velocities, one of them turning with the configuration."""
    speeds = [f"der(q{k}) + der(q{k + 1})" for k in range(2, n)]
    declared = ", ".join([f"'{x}'" for x in ("(2 + cos(q1))*der(q1) + der(q0)", *speeds)])
    return f"{held(n)}\nquasi_velocities: {{sums: [{declared}]}}\n"


def held_in_space(n: int) -> str:
    text = SPACE.format(n).replace(
        "at: [0.05, 0, 0], axis", "at: [0.05, 0, 0], rpy: [0.7, 0, 0.2], axis"
    )
    closed = f"  k: {{type: ball, between: [b{n}, ground], at: [[0.05, 0, 0], [0.15, 0.1, 0.05]]}}"
    return text[: text.index("constraints:")] + f"closures:\n{closed}\n"


MODELS = {
    "held": held,
    "held, sums": held_in_sums,
    "ring": ring,
    "mixed": mixed,
    "held in space": held_in_space,
    "base turned": lambda n: HEAD.format(n, HINGE) + TURN,
    "base shifted": lambda n: HEAD.format(n, PLANAR) + SLIDE,
    "coupled": lambda n: HEAD.format(n, HINGE) + COUPLED,
    "in space": SPACE.format,
}


def made(name: str, n: int) -> System:
    return system(load_text(MODELS[name](n)))


SLOW = ("held in space", "held, sums", "base shifted")
LIKE = (*SLOW, "held")  # which "ring" resembles
NAMES = [pytest.param(x, marks=pytest.mark.slow) if x in SLOW else x for x in MODELS]


@pytest.mark.parametrize("name", NAMES)
def test_accelerations_and_reactions_are_those_of_the_bordered_matrix(name: str) -> None:
    """[M −Aᵀ; A 0] [v̇; λ] = [Q − h; β], solved in numbers."""
    s = made(name, 12)
    e, found = equations(s), states(s, 4, seed=6)
    f = functions(e)
    terms = ca.Function(
        "terms", [s.t, s.q, s.v, s.u, s.p], [ca.densify(x) for x in (s.M, s.h, s.Q, s.A, s.beta)]
    )
    vdot = accelerations(e, found)
    given = zip(found.t, found.q, found.v, found.u, found.p)
    for k, (at, state) in enumerate(zip(arguments(f, found), given)):
        M, h, Q, A, beta = (x.full() for x in terms(*state))
        K = np.block([[M, -A.T], [A, np.zeros((len(A), len(A)))]])
        wanted = np.linalg.solve(K, np.concatenate([Q - h, beta])).ravel()
        size = np.max(np.abs(wanted))
        np.testing.assert_allclose(vdot[k], wanted[: len(M)], atol=1e-10 * size)
        forces = f["reactions"](*at).full().ravel()
        np.testing.assert_allclose(forces, wanted[len(M) :], atol=1e-10 * size)


@pytest.mark.parametrize("name", MODELS)
def test_rows_are_the_slopes_of_positions(name: str) -> None:
    """A of holonomic rows is ∂φ/∂q N, whichever way its entries were found."""
    s = made(name, 12)
    found = states(s, 3, seed=1)
    own = [(i, row.position) for i, row in enumerate(s.rows) if row.position >= 0]
    slopes = ca.mtimes(ca.jacobian(s.phi[[k for _, k in own]], s.q), s.N)
    rows = s.A[[i for i, _ in own], :]
    both = ca.Function("both", [s.t, s.q, s.p], [ca.densify(slopes), ca.densify(rows)])
    for k in range(len(found.t)):
        expected, given = (x.full() for x in both(found.t[k], found.q[k], found.p[k]))
        np.testing.assert_allclose(given, expected, atol=1e-13)


@pytest.mark.parametrize("name", NAMES)
def test_the_step_of_project_is_that_of_the_bordered_matrix(name: str) -> None:
    """Nearest in the metric of M, off the constraints too."""
    s = made(name, 12)
    e = equations(s)
    closing = [i for i, x in enumerate(s.rows) if x.position >= 0]
    phi = [-s.phi[s.rows[i].position] for i in closing]
    step = bordered_solution(s.M, s.A[closing, :], [0.0] * s.v.numel(), phi).x
    moved = s.q + ca.substitute(s.qdot, s.v, ca.vertcat(*step))
    wanted = ca.Function("wanted", [s.t, s.q, s.p], [moved])
    found = states(s, 3, seed=2)
    f, rng = functions(e), np.random.default_rng(0)
    for t, x, u, p in arguments(f, found):
        nq = s.q.numel()
        off = x + 0.1 * rng.normal(size=len(x))
        moved_to = f["project"](t, off, u, p).full().ravel()[:nq]
        expected = wanted(t, off[:nq], p).full().ravel()
        for start in s.quaternions:
            expected[start : start + 4] /= np.linalg.norm(expected[start : start + 4])
        np.testing.assert_allclose(moved_to, expected, atol=1e-11)


@pytest.mark.parametrize(
    "name", [pytest.param(x, marks=pytest.mark.slow) if x in LIKE else x for x in MODELS]
)
def test_twice_the_links_take_twice_the_operations(name: str) -> None:
    """`dynamics` and `project` took the cube, `reactions` the square."""
    short, long = (equations(made(name, n)) for n in (12, 24))
    for function in ("dynamics", "project", "reactions"):
        few, many = (operations(e.function(function).result.value) for e in (short, long))
        assert many < 2.5 * few, (function, few, many)


@pytest.mark.parametrize("name", ["base turned", "in space"])
def test_slopes_have_a_mass_matrix_where_none_is_written_out(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of more links; it was one of zeros, and the slopes were infinite. By central differences."""
    monkeypatch.setattr(mechanics, "MOST_ENTRIES", 10)
    s = made(name, 5)
    assert not s.written
    e = equations(s)
    slots = [argument.symbols for argument in e.arguments]
    rates = ca.Function("rates", slots, [e.function("dynamics").result.value])
    slopes = ca.densify(e.request("derivatives").function.result.value)
    n, u = slots[1].numel(), np.zeros(slots[2].numel())
    x, p = np.random.default_rng(4).normal(size=n), np.array(e.parameters, dtype=float)
    found = ca.Function("slopes", slots, [slopes])(0.3, x, u, p).full()[:, 1 : 1 + n]
    steps = 1e-6 * np.eye(n)
    ends = [[rates(0.3, x + way * d, u, p).full().ravel() for way in (1, -1)] for d in steps]
    expected = np.array([(ahead - behind) / 2e-6 for ahead, behind in ends]).T
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("links", [2, 5])
def test_second_slopes_of_trees_alone_have_a_mass_matrix_too(
    links: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Written out as the recursion and not; it was one of zeros. By central differences."""
    monkeypatch.setattr(mechanics, "MOST_ENTRIES", 0)
    for module in (mechanics, records):
        monkeypatch.setattr(module, "LONG", 5)
    s = system(load_text(HEAD.format(links, HINGE).removesuffix("constraints:\n")))
    assert not s.written and s.long == (links > 3)
    e = equations(s)
    t, x, u, p = (argument.symbols for argument in e.arguments)
    curvature, n = e.request("contraction").function, x.numel()
    y = ca.SX.sym("y", n)
    slope = ca.gradient(ca.dot(y, e.function("dynamics").result.value), x)
    slopes = ca.Function("slopes", [t, x, u, p, y], [slope])
    at, weights, d = np.random.default_rng(4).normal(size=(3, n))
    given = [np.zeros(u.numel()), np.array(e.parameters, dtype=float)]
    ends = [slopes(0.3, at + way * 1e-6 * d, *given, weights).full() for way in (1, -1)]
    expected = (ends[0] - ends[1]).ravel() / 2e-6
    assert curvature.x is not None
    product = ca.Function("product", [t, curvature.x.symbols, u, p], [curvature.result.value])
    found = product(0.3, np.concatenate([at, weights, d]), *given).full().ravel()
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


def test_a_chain_of_which_all_is_prescribed_is_brought_there() -> None:
    """Nothing is left to move: the recursion over what is left ended in an IndexError."""
    rows = "  p{i}: {type: prescribed, coordinate: 'q{i}', motion: 0.1*sin((3 rad/s)*t)}"
    first = rows.replace("{i}", "0")
    s = system(load_text(CHAIN.format(11, HUNG, f"constraints:\n{first}\n{rows}")))
    project = functions(equations(s))["project"]
    q = project(0.2, np.zeros(12), [], []).full().ravel()
    np.testing.assert_allclose(q, 0.1 * np.sin(0.6), atol=1e-14)


LIGHT_TIP = """
model: light_tip
plane: xy
gravity: [0, -9.81 m/s^2]
repeat: {i: 1..10}
bodies:
  b0: {mass: 1 kg, com: [0.1, 0], inertia: 0.01}
  b{i}: {mass: 1 kg, com: [0.1, 0], inertia: 0.01}
  tip: {mass: 1e-9 kg, com: [0.1, 0], inertia: 1e-11}
joints:
  j0: {type: revolute, parent: ground, child: b0, coordinate: q0}
  j{i}: {type: revolute, parent: "b{i-1}", child: "b{i}", at: [0.2, 0], coordinate: "q{i}"}
  jt: {type: revolute, parent: b10, child: tip, at: [0.2, 0], coordinate: qt}
closures: {k: {type: revolute, between: [tip, ground], at: [[0.2, 0], [1.44, 0]]}}
initial: {guess: {q0: -40 deg, "q{i}": 5 deg}}
"""


def test_a_light_link_at_the_rows_costs_no_digits() -> None:
    """Half of them were lost with a link of 1e-9 kg. Against the bordered matrix in 50 digits."""
    s = system(load_text(LIGHT_TIP))
    e, found = equations(s), states(s, 2, seed=6)
    given = [s.t, s.q, s.v, s.u, s.p]
    terms = ca.Function("terms", given, [ca.densify(x) for x in (s.M, s.Q - s.h, s.A, s.beta)])
    reactions = functions(e)["reactions"]
    vdot = accelerations(e, found)
    for k, at in enumerate(arguments(functions(e), found)):
        state = [x[k] for x in (found.t, found.q, found.v, found.u, found.p)]
        M, force, A, beta = (x.full() for x in terms(*state))
        K = np.block([[M, -A.T], [A, np.zeros((len(A), len(A)))]])
        with mpmath.workdps(50):
            side = mpmath.matrix(np.concatenate([force, beta]).tolist())
            solved = mpmath.lu_solve(mpmath.matrix(K.tolist()), side)
        wanted = np.array([float(x) for x in solved])
        size = np.abs(wanted[: len(M)]).max()
        np.testing.assert_allclose(vdot[k], wanted[: len(M)], atol=1e-12 * size)
        forces = wanted[len(M) :]
        np.testing.assert_allclose(
            reactions(*at).full().ravel(), forces, atol=1e-12 * np.abs(forces).max()
        )


LIFT = "  py: {type: prescribed, coordinate: y, motion: (0.1 m)*cos((3 rad/s)*t)}\n"


def test_a_rotation_is_taken_before_a_cosine_that_stays_away_from_zero() -> None:
    """x and y are prescribed of a body whose velocities are in its own axes, and its angle goes up
    to a rad: cos stays above 0.54, but the two rows together have no pivot that varies."""
    e = equations(system(load_text(HEAD.format(4, PLANAR) + SLIDE + LIFT + TURN)))
    assert not e.function("dynamics").guards


TRAIN = """
model: train
plane: xy
repeat: {{i: 1..{0}}}
bodies:
  b0: {{mass: 1 kg, inertia: 0.1}}
  b{{i}}: {{mass: 1 kg, inertia: 0.1}}
joints:
  base: {{type: planar, parent: ground, child: b0, coordinates: [x, y, turn]}}
  j{{i}}: {{type: revolute, parent: "b{{i-1}}", child: "b{{i}}", at: [[-0.5, 0], [0.5, 0]], coordinate: "q{{i}}"}}
constraints:
  s0: {{type: no_slip, body: b0, at: [0, 0], direction: [0, 1]}}
  s{{i}}: {{type: no_slip, body: "b{{i}}", at: [0, 0], direction: [0, 1]}}
"""


def test_rows_of_many_bodies_are_taken_from_their_twists() -> None:
    """A v − c of trailers, where A holds a sum over all joints in each row."""
    counts = []
    for n in (12, 24):
        s = system(load_text(TRAIN.format(n)))
        e = equations(s)
        violation = e.function("constraints").result.value
        counts.append(operations(violation))
        x = e.argument("x").symbols
        rng = np.random.default_rng(1)
        given = [0.1, rng.normal(size=x.numel()), np.array(e.parameters, dtype=float)]
        slots = [e.argument(name).symbols for name in ("t", "x", "p")]
        rows = ca.Function("rows", slots, [violation])(*given).full()
        np.testing.assert_allclose(rows, 0.0, atol=1e-11)
    assert counts[1] < 2.2 * counts[0]
