"""The System against Lagrange's equations written from positions alone, and against its own
definitions.

Of derive.mechanics.recursions: accelerations, articulated, forms, motion.
Of derive.mechanics: analytic, blocks, constraints, energies, events, outputs, rows, scene, symbols.
Of derive.mechanics.geometry: frames.
Of derive.mechanics.closures: ball, cylindrical, fixed, planar, prismatic, revolute, screw,
universal.
Of derive.mechanics.constraints: distance, holonomic, no_slip, nonholonomic, point_on_surface,
records, rolling.
Of derive.mechanics.loads: armature, bushing, damper, expression, force, friction, spring, torque.
Of derive.states: nonideal.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from derive.joints.records import Still
from derive.joints.rotations import (
    IDENTITY,
    axis_rotation,
    dot,
    inverse,
    matrix,
    merged,
    product,
    transpose,
)
from derive.joints.turns import turn
from derive.mechanics.elimination.pivoting import pivot_order
from derive.mechanics.elimination.solve import ldl_solution, lu_solution, scalars
from derive.mechanics.links import moved, summed
from derive.mechanics.records import Inertia, System
from derive.mechanics.recursions.tree import ground_positions, ground_rotations
from derive.model import load, load_text
from derive.model.loads.bushing import BushingEntry
from derive.states import system
from derive.states.closing import Kinematics
from derive.states.initial import initial_state
from derive.states.sampling import states
from tests.scenes import MODELS, SPATIAL_CHAIN

CHAINS = {
    "double_pendulum": MODELS / "double_pendulum.yaml",
    "four_bar": MODELS / "four_bar.yaml",
    "slider_crank": MODELS / "slider_crank.yaml",
}


def spatial_system() -> System:
    return system(load_text(SPATIAL_CHAIN))


def lagrange(s: System) -> tuple[ca.SX, ca.SX]:
    """M and h by differentiating T(q, q̇) and V(q), written from positions and rotation
    matrices."""
    R = ground_rotations(s.links)
    r = ground_positions(s.links, R)
    T, V = ca.SX(0), ca.SX(0)
    for link, turned, origin in zip(s.links, R, r):
        matrix = ca.vertcat(*[ca.horzcat(*row) for row in turned])
        rate = ca.reshape(ca.jtimes(ca.vec(matrix), s.q, s.v), 3, 3)
        spin = matrix.T @ rate
        omega = ca.vertcat(spin[2, 1], spin[0, 2], spin[1, 0])
        velocity = ca.jtimes(ca.vertcat(*origin), s.q, s.v)
        body = link.inertia
        moment, tensor = (
            matrix @ ca.vertcat(*body.moment),
            ca.vertcat(*[ca.horzcat(*row) for row in body.tensor]),
        )
        T += 0.5 * body.mass * ca.dot(velocity, velocity) + ca.dot(
            velocity, rate @ ca.vertcat(*body.moment)
        )
        T += 0.5 * ca.dot(omega, tensor @ omega)
        V -= ca.dot(ca.vertcat(*s.gravity), body.mass * ca.vertcat(*origin) + moment)
    momentum = ca.gradient(T, s.v)
    return ca.jacobian(momentum, s.v), ca.jtimes(momentum, s.q, s.v) - ca.gradient(
        T, s.q
    ) + ca.gradient(V, s.q)


def agreement(s: System, ours: ca.SX, theirs: ca.SX, seed: int = 0) -> float:
    rng = np.random.default_rng(seed)
    f = ca.Function("f", [s.t, s.q, s.v, s.u, s.p], [ca.densify(ours), ca.densify(theirs)])
    worst = 0.0
    for _ in range(10):
        q, v, u = (rng.normal(size=x.numel()) for x in (s.q, s.v, s.u))
        a, b = (np.asarray(x) for x in f(0.3, q, v, u, s.parameters))
        worst = max(
            worst, float(np.max(np.abs(a - b), initial=0) / (1 + np.max(np.abs(b), initial=0)))
        )
    return worst


@pytest.mark.parametrize(
    "make", [spatial_system, *[lambda p=p: system(load(p)) for p in CHAINS.values()]]
)
def test_mass_matrix_and_bias_are_lagranges(make) -> None:
    s = make()
    M, h = lagrange(s)
    assert agreement(s, s.M, M) < 1e-12
    assert agreement(s, s.h, h) < 1e-12


def test_a_flipped_coriolis_sign_is_seen() -> None:
    s = spatial_system()
    _, h = lagrange(s)
    at_rest = ca.substitute(s.h, s.v, ca.SX.zeros(s.v.numel()))
    assert agreement(s, 2 * at_rest - s.h, h) > 1e-3


@pytest.mark.parametrize("path", sorted(MODELS.glob("*.yaml")), ids=lambda p: p.stem)
def test_rows_are_rates_of_positions_and_beta_their_rate(path) -> None:
    s = system(load(path))
    along = ca.vertcat(s.t, s.q)
    motion = ca.vertcat(1, s.qdot)
    closing = [i for i, row in enumerate(s.rows) if row.position >= 0]
    velocity = ca.mtimes(s.A, s.v) - s.c
    order = [s.rows[i].position for i in closing]
    assert agreement(s, velocity[closing], ca.jtimes(s.phi[order], along, motion)) < 1e-12
    assert consistent_agreement(s, s.beta, -ca.jtimes(velocity, along, motion)) < 1e-11


def consistent_agreement(s: System, ours: ca.SX, theirs: ca.SX) -> float:
    """On A v = c only: β leaves out what vanishes there."""
    f = ca.Function("f", [s.t, s.q, s.v, s.p], [ours, theirs])
    found, worst = states(s, 10, seed=2), 0.0
    for t, q, v, p in zip(found.t, found.q, found.v, found.p):
        a, b = (np.asarray(x) for x in f(t, q, v, p))
        worst = max(
            worst, float(np.max(np.abs(a - b), initial=0) / (1 + np.max(np.abs(b), initial=0)))
        )
    return worst


@pytest.mark.parametrize("path", sorted(MODELS.glob("*.yaml")), ids=lambda p: p.stem)
def test_sampled_states_are_admissible(path) -> None:
    s = system(load(path))
    solver, found = Kinematics(s), states(s, 20, seed=1, parameters=0.1)
    assert len(found.t) == 20
    for t, q, v, p in zip(found.t, found.q, found.v, found.p):
        A, c, _ = solver.velocities(t, q, p)
        assert np.max(np.abs(solver.positions(t, q, p)[0]), initial=0) < 1e-10
        assert np.max(np.abs(A @ v - c), initial=0) < 1e-10


@pytest.mark.parametrize("path", sorted(MODELS.glob("*.yaml")), ids=lambda p: p.stem)
def test_baked_parameters_change_nothing(path) -> None:
    free, baked = system(load(path)), system(load(path), "all")
    f = ca.Function(
        "f", [free.t, free.q, free.v, free.u, free.p], [ca.densify(free.M), free.h, free.Q]
    )
    g = ca.Function(
        "g", [baked.t, baked.q, baked.v, baked.u, baked.p], [ca.densify(baked.M), baked.h, baked.Q]
    )
    rng = np.random.default_rng(0)
    q, v, u = (rng.normal(size=x.numel()) for x in (free.q, free.v, free.u))
    for a, b in zip(f(0.0, q, v, u, free.parameters), g(0.0, q, v, u, [])):
        np.testing.assert_allclose(np.asarray(a), np.asarray(b), rtol=1e-12, atol=1e-12)


def test_initial_state_keeps_what_is_held() -> None:
    s = system(load(MODELS / "four_bar.yaml"))
    found = initial_state(s)
    assert found.q[0] == pytest.approx(np.pi / 3) and found.v[0] == pytest.approx(5.0)
    assert not found.moved
    solver = Kinematics(s)
    A, c, _ = solver.velocities(0.0, found.q, np.array(s.parameters))
    assert np.max(np.abs(solver.positions(0.0, found.q, np.array(s.parameters))[0])) < 1e-12
    assert np.max(np.abs(A @ found.v - c)) < 1e-12


def test_initial_state_says_what_it_moved() -> None:
    s = system(load(MODELS / "four_bar.yaml"))
    found = initial_state(s, {"q3": 1.5, "der(q3)": 100.0})
    assert {name for name, _, _ in found.moved} & {"q1", "q3", "der(q1)", "der(q3)"}


def test_inertia_seen_from_another_frame() -> None:
    rng = np.random.default_rng(3)
    half = rng.normal(size=(3, 3))
    body = Inertia(2.0, [0.0, 0.0, 0.0], (half @ half.T).tolist())
    R = np.array(axis_rotation([0.6, 0.0, 0.8], 0.7), dtype=float)
    r = rng.normal(size=3)
    seen = moved(
        moved(body, (Still(R.tolist()),), r.tolist()), (Still(R.T.tolist()),), (-R.T @ r).tolist()
    )
    np.testing.assert_allclose(np.array(seen.tensor, dtype=float), half @ half.T, atol=1e-12)
    steiner = R @ half @ half.T @ R.T + 2.0 * (r @ r * np.eye(3) - np.outer(r, r))
    np.testing.assert_allclose(
        np.array(moved(body, (Still(R.tolist()),), r.tolist()).tensor, dtype=float),
        steiner,
        atol=1e-12,
    )
    assert summed(body, body).mass == 4.0


def test_turns_about_one_axis_merge() -> None:
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    chain = merged(turn([0, 0, 1], a), turn([0, 0, 1], b))
    assert len(chain) == 1
    assert merged(turn([0, 0, -1], a))[0].axis == (0.0, 0.0, 1.0)
    assert matrix(()) is IDENTITY
    there = merged(turn([1, 0, 0], 0.3), turn([0, 1, 0], -0.4))
    both = np.array(product(matrix(there), matrix(inverse(there))), dtype=float)
    np.testing.assert_allclose(both, np.eye(3), atol=1e-15)
    assert dot([0.0, a], [b, 0.0]) == 0.0
    assert transpose([[1.0, 2.0, 3.0]] * 3)[0] == [1.0, 1.0, 1.0]


def test_written_out_solutions_solve() -> None:
    rng = np.random.default_rng(1)
    half = rng.normal(size=(5, 5))
    M, b = half @ half.T + np.eye(5), rng.normal(size=5)
    x = ldl_solution(M.tolist(), [b.tolist()], [4, 3, 2, 1, 0]).x[0]
    np.testing.assert_allclose(M @ x, b, atol=1e-12)
    structure = np.ones((5, 5), dtype=bool)
    pivots = pivot_order(half[None], structure, ~structure)
    y = lu_solution(half.tolist(), [b.tolist()], pivots).x[0]
    np.testing.assert_allclose(half @ y, b, atol=1e-11)


def test_structural_zeros_are_floats() -> None:
    x = ca.SX.sym("x")
    sparse = ca.SX(2, 2)
    sparse[0, 1] = x
    sparse[1, 0] = 2
    rows = scalars(sparse)
    assert rows[0][0] == 0.0 and rows[1][0] == 2.0 and isinstance(rows[1][0], float)


TWISTED = """
model: twisted
bodies: {{s: {{mass: 2 kg, inertia: [1, 2, 2.5]}}}}
joints:
  base: {{type: free, parent: ground, child: s, position: [x, y, z],
         orientation: {{euler: zxy, angles: [yaw, lean, spin]}}}}
{forces}
"""
# a torque along the axis of one angle does work along another that is not at right angles to it
SAME = {
    "forces: {x: 3 N}": "loads: {f: {type: force, body: s, components: [3, 0, 0]}}",
    "loads: {e: {type: expression, coordinate: y, expression: x*(2 N/m)}}": (
        "loads: {f: {type: force, body: s, components: [0, x*(2 N/m), 0]}}"
    ),
    "forces: {yaw: 2 N*m, spin: (2 N*m)*sin(lean)}": "loads: {f: {type: torque, body: s, components: [0, 0, 2]}}",
    "forces: {spin: 2 N*m, yaw: (2 N*m)*sin(lean)}": (
        "loads: {f: {type: torque, body: s, frame: body, components: [0, 2, 0]}}"
    ),
    "loads: {d: {type: damper, coordinate: z, coefficient: 5}}": (
        "loads: {f: {type: force, body: s, components: [0, 0, -(5 N*s/m)*der(z)]}}"
    ),
    "loads: {d: {type: friction, coordinate: z, viscous: 5}}": (
        "loads: {f: {type: force, body: s, components: [0, 0, -(5 N*s/m)*der(z)]}}"
    ),
}


@pytest.mark.parametrize("given", SAME)
def test_a_force_on_a_coordinate_does_the_work_of_its_rate(given: str) -> None:
    """Its Q = Nᵀ F is that of the force or torque along what the coordinate moves."""
    rng = np.random.default_rng(2)
    q, v = rng.uniform(-1, 1, 6), rng.uniform(-1, 1, 6)
    found = [
        np.array(ca.Function("Q", [s.q, s.v], [s.Q])(q, v)).ravel()
        for s in (system(load_text(TWISTED.format(forces=x))) for x in (given, SAME[given]))
    ]
    assert np.abs(found[0]).max() > 0.1
    np.testing.assert_allclose(found[0], found[1], atol=1e-13)


@pytest.mark.parametrize("degrees", [30.0, 45.0, 60.0, 90.0, 120.0])
def test_the_torque_of_a_bushing_is_what_its_description_says(degrees: float) -> None:
    """It said that the torque falls beyond 90 degrees, where it pushes away already."""
    text = """
model: bush
plane: xy
bodies: {b: {mass: 1 kg, inertia: 1}}
joints: {J: {type: revolute, parent: ground, child: b, coordinate: q}}
loads: {m: {type: bushing, between: [ground, b], torsion: 3 N*m/rad}}
"""
    s = system(load_text(text))
    torque = ca.Function("torque", [s.q], [ca.gradient(s.V, s.q)])
    wanted = 1.5 * np.sin(2 * np.radians(degrees))
    assert float(torque(np.radians(degrees))) == pytest.approx(wanted, abs=1e-12)
    told = " ".join((BushingEntry.__doc__ or "").split())
    assert "½ c sin 2φ: it is largest at 45 degrees, zero at 90 and pushes away beyond" in told
