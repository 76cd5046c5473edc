"""Functions of named frames against the reference's own kinematics: poses, Jacobians, velocities
and accelerations."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from derive.model.mechanism.named_frames import frames_of, readings
from hamel.verify.checks.check import Check
from hamel.verify.checks.compare import Sums, deviation, worst
from hamel.verify.checks.evidence import Evidence
from hamel.verify.checks.quasi import partial_velocities, partial_velocities_at
from hamel.verify.limits import CANCELLING, SOLVED, TERMS
from hamel.verify.reference.named_frames import FrameMotion, frame_motion
from hamel.verify.reference.vectors import Array

Wanted = Callable[[Evidence, int, FrameMotion], Array]


def functions_of(e: Evidence, *quantities: str) -> Iterator[tuple[str, str, str]]:
    """Function, frame and axes of every function there is of these quantities."""
    known = frames_of(e.reference.model)
    for function in e.graph.equations.functions:
        for family, frame in readings(function.name, known):
            quantity = family.removesuffix("_local").removesuffix("_world")
            if quantity in quantities:
                yield function.name, frame, family[len(quantity) :]


def poses(e: Evidence) -> float | None:
    """R and p of the reference, also where J comes with them."""
    unit = np.ones((3, 4))
    unit[:, 3] = e.units.own.length
    errors = [
        deviation(_results(e, name), [s.pose for s in _motions(e, frame, "")], unit=unit)
        for name, frame, _ in functions_of(e, "pose")
    ]
    for name, frame, _ in functions_of(e, "pose_quaternion"):
        own = [_from_quaternion(result) for result in _results(e, name)]
        errors.append(deviation(own, [s.pose for s in _motions(e, frame, "")], unit=unit))
    for name, frame, _ in functions_of(e, "pose_jacobian"):
        motions = _motions(e, frame, "")
        own = np.concatenate([np.ravel(unit), np.ravel(_jacobian_unit(e, e.units.v))])
        both = [np.concatenate([np.ravel(s.pose), np.ravel(s.J)]) for s in motions]
        sums = Sums(TERMS, [1.0 + worst(x / own) for x in both])
        errors.append(deviation(_results(e, name), both, unit=own, sums=sums))
    return worst(errors) if errors else None


def _from_quaternion(seven: Array) -> Array:
    """[R p] of p and (w, x, y, z); R is none of a rotation where the length is not one, or where
    the largest entry is negative."""
    p, q = np.ravel(seven)[:3], np.ravel(seven)[3:]
    if q[np.argmax(np.abs(q))] < 0.0:
        return np.full((3, 4), np.inf)
    w, (x, y, z) = q[0], q[1:]
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    R = (w * w - q[1:] @ q[1:]) * np.eye(3) + 2.0 * np.outer(q[1:], q[1:]) + 2.0 * w * skew
    return np.column_stack([R, p])


def jacobians(e: Evidence) -> float | None:
    """J of the reference; and J S with the partial velocities that `velocity` has."""
    errors: list[float] = []
    for name, frame, axes in functions_of(e, "jacobian"):
        wanted = [s.J for s in _motions(e, frame, axes)]
        errors.append(_of_matrix(e, name, wanted, e.units.v, None))
    for name, frame, axes in functions_of(e, "jacobian_w"):
        S = partial_velocities(e)
        wanted = [s.J @ each for s, each in zip(_motions(e, frame, axes), S)]
        errors.append(_of_matrix(e, name, wanted, e.units.w, e.conditions))
    return worst(errors) if errors else None


def _of_matrix(
    e: Evidence, name: str, wanted: list[Array], columns: Array, relax: list[float] | None
) -> float:
    """Sums of lever arms, of which the largest counts."""
    unit = _jacobian_unit(e, columns)
    sums = Sums(TERMS, [1.0 + worst(x / unit) for x in wanted])
    return deviation(_results(e, name), wanted, relax, unit=unit, sums=sums)


def _jacobian_unit(e: Evidence, columns: Array) -> Array:
    return np.outer(_twist_unit(e), 1.0 / columns)


def velocities(e: Evidence) -> float | None:
    """J v at the choice's own v."""
    sums = e.of_speeds(TERMS)
    errors = [
        deviation(
            _results(e, name),
            [s.twist for s in _motions(e, frame, axes)],
            unit=_twist_unit(e),
            sums=_far(e, frame, sums),
        )
        for name, frame, axes in functions_of(e, "frame_velocity")
    ]
    return worst(errors) if errors else None


def velocity_products(e: Evidence) -> float | None:
    """J̇ v: the rate of J v that the reference has at v̇ = 0."""
    return _rates(e, "jdot_v", _products, None, CANCELLING)


def accelerations(e: Evidence) -> float | None:
    """J v̇ + J̇ v with the reference's v̇; and, where ẇ = 0, with v̇ less S ẇ, which may leave little
    of it."""
    motion = _rates(e, "frame_acceleration", _accelerated, e.conditions, SOLVED)
    still = _rates(e, "jdot_w", _without_wdot, e.conditions, SOLVED, _accelerated)
    known = [error for error in (motion, still) if error is not None]
    return worst(known) if known else None


def _rates(
    e: Evidence,
    quantity: str,
    wanted: Wanted,
    relax: list[float] | None,
    tolerance: float,
    cancelled: Wanted | None = None,
) -> float | None:
    """`cancelled` is a part of the sum that need not be seen in what is left of it."""
    unit, errors = _twist_unit(e) / e.units.time, list[float]()
    for name, frame, axes in functions_of(e, quantity):
        motions = [*enumerate(_motions(e, frame, axes))]
        sums = _far(e, frame, e.of_accelerations(tolerance))
        if cancelled is not None:
            parts = [worst(cancelled(e, k, s) / unit) for k, s in motions]
            sums = Sums(tolerance, np.asarray(sums.sizes) + parts)
        found = [wanted(e, k, s) for k, s in motions]
        errors.append(deviation(_results(e, name), found, relax, unit=unit, sums=sums))
    return worst(errors) if errors else None


def _products(e: Evidence, k: int, motion: FrameMotion) -> Array:
    return motion.drift


def _accelerated(e: Evidence, k: int, motion: FrameMotion) -> Array:
    return motion.J @ e.outcomes[k].vdot + motion.drift


def _without_wdot(e: Evidence, k: int, motion: FrameMotion) -> Array:
    s, x = e.samples[k], e.x[k]
    wdot = e.graph("dynamics", s.t, x, s.u, s.p)[e.graph.equations.speeds]
    still = e.outcomes[k].vdot - partial_velocities_at(e, k) @ wdot
    return motion.J @ still + motion.drift


def _far(e: Evidence, frame: str, sums: Sums) -> Sums:
    """At a frame far out, or at the ground's origin far from one, lever arms are part of the
    sum."""
    reach = [worst(s.origin) / e.units.own.length for s in _motions(e, frame, "")]
    return Sums(sums.tolerance, np.asarray(sums.sizes) * (1.0 + np.array(reach)))


def _motions(e: Evidence, frame: str, axes: str) -> list[FrameMotion]:
    """The frame at every state, at the choice's own velocities."""
    places = zip(e.own, e.outcomes)
    return [frame_motion(e.reference, s, o.kinematics, frame).written(axes) for s, o in places]


def _results(e: Evidence, name: str) -> list[Array]:
    return [e.graph(name, s.t, x, s.u, s.p) for s, x in zip(e.samples, e.x)]


def _twist_unit(e: Evidence) -> Array:
    own = e.units.own
    return np.concatenate([np.full(3, own.length), np.ones(3)]) / own.time


CHECKS = (
    Check("poses of frames", TERMS, "reference: where the body is, and the frame in it", poses),
    Check("Jacobians of frames", TERMS, "reference: twists of bodies per velocity", jacobians),
    Check("velocities of frames", TERMS, "reference: twists of bodies", velocities),
    Check(
        "J̇ v of frames", CANCELLING, "reference: rates of the twists at v̇ = 0", velocity_products
    ),
    Check(
        "accelerations of frames",
        SOLVED,
        "reference: rates of the twists with its v̇, per condition number",
        accelerations,
    ),
)
