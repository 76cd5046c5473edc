"""The independent reference, tested by itself: closed forms, published numbers and identities along
the motion.

Of hamel.verify.reference: analytic, closures, formulas, jets, layout, outputs, rolling, states,
vectors.
"""

import numpy as np
import pytest

import hamel
from derive.diagnostics import AssumptionError
from derive.model import load, load_text
from hamel.verify.checks.compare import slope
from hamel.verify.reference.joints import joint_motion
from hamel.verify.reference.loads import applied, body_inertia
from hamel.verify.reference.outcome import (
    Reference,
    energies,
    evaluate,
    kinematics,
    reference,
    state_of,
)
from hamel.verify.reference.rows import joint_blocks
from hamel.verify.reference.saddle import saddle
from tests.scenes import MODELS
from tests.texts import ARM, CAR_AXIS, EVERYTHING, LOOPS, PARALLELOGRAM, SURFACE

SLEIGH = """
model: sleigh
plane: xy
bodies:
  s: {mass: 1 kg, com: [0.5, 0], inertia: 0.2}
joints:
  base: {type: planar, parent: ground, child: s, coordinates: [x, y, th]}
constraints:
  edge: {type: no_slip, body: s, at: [0, 0], direction: y}
"""

DISK = """
model: disk
gravity: [0, 0, -9.81 m/s^2]
parameters: {m: 2 kg, r: 0.35 m}
bodies:
  disk: {mass: m, com: [0, 0, 0], inertia: [m*r**2/4, m*r**2/2, m*r**2/4]}
joints:
  base: {type: free, parent: ground, child: disk, position: [x, y, z], orientation: {euler: zxy, angles: [yaw, lean, spin]}}
constraints:
  contact: {type: rolling, body: disk, shape: {disk: {radius: r, axis: y}}, plane: {normal: z}}
"""


def consistent(
    ref: Reference, t: float, q: np.ndarray, v: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """q on φ = 0 by Newton (holonomic rows first in these models), v on A v = c."""
    for _ in range(50):
        k = kinematics(ref, state_of(ref, t, q, v))
        q = q - k.N @ np.linalg.pinv(k.A[: len(k.phi)]) @ k.phi if len(k.phi) else q
    k = kinematics(ref, state_of(ref, t, q, v))
    return q, v - np.linalg.pinv(k.A) @ k.violation(v)


def test_three_link_arm_starts_as_published():
    ref = reference(load_text(ARM))
    found = evaluate(ref, state_of(ref, 0.0, np.zeros(3), np.zeros(3)))
    np.testing.assert_allclose(found.vdot, [-42.47870813, 57.96818182, -21.89008264], rtol=1e-9)
    np.testing.assert_allclose(found.M[0], [0.22122333, 0.09582333, 0.02299], rtol=1e-7)


def with_wrenches(ref: Reference, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """v̇ and the joints' wrenches (moment, force on the child) of [K Gᵀ; G 0] of all bodies'
    accelerations, nothing eliminated."""
    state, place = state_of(ref, 0.0, q, v), ref.place
    rows, right = [], []
    for seat in state.seats:
        of_child, of_parent, gamma = joint_blocks(seat, state)
        row = np.zeros((6, place.size))
        row[:, seat.columns], row[:, place.twist(seat.joint.child)] = -seat.twists, of_child
        if seat.joint.parent != "ground":
            row[:, place.twist(seat.joint.parent)] = -of_parent
        rows.append(row)
        right.append(gamma)
    F, G = np.array(applied(ref.model, place, state, nonideal=True).total), np.vstack(rows)
    K = np.zeros((place.size, place.size))
    for body in ref.model.bodies:
        block = place.twist(body.name)
        K[block, block], gyroscopic = body_inertia(body, state)
        F[block] -= gyroscopic
    found = np.linalg.solve(saddle(K, G), np.concatenate([F, *right]))
    return found[: place.nv], -found[place.size :].reshape(-1, 6)


def test_joint_wrench_of_a_hanging_arm_carries_its_weight():
    _, wrenches = with_wrenches(
        reference(load_text(ARM)), np.array([-np.pi / 2, 0.0, 0.0]), np.zeros(3)
    )
    np.testing.assert_allclose(wrenches[:, 4], 9.81 * np.array([1.2, 0.7, 0.3]), rtol=1e-12)


def test_eliminating_the_joints_is_solving_for_their_wrenches():
    ref, rng = reference(load_text(ARM)), np.random.default_rng(3)
    q, v = rng.uniform(-2, 2, (2, 3))
    found = evaluate(ref, state_of(ref, 0.0, q, v))
    np.testing.assert_allclose(found.vdot, with_wrenches(ref, q, v)[0], rtol=1e-10)


TWO_POINTS = """
model: two_points
plane: xy
gravity: [0, -9.81 m/s^2]
bodies: {a: {mass: 1 kg, com: [1, 0]}, b: {mass: 1 kg, com: [1, 0]}}
joints:
  A: {type: revolute, parent: ground, child: a, at: [0, 0], coordinate: q1}
  B: {type: revolute, parent: a, child: b, at: [1, 0], coordinate: q2}
"""

TWO_POINTS_BY_ENERGIES = """
model: two_points
coordinates: {q1: rad, q2: rad}
parameters: {I: 1 kg*m^2, w: 9.81 N*m}
where: {both: der(q1) + der(q2)}
kinetic: I*(der(q1)**2 + (der(q1)**2 + both**2 + 2*der(q1)*both*cos(q2)))/2
potential: w*(2*sin(q1) + sin(q1 + q2))
"""


def test_mechanism_and_lagrangian_of_one_arm_agree():
    q, v = np.array([0.4, -1.1]), np.array([1.3, 0.8])
    refs = [reference(load_text(text)) for text in (TWO_POINTS, TWO_POINTS_BY_ENERGIES)]
    first, second = (evaluate(ref, state_of(ref, 0.0, q, v)) for ref in refs)
    np.testing.assert_allclose(first.vdot, second.vdot, rtol=1e-12)
    np.testing.assert_allclose([first.T, first.V], [second.T, second.V], rtol=1e-12)
    np.testing.assert_allclose(first.M, second.M, rtol=1e-12)


def test_parallelogram_closed_form():
    """[(N + 1)/3 + N] θ̈ = −[(N + 1)/2 + N] g cos θ with N = 1 (IFToMM A02)."""
    ref = reference(load_text(PARALLELOGRAM))
    th, rate = 0.7, -1.3
    found = evaluate(
        ref, state_of(ref, 0.0, np.array([th, -th, th]), rate * np.array([1.0, -1.0, 1.0]))
    )
    np.testing.assert_allclose(
        found.vdot, -2 * 9.81 * np.cos(th) / (5 / 3) * np.array([1, -1, 1]), rtol=1e-12
    )


def test_redundant_rows_leave_the_motion_alone():
    extra = PARALLELOGRAM + "constraints:\n  same: {holonomic: q1 - q3}\n"
    q, v = np.array([0.7, -0.7, 0.7]), np.array([1.0, -1.0, 1.0])
    results = [
        evaluate(ref, state_of(ref, 0.0, q, v))
        for ref in (reference(load_text(text)) for text in (PARALLELOGRAM, extra))
    ]
    assert [(r.rank, len(r.lam)) for r in results] == [(2, 2), (2, 3)]
    np.testing.assert_allclose(results[1].vdot, results[0].vdot, atol=1e-11)
    np.testing.assert_allclose(results[1].constraint_force, results[0].constraint_force, atol=1e-11)


def test_closure_multiplier_is_the_force_on_the_second_body():
    """A rod on two pins, one of them a closure with the ground: each carries half the weight."""
    for pair, at, sign in (
        ("[ground, a]", "[[0.3, 0], [0.3, 0]]", 1),
        ("[a, ground]", "[[0.3, 0], [0.3, 0]]", -1),
    ):
        text = f"{ARM.split('  b:')[0]}joints:\n  A: {{type: revolute, parent: ground, child: a, at: [0, 0], coordinate: q1}}\n"
        ref = reference(
            load_text(f"{text}closures:\n  C: {{type: revolute, between: {pair}, at: {at}}}\n")
        )
        found = evaluate(ref, state_of(ref, 0.0, np.zeros(1), np.zeros(1)))
        np.testing.assert_allclose(found.lam[1], sign * 0.5 * 9.81 / 2, rtol=1e-12)


def test_chaplygin_sleigh_closed_form():
    """v̇ = a ω², (I + m a²) ω̇ = −m a v ω."""
    ref = reference(load_text(SLEIGH))
    v, w = 0.7, 1.3
    found = evaluate(ref, state_of(ref, 0.0, np.array([0.1, 0.2, 0.9]), np.array([v, 0.0, w])))
    np.testing.assert_allclose(found.vdot, [0.5 * w * w, 0.0, -0.5 * v * w / 0.45], atol=1e-13)


def rotation(letter: str, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return {
        "x": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
        "y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
        "z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
    }[letter]


def test_rolling_disk_closed_form():
    """The three equations in the lean frame (1 forward, 2 along the axis), diametral A, axial C."""
    ref = reference(load_text(DISK))
    m, r, g = 2.0, 0.35, 9.81
    A, C, yaw, lean, spin = m * r**2 / 4, m * r**2 / 2, 0.4, 0.3, 0.8
    u1, u2, u3 = u = np.array([0.5, -3.0, 0.7])
    frame = rotation("z", yaw) @ rotation("x", lean)
    body = frame @ rotation("y", spin)
    centre = -np.cross(frame @ u, frame @ np.array([0, 0, -r]))
    q = np.array([1.0, 2.0, r * np.cos(lean), yaw, lean, spin])
    found = evaluate(
        ref, state_of(ref, 0.0, q, np.concatenate([body.T @ centre, body.T @ frame @ u]))
    )
    rate = rotation("y", spin) @ found.vdot[3:] + found.qdot[5] * np.cross([0, 1, 0], u)
    wanted = [
        (-A * u3**2 * np.tan(lean) + (C + m * r**2) * u2 * u3 + m * g * r * np.sin(lean))
        / (A + m * r**2),
        -m * r**2 * u1 * u3 / (C + m * r**2),
        (A * u3 * np.tan(lean) - C * u2) * u1 / A,
    ]
    np.testing.assert_allclose(rate, wanted, rtol=1e-11)
    np.testing.assert_allclose(
        found.qdot[3:], [u3 / np.cos(lean), u1, u2 - u3 * np.tan(lean)], rtol=1e-12
    )
    np.testing.assert_allclose(
        np.concatenate(
            [found.kinematics.phi, found.kinematics.A @ found.vdot - found.kinematics.beta]
        ),
        0,
        atol=1e-12,
    )


def test_car_axis_end_state_and_multipliers():
    """IVP Test Set, t = 3: on the constraints, and λ with the sign of M q̈ = f + Gᵀ λ (tests φ_tt
    and φ_qt)."""
    q = np.array(
        [
            0.0493455784275402809122,
            0.496989460230171153861,
            1.04174252488542151681,
            0.373911027361265256927,
        ]
    )
    v = np.array(
        [
            -0.0770583684040972357970,
            0.00744686658723778553466,
            0.0175568157537232222276,
            0.770341043779251976443,
        ]
    )
    ref = reference(load_text(CAR_AXIS))
    found = evaluate(ref, state_of(ref, 3.0, q, v))
    np.testing.assert_allclose(found.kinematics.phi, 0.0, atol=1e-10)
    np.testing.assert_allclose(found.kinematics.violation(v), 0.0, atol=1e-9)
    np.testing.assert_allclose(
        found.lam, [-0.00473688659084893324729, -0.00110468033125734368808], rtol=1e-8
    )


@pytest.mark.parametrize(
    "text",
    [ARM, PARALLELOGRAM, SLEIGH, DISK, EVERYTHING, *LOOPS.values(), SURFACE],
    ids=["arm", "loop", "sleigh", "disk", "everything", *LOOPS, "surface"],
)
def test_motion_keeps_constraints_and_balances_power(text):
    """Along (q̇, v̇): dφ/dt = A v − c, d(A v − c)/dt = 0, d(T + V)/dt = power + λᵀ c + explicit; M
    v̇ = force + Aᵀ λ."""
    ref, rng = reference(load_text(text)), np.random.default_rng(3)
    for t in (0.2, 0.9):
        q, v = consistent(
            ref,
            t,
            rng.uniform(-0.6, 0.6, len(ref.model.coordinates)),
            rng.normal(size=ref.place.nv),
        )
        found = evaluate(ref, state_of(ref, t, q, v))
        check_along(ref, t, q, v, found)
        np.testing.assert_allclose(
            found.M @ found.vdot, found.force + found.constraint_force, atol=1e-9
        )
        assert found.residual < 1e-13
        assert abs(found.T - 0.5 * v @ found.M @ v) < 1e-10 * (1 + found.T)


def check_along(ref, t, q, v, found):
    def there(time, free=None):
        return state_of(
            ref, t + time, q + time * found.qdot, v + time * found.vdot if free is None else free
        )

    def violation(time):
        s = there(time)
        return kinematics(ref, s).violation(s.v)

    np.testing.assert_allclose(slope(violation, 1e-3)[0], 0.0, atol=1e-8)
    np.testing.assert_allclose(
        slope(lambda time: kinematics(ref, there(time)).phi, 1e-3)[0], 0.0, atol=1e-8
    )
    power = found.power + found.lam @ found.kinematics.c
    np.testing.assert_allclose(
        slope(lambda time: energies(ref, there(time)).total, 1e-3)[0], power, atol=1e-7
    )


@pytest.mark.parametrize("text", [SLEIGH, DISK, EVERYTHING], ids=["planar", "euler", "everything"])
def test_rates_and_their_drift(text):
    """q̈ = N v̇ + Ṅ v: the drift is the derivative of N v at held v; twists are the derivatives of
    positions."""
    ref, rng = reference(load_text(text)), np.random.default_rng(4)
    q, v = rng.uniform(-0.6, 0.6, len(ref.model.coordinates)), rng.normal(size=ref.place.nv)
    here = state_of(ref, 0.1, q, v)
    there = lambda time: state_of(ref, 0.1, q + time * here.rates, v)  # noqa: E731
    np.testing.assert_allclose(
        slope(lambda time: there(time).rates, 1e-3)[0], here.drift, atol=1e-9
    )
    for name, frame in here.frames.items():
        np.testing.assert_allclose(
            slope(lambda time, n=name: there(time).frames[n].origin, 1e-3)[0],
            frame.velocity,
            atol=1e-9,
        )
        spin = (
            slope(lambda time, n=name: there(time).frames[n].rotation, 1e-3)[0] @ frame.rotation.T
        )
        np.testing.assert_allclose([spin[2, 1], spin[0, 2], spin[1, 0]], frame.omega, atol=1e-9)


JOINTS = {
    "revolute": (1, 1), "prismatic": (1, 1), "screw": (1, 1), "cylindrical": (2, 2), "universal": (2, 2), "planar": (3, 3),
    "ball": (4, 3), "ball zxz": (3, 3), "free": (6, 6), "free xyx": (6, 6), "free quaternion": (7, 6), "fixed": (0, 0),
}  # fmt: skip


@pytest.mark.parametrize("name", JOINTS)
def test_joint_tables_are_derivatives(name):
    """Ṙ = R [ω]×, d(translation)/dt = R v for the twist (ω, v) = H v; drift = d(N v)/dt and bias =
    d(H v)/dt at held v."""
    kind, _, orientation = name.partition(" ")
    at, rng = (
        joint_motion(kind, orientation, 0.3, np.array([0.8, 0.0, -0.6])),
        np.random.default_rng(5),
    )
    axis = np.array([0.0, 0.0, 1.0]) if kind == "planar" else np.array([0.48, -0.6, 0.64])
    q, v = rng.uniform(0.2, 0.9, JOINTS[name][0]), rng.normal(size=JOINTS[name][1])
    if len(q) in (4, 7):
        q[-4:] /= np.linalg.norm(q[-4:])
    here = at(q, v, axis)
    there = lambda time: at(q + time * (here.N @ v), v, axis)  # noqa: E731
    spin = here.rotation.T @ slope(lambda time: there(time).rotation, 1e-3)[0]
    twist = here.H @ v
    np.testing.assert_allclose([spin[2, 1], spin[0, 2], spin[1, 0]], twist[:3], atol=1e-10)
    np.testing.assert_allclose(
        slope(lambda time: there(time).translation, 1e-3)[0], here.rotation @ twist[3:], atol=1e-10
    )
    np.testing.assert_allclose(
        slope(lambda time: there(time).N @ v, 1e-3)[0], here.drift, atol=1e-9
    )
    np.testing.assert_allclose(slope(lambda time: there(time).H @ v, 1e-3)[0], here.bias, atol=1e-9)


def test_what_the_reference_does_not_know_it_refuses():
    with pytest.raises(AssumptionError, match="hovering"):
        joint_motion("hovering")


@pytest.mark.parametrize("plane", ["xy", "xz", "yz"])
def test_planes_are_the_same_mechanics(plane):
    turned = SLEIGH.replace("plane: xy", f"plane: {plane}").replace(
        "direction: y", f"direction: {plane[1]}"
    )
    ref = reference(load_text(turned))
    found = evaluate(ref, state_of(ref, 0.0, np.array([0.1, 0.2, 0.9]), np.array([0.7, 0.0, 1.3])))
    np.testing.assert_allclose(found.vdot, [0.845, 0.0, -0.5 * 0.7 * 1.3 / 0.45], atol=1e-13)
    np.testing.assert_allclose(
        found.qdot[:2], 0.7 * np.array([np.cos(0.9), np.sin(0.9)]), atol=1e-13
    )


@pytest.mark.parametrize("text", [SLEIGH, DISK, "free_body"], ids=["planar", "euler", "quaternion"])
def test_forces_along_rates_are_forces_along_velocities(text):
    """Nᵀ f by the blocks of N, joint by joint, and its rows, against N as a matrix."""
    ref = reference(load_text(text) if "model:" in text else load(MODELS / f"{text}.yaml"))
    draw = np.random.default_rng(7)
    n, m = len(ref.model.coordinates), len(ref.model.velocities)
    s, force = state_of(ref, 0.3, draw.normal(size=n), draw.normal(size=m)), draw.normal(size=n)
    np.testing.assert_allclose(s.along_velocities(force), s.N.T @ force, atol=1e-14)
    for i in range(n):
        np.testing.assert_array_equal(s.row(i), s.N[i])


def test_nonideal_force_acts_in_the_tangent_space_only():
    bead = """
model: bead
coordinates: {x: m, y: m}
parameters: {m: 1 kg, c: 2 N*s/m}
kinetic: m*(der(x)**2 + der(y)**2)/2
constraints:
  line: {holonomic: y, nonideal: ["-c*der(x)", "3"]}
"""
    ref = reference(load_text(bead))
    found = evaluate(ref, state_of(ref, 0.0, np.zeros(2), np.array([1.5, 0.0])))
    np.testing.assert_allclose(
        [*found.vdot, *found.lam, found.power], [-3.0, 0.0, -3.0, -4.5], atol=1e-14
    )


def test_an_inertia_that_no_body_has_is_verified_where_the_file_waives_it(tmp_path) -> None:
    """M is indefinite then: that it is none, and what needs its root, is no error."""
    text = (
        "model: odd\nbodies: {b: {mass: 1 kg, inertia: [0.03, 0.01, -0.005], physical: false}}\n"
        "joints: {J: {type: ball, parent: ground, child: b, orientation: {euler: xyz}}}\n"
    )
    (tmp_path / "odd.yaml").write_text(text)
    record = hamel.verify(tmp_path / "odd.yaml", states=20)
    assert record.passed
    assert {"M semidefinite", "v̇ Udwadia–Kalaba"}.isdisjoint(x.name for x in record.checks)
