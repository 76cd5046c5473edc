"""Kinematics of named frames by identities: J and J̇ v are derivatives of poses, in many digits, and
a wrench does the power of its frame's velocity.

Of derive.mechanics.geometry: named_frames.
Of derive.mechanics.recursions: coriolis.
Of derive.formulations: named_frames.
"""

from functools import cache

import casadi as ca
import numpy as np
import pytest

from derive.formulations import equations
from derive.formulations.records import Equations
from derive.formulations.requests import request_of
from derive.mechanics.elimination.solve import scalars
from derive.mechanics.geometry.named_frames import unit_quaternion
from derive.mechanics.recursions.coriolis import coriolis_matrix
from derive.model import load_text
from derive.states import system
from tests.scenes import SPATIAL_CHAIN, derived

CHAIN = (
    SPATIAL_CHAIN
    + """
frames:
  tool: {body: c, position: [0.1 m, d, -0.2 m], rpy: [20 deg, -50 deg, 100 deg]}
  wall: {body: ground, position: [1, 2, 3], axis_angle: [[1, 1, 0], 40 deg]}
"""
)
FLOATING = """
model: floating
gravity: [0, 0, -9.81 m/s^2]
bodies:
  base: {mass: 3 kg, com: [0.1, 0, 0.02], inertia: [0.1, 0.2, 0.25, 0.01, 0, 0.02]}
  arm: {mass: 1 kg, com: [0.2, 0, 0], inertia: [0.01, 0.02, 0.02]}
  ball: {mass: 0.4 kg, com: [0, 0.1, 0], inertia: [0.01, 0.02, 0.015]}
joints:
  B: {type: free, parent: ground, child: base}
  A: {type: cylindrical, parent: base, child: arm, at: [0.2, 0.1, 0], axis: [0.6, 0.8, 0]}
  S: {type: ball, parent: arm, child: ball, at: [[0.4, 0, 0], [0, -0.1, 0]]}
frames: {tool: {body: ball, position: [0, 0.2, 0.1], rpy: [0.3, 0.2, 0.1]}}
"""
AXES = ("", "_local", "_world")


@cache
def made(text: str) -> Equations:
    return equations(system(load_text(text)))


def values(found: Equations, names: list[str], seed: int = 0) -> list[np.ndarray]:
    """Functions on request at a random state with unit quaternions."""
    slots = [slot.symbols for slot in found.arguments]
    asked = [request_of(found, name) for name in names]
    results = [request.function.result.value for request in asked if request is not None]
    assert len(results) == len(names)
    x = np.random.default_rng(seed).normal(size=slots[1].numel())
    for start in found.system.quaternions:
        x[start : start + 4] /= np.linalg.norm(x[start : start + 4])
    at = ca.Function("at", slots, results)(0.0, x, 0.3, list(found.parameters))
    return [np.array(each) for each in (at if isinstance(at, list | tuple) else [at])]


def skew(x: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [-x[1], x[0], 0.0]])


@pytest.mark.parametrize("text", [CHAIN, FLOATING], ids=["chain", "floating"])
@pytest.mark.parametrize("frame", ["tool", "ground"])
def test_the_three_ways_of_writing_a_twist_are_one_twist(text, frame):
    found = made(text)
    T, J, local, world = values(
        found, [f"pose_{frame}", *(f"jacobian{axes}_{frame}" for axes in AXES)]
    )
    R, p = T[:, :3], T[:, 3]
    assert np.allclose(R @ R.T, np.eye(3), atol=1e-14) and np.linalg.det(R) > 0
    assert np.allclose(np.kron(np.eye(2), R.T) @ J, local, atol=1e-13)
    assert np.allclose(J[:3] + skew(p) @ J[3:], world[:3], atol=1e-13)
    assert np.allclose(J[3:], world[3:])


@pytest.mark.parametrize("text", [CHAIN, FLOATING], ids=["chain", "floating"])
def test_j_times_v_is_the_rate_of_the_pose_to_all_digits(text):
    """Ṗ by CasADi's own differentiation of `pose` along q̇ = N v."""
    found = made(text)
    s = found.system
    pose = request_of(found, "pose_tool").function.result.value
    v = found.function("velocity").result.value
    along = ca.substitute(s.qdot, s.v, v)
    rate = ca.reshape(ca.jtimes(ca.vec(pose), s.q, along), 3, 4)
    J = request_of(found, "jacobian_tool").function.result.value
    gap = [rate[:, 3] - ca.mtimes(J[:3, :], v)]
    turned = ca.mtimes(rate[:, :3], pose[:, :3].T)  # ω ×
    omega = ca.vertcat(turned[2, 1], turned[0, 2], turned[1, 0])
    gap.append(omega - ca.mtimes(J[3:, :], v))
    assert worst(found, ca.vertcat(*gap)) < 1e-13


@pytest.mark.parametrize("text", [CHAIN, FLOATING], ids=["chain", "floating"])
@pytest.mark.parametrize("axes", AXES)
def test_jdot_v_is_the_rate_of_j_to_all_digits(text, axes):
    """J̇ v by CasADi's own differentiation of J along q̇ = N v."""
    found = made(text)
    s = found.system
    v = found.function("velocity").result.value
    J = request_of(found, f"jacobian{axes}_tool").function.result.value
    along = ca.substitute(s.qdot, s.v, v)
    rate = ca.reshape(ca.jtimes(ca.vec(J), s.q, along), 6, s.v.numel())
    claimed = request_of(found, f"jdot_v{axes}_tool").function.result.value
    twist = request_of(found, f"frame_velocity{axes}_tool").function.result.value
    assert worst(found, ca.mtimes(rate, v) - claimed) < 1e-12
    assert worst(found, ca.mtimes(J, v) - twist) < 1e-13


def worst(found: Equations, gap: ca.SX) -> float:
    slots = [slot.symbols for slot in found.arguments]
    at = ca.Function("gap", slots, [gap])
    rng = np.random.default_rng(0)
    largest = 0.0
    for _ in range(5):
        x = rng.normal(size=slots[1].numel())
        for start in found.system.quaternions:
            x[start : start + 4] /= np.linalg.norm(x[start : start + 4])
        largest = max(
            largest, float(np.abs(np.array(at(0.0, x, 0.3, list(found.parameters)))).max())
        )
    return largest


def test_pose_and_jacobian_in_one_are_those_of_the_two():
    T, J, both = values(made(CHAIN), ["pose_tool", "jacobian_tool", "pose_jacobian_tool"])
    assert np.array_equal(both.ravel(), np.concatenate([T.ravel(), J.ravel()]))


def test_a_frame_of_the_ground_stands_still():
    T, J, rate = values(made(CHAIN), ["pose_wall", "jacobian_wall", "frame_acceleration_wall"])
    assert T[:, 3] == pytest.approx([1, 2, 3]) and not J.any() and not rate.any()


@pytest.mark.parametrize("axes", ["ground", "frame"])
def test_a_wrench_does_the_power_of_its_frame(axes):
    """Q · v = f · v_frame + n · ω_frame, along the axes that the wrench is given in."""
    text = CHAIN + (
        "inputs: {fx: {unit: N}, fy: {unit: N}, nz: {unit: N*m}}\n"
        f"loads: {{push: {{type: wrench, frame: tool, axes: {axes}, "
        "force: [fx, fy, 0], moment: [0, 2*nz, nz]}}\n"
    )
    found = made(text)
    s = found.system
    name = "frame_velocity_tool" if axes == "ground" else "frame_velocity_local_tool"
    twist = request_of(found, name).function.result.value
    fx, fy, nz = (s.u[k] for k in range(3))
    v = found.function("velocity").result.value
    power = ca.dot(ca.substitute(s.Q, s.v, v), v)
    gap = power - ca.dot(ca.vertcat(fx, fy, 0, 0, 2 * nz, nz), twist)
    assert worst(found, gap) < 1e-13


def test_the_coriolis_matrix_of_a_tree_has_no_work_in_it():
    """C v = h without gravity, and Ṁ − C − Cᵀ = 0 by CasADi's differentiation of M, with free,
    cylindrical and ball joints."""
    s = made(FLOATING).system
    v = [s.v[k] for k in range(s.v.numel())]
    C = ca.vertcat(*(ca.horzcat(*row) for row in coriolis_matrix(s.links, s.inertias[0], v)))
    products = s.h - ca.substitute(s.h, s.v, ca.SX.zeros(s.v.numel()))
    rate = ca.reshape(ca.jtimes(ca.vec(s.M), s.q, s.qdot), *s.M.shape)
    gap = ca.vertcat(ca.mtimes(C, s.v) - products, ca.vec(rate - C - C.T))
    rng = np.random.default_rng(1)
    q = rng.normal(size=s.q.numel())
    for start in s.quaternions:
        q[start : start + 4] /= np.linalg.norm(q[start : start + 4])
    at = ca.Function("gap", [s.q, s.v], [gap])
    assert np.abs(np.array(at(q, rng.normal(size=s.v.numel())))).max() < 1e-13


def test_where_v_are_rates_c_has_christoffels_symbols():
    s = made(SPATIAL_CHAIN).system
    v = [s.v[k] for k in range(s.v.numel())]
    C = ca.vertcat(*(ca.horzcat(*row) for row in coriolis_matrix(s.links, s.inertias[0], v)))
    gap = ca.Function("gap", [s.q, s.v, s.p], [C - 0.5 * ca.jacobian(s.h, s.v)])
    rng = np.random.default_rng(2)
    assert np.abs(np.array(gap(rng.normal(size=3), rng.normal(size=3), s.parameters))).max() < 1e-14


def test_pose_and_jacobian_of_an_arm_take_few_operations():
    """Six joints: what a controller asks for costs a tenth of the dynamics."""
    from derive.expressions.counting import operations

    found = derived("stanford_arm")
    both = request_of(found, "pose_jacobian_flange").function.result.value
    assert operations(both) <= 125
    assert len(scalars(both)) == 12 + 36


def test_a_unit_quaternion_of_every_turn_has_its_rotation():
    """Also where it turns by half a circle, and none of w, x, y, z is divided by."""
    R = ca.SX.sym("R", 3, 3)
    rows = [[R[i, j] for j in range(3)] for i in range(3)]
    at = ca.Function("q", [R], [ca.vertcat(*unit_quaternion(rows))])
    rng = np.random.default_rng(0)
    drawn = [*rng.normal(size=(50, 4)), *np.eye(4), [0.0, 0.6, 0.8, 0.0], [1e-9, 1.0, 0.0, 0.0]]
    for q in drawn:
        q = np.array(q) / np.linalg.norm(q)
        w, v = q[0], q[1:]
        skew = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
        matrix = np.eye(3) + 2.0 * w * skew + 2.0 * skew @ skew
        found = np.array(at(matrix)).ravel()
        assert found[np.argmax(np.abs(found))] > 0.0
        np.testing.assert_allclose(found * np.sign(found @ q), q, atol=1e-15)
