"""Functions on request of named frames: where a frame is, its Jacobians, how it moves.

One family of functions for each quantity, one function in it for each frame: `pose_hand`,
`jacobian_hand`. Without a suffix of the family components are along the ground's axes at the
frame's origin (LOCAL_WORLD_ALIGNED), with `_local` along the frame's own (LOCAL), with `_world` at
the ground's origin (WORLD), as Pinocchio has them. Twists are (velocity, angular velocity).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from derive.choices.records import Guard
from derive.expressions.scalars import Vector
from derive.formulations.motion import Motion, at_motion
from derive.formulations.records import Family, Function, Result
from derive.mechanics.elimination.solve import scalars
from derive.mechanics.geometry import named_frames as mechanics
from derive.mechanics.geometry.named_frames import FrameChain, frame_chain, place_of
from derive.mechanics.records import System
from derive.model.mechanism.named_frames import frame_named

_WRITTEN = {
    mechanics.ALIGNED: "along the ground's axes (LOCAL_WORLD_ALIGNED)",
    mechanics.LOCAL: "along the frame's axes (LOCAL)",
    mechanics.WORLD: "at the ground's origin, along its axes (WORLD)",
}
TWIST = ("vx", "vy", "vz", "wx", "wy", "wz")
_SPEEDS = ("m/s",) * 3 + ("rad/s",) * 3
_RATES = ("m/s^2",) * 3 + ("rad/s^2",) * 3


@dataclass(frozen=True)
class _Quantity:
    """What is asked for of a frame in one way of writing it down."""

    name: str
    about: str
    value: Callable[[System, Motion, FrameChain, str], ca.SX]
    guards: Callable[[Motion], tuple[Guard, ...]]
    symbol: str
    units: tuple[str, ...] = ()
    minimal: bool = False  # asks for quasi-velocities


def families(system: System, motion: Motion) -> tuple[Family, ...]:
    """pose, jacobian, jdot_v, frame_velocity and frame_acceleration of any frame; jacobian_w and
    jdot_w where there are quasi-velocities."""
    offered = [x for x in _QUANTITIES if motion.minimal is not None or not x.minimal]
    return (
        Family("pose", _POSE, lambda name: _pose(system, name)),
        Family("pose_quaternion", _QUATERNION, lambda name: _pose_quaternion(system, name)),
        Family("pose_jacobian", _BOTH, lambda name: _pose_jacobian(system, motion, name)),
        *(_family(system, motion, x, written) for x in offered for written in _WRITTEN),
    )


def _family(system: System, motion: Motion, quantity: _Quantity, written: str) -> Family:
    name = quantity.name + written
    about = f"{quantity.about}, {_WRITTEN[written]}"

    def make(frame: str) -> Function:
        """The function of one frame."""
        value = quantity.value(system, motion, _chain(system, frame), written)
        matrix = quantity.name.startswith("jacobian")
        result = Result(quantity.symbol, ca.densify(value), TWIST, quantity.units, matrix=matrix)
        guards = quantity.guards(motion)
        return Function(f"{name}_{frame}", about_frame(about, frame), result, guards=guards)

    return Family(name, about, make)


def about_frame(about: str, frame: str) -> str:
    """What a family says of itself, of one frame."""
    return about.replace("FRAME", frame)


def _chain(system: System, name: str) -> FrameChain:
    frame = frame_named(system.model, name)
    return frame_chain(system.links, place_of(system.symbols, dict(system.places), frame))


_POSE = (
    "pose [R p] of FRAME, 3 × 4: R ground ← frame, p its origin in the ground (m); row-major, "
    "so that R takes the first three numbers of each row"
)


_QUATERNION = (
    "pose of FRAME in seven numbers: its origin in the ground (m), then the unit quaternion "
    "(w, x, y, z) of ground ← frame with its largest entry positive"
)


_BOTH = (
    "`pose_FRAME` and `jacobian_FRAME` in one: the 12 numbers of [R p], then the 6 × nv of J, row "
    "by row"
)


def _pose(system: System, name: str) -> Function:
    value = _matrix(_chain(system, name))
    result = Result("T", value, ("x", "y", "z"), (), matrix=True)
    return Function(f"pose_{name}", about_frame(_POSE, name), result)


def _pose_quaternion(system: System, name: str) -> Function:
    rows = mechanics.pose(_chain(system, name))
    turn = mechanics.unit_quaternion([row[:3] for row in rows])
    value = ca.vertcat(*(row[3] for row in rows), *turn)
    labels = ("x", "y", "z", "qw", "qx", "qy", "qz")
    result = Result("pq", value, labels, ("m", "m", "m", "1", "1", "1", "1"))
    return Function(f"pose_quaternion_{name}", about_frame(_QUATERNION, name), result)


def _matrix(frame: FrameChain) -> ca.SX:
    rows = mechanics.pose(frame)
    return ca.SX(ca.densify(ca.vertcat(*(ca.horzcat(*row) for row in rows))))


def _pose_jacobian(system: System, motion: Motion, name: str) -> Function:
    frame = _chain(system, name)
    J = ca.densify(_jacobian(system, motion, frame, mechanics.ALIGNED))
    value = ca.vertcat(ca.vec(_matrix(frame).T), ca.vec(J.T))
    velocities = [v.name for v in system.model.velocities]
    labels = (
        *(f"{axis}{k}" for axis in "xyz" for k in range(4)),
        *(f"{part} by {v}" for part in TWIST for v in velocities),
    )
    return Function(
        f"pose_jacobian_{name}", about_frame(_BOTH, name), Result("TJ", value, labels, ())
    )


def _jacobian(system: System, motion: Motion, frame: FrameChain, written: str) -> ca.SX:
    J = ca.SX(6, system.v.numel())
    for j, column in mechanics.jacobian(frame, written).items():
        J[:, j] = ca.vertcat(*column)
    return ca.sparsify(J)


def _jacobian_w(system: System, motion: Motion, frame: FrameChain, written: str) -> ca.SX:
    assert motion.minimal is not None  # else it is not offered
    return ca.mtimes(_jacobian(system, motion, frame, written), motion.minimal.S)


def _jdot_v(system: System, motion: Motion, frame: FrameChain, written: str) -> ca.SX:
    return _rate_of_twist(system, motion, frame, written, [0.0] * system.v.numel())


def _jdot_w(system: System, motion: Motion, frame: FrameChain, written: str) -> ca.SX:
    """J̇ v + J σ: what J v̇ + J̇ v is where ẇ = 0."""
    assert motion.minimal is not None  # else it is not offered
    sigma = [row[0] for row in scalars(ca.SX(motion.minimal.sigma))]
    return _rate_of_twist(system, motion, frame, written, sigma)


def _velocity(system: System, motion: Motion, frame: FrameChain, written: str) -> ca.SX:
    v = [system.v[j] for j in range(system.v.numel())]
    return at_motion(system, motion, ca.vertcat(*mechanics.velocity(frame, v, written)))


def _acceleration(system: System, motion: Motion, frame: FrameChain, written: str) -> ca.SX:
    vdot: Vector = [motion.vdot[j] for j in range(motion.vdot.numel())]
    return _rate_of_twist(system, motion, frame, written, vdot)


def _rate_of_twist(
    system: System, motion: Motion, frame: FrameChain, written: str, vdot: Vector
) -> ca.SX:
    v = [system.v[j] for j in range(system.v.numel())]
    value = ca.vertcat(*mechanics.acceleration(frame, v, vdot, written))
    return at_motion(system, motion, value)


def _none(motion: Motion) -> tuple[Guard, ...]:
    return ()


def _of_velocities(motion: Motion) -> tuple[Guard, ...]:
    return motion.guards


def _of_accelerations(motion: Motion) -> tuple[Guard, ...]:
    return (*motion.guards, *motion.solving)


_QUANTITIES = (
    _Quantity(
        "jacobian",
        "geometric Jacobian J of FRAME, 6 × nv: (velocity, angular velocity) = J v",
        _jacobian,
        _none,
        "J",
    ),
    _Quantity(
        "jdot_v",
        "J̇ v of FRAME: the rate of J v where v̇ = 0",
        _jdot_v,
        _of_velocities,
        "Jdot_v",
        _RATES,
    ),
    _Quantity(
        "frame_velocity",
        "twist (velocity, angular velocity) of FRAME, J v",
        _velocity,
        _of_velocities,
        "twist",
        _SPEEDS,
    ),
    _Quantity(
        "frame_acceleration",
        "acceleration of FRAME in the motion: the rate J v̇ + J̇ v of its twist",
        _acceleration,
        _of_accelerations,
        "rate",
        _RATES,
    ),
    _Quantity(
        "jacobian_w",
        "geometric Jacobian J S of FRAME, 6 × nw: (velocity, angular velocity) = J S w + J R c",
        _jacobian_w,
        _of_velocities,
        "J",
        (),
        True,
    ),
    _Quantity(
        "jdot_w",
        "J̇ v + J σ of FRAME: the rate of J v where ẇ = 0",
        _jdot_w,
        _of_velocities,
        "Jdot_w",
        _RATES,
        True,
    ),
)
