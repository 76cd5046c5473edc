"""What a model file says of each load: forces, springs, dampers, rotors."""

from __future__ import annotations

from dataclasses import dataclass

from derive.expressions.tree import Expression
from derive.model.records import Path, Placement, Span, Vector3


@dataclass(frozen=True)
class JointSpring:
    """Generalised force −stiffness (q − rest) on one coordinate."""

    name: str
    coordinate: str
    stiffness: Expression
    rest: Expression
    span: Span


@dataclass(frozen=True)
class BallSpring:
    """V = ½ Σ stiffnessᵢ φᵢ² in a ball joint, φ the rotation vector of its unit quaternion, the
    shorter way round, along the joint's axes: `coordinates` (w, x, y, z) and the angular
    velocities. Where the stiffnesses are equal that is a torque −stiffness φ."""

    name: str
    joint: str
    coordinates: tuple[str, str, str, str]
    velocities: tuple[str, str, str]
    stiffness: Vector3
    span: Span


@dataclass(frozen=True)
class JointDamper:
    """Generalised force −coefficient · rate on one coordinate's generalized velocity."""

    name: str
    velocity: str
    coefficient: Expression
    span: Span


@dataclass(frozen=True)
class PointSpring:
    """Along the line between two points: tension stiffness (distance − length) + damping ·
    d(distance)/dt."""

    name: str
    bodies: tuple[str, str]
    points: tuple[Vector3, Vector3]
    stiffness: Expression
    length: Expression
    damping: Expression
    span: Span


@dataclass(frozen=True)
class Tension:
    """A pull (N) along a path, the same all the way: −tension ∂length/∂q; negative ones push."""

    name: str
    path: Path
    tension: Expression
    span: Span


@dataclass(frozen=True)
class Contact:
    """Penalty contact after Hunt and Crossley, exponent one: with the depth δ of a body's shape
    below a plane of `carrier`, pressure k δ max(0, 1 + damping δ̇), friction −μ times that along
    the slip v, over √(v² + smoothing²).

    `shape`: "point", "sphere" or "disk" (thin, about `axis`); a circle in a planar model. `centre`
    and `axis` in the body's frame, `origin` and `normal` in the carrier's. `surface`, where given,
    stands for the plane: a formula of x, y, z in the carrier's frame, positive outside, whose
    value over its slope is the height.

    `tyre`, in place of friction: (B,) of a linear or (B, C, D, E) of Pacejka's curve over the
    longitudinal slip, then over the slip angle; forces per pressure.
    """

    name: str
    body: str
    centre: Vector3
    shape: str
    radius: Expression
    axis: Vector3
    carrier: str
    origin: Vector3
    normal: Vector3
    surface: Expression | None
    stiffness: Expression
    damping: Expression
    friction: Expression
    smoothing: Expression
    span: Span
    tyre: tuple[tuple[Expression, ...], ...] = ()


@dataclass(frozen=True)
class Force:
    """Force (N) on a body's point; components in the ground frame or, `frame` = "body", in the
    body's."""

    name: str
    body: str
    point: Vector3
    components: Vector3
    frame: str
    span: Span


@dataclass(frozen=True)
class Torque:
    name: str
    body: str
    components: Vector3
    frame: str
    span: Span


@dataclass(frozen=True)
class Exhaust:
    """Matter that leaves a body whose mass (kg) depends on t: at `point` (m) with `velocity` (m/s)
    relative to the body, both in its frame."""

    name: str
    body: str
    mass: Expression
    velocity: Vector3
    point: Vector3
    span: Span


@dataclass(frozen=True)
class Wrench:
    """Force (N) at the origin of a named frame and moment (N m); components along the ground's axes
    or, `axes` = "frame", along the frame's."""

    name: str
    frame: str
    force: Vector3
    moment: Vector3
    axes: str
    span: Span


@dataclass(frozen=True)
class GeneralisedForce:
    """Expression added to the force conjugate to one generalized velocity (a joint's force law, or
    `forces:` of the analytic form)."""

    name: str
    velocity: str
    expression: Expression
    span: Span


@dataclass(frozen=True)
class Bushing:
    """Springs and dampers along and about the three axes of the first body's placed frame, towards
    the second body's.

    Force on the second body −stiffness · displacement − damping · relative velocity, torque
    −torsion · rotation vector − torsion_damping · relative angular velocity, all in the first
    frame; the first body gets the opposite.
    """

    name: str
    bodies: tuple[str, str]
    placements: tuple[Placement, Placement]
    stiffness: Vector3
    torsion: Vector3
    damping: Vector3
    torsion_damping: Vector3
    span: Span


@dataclass(frozen=True)
class JointFriction:
    """Generalised force −viscous · v − coulomb · tanh(v/smoothing) on one generalized velocity."""

    name: str
    velocity: str
    viscous: Expression
    coulomb: Expression
    smoothing: Expression
    span: Span
    dry: bool = True  # the file speaks of dry friction, be it as zero


@dataclass(frozen=True)
class Armature:
    """Inertia of a rotor as the joint feels it: `inertia` is added to the diagonal of M at one
    generalized velocity."""

    name: str
    velocity: str
    inertia: Expression
    span: Span
