"""Named frames by the reference's own kinematics: where they are, J and the rate of J v at v̇ = 0.

Everything is (velocity of the origin, angular velocity) along the ground's axes first; the other
ways of writing a twist down are made of that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from derive.model.mechanism.named_frames import frame_named
from derive.model.records import GROUND
from hamel.verify.reference.outcome import Kinematics, Reference
from hamel.verify.reference.states import STILL, State, placed
from hamel.verify.reference.vectors import Array, cross, skew


@dataclass(frozen=True)
class FrameMotion:
    """R ground ← frame, the origin p, J (6 × nv) and what the rate of J v is at v̇ = 0, at one
    state; `twist` is J v."""

    rotation: Array
    origin: Array
    J: Array
    drift: Array
    twist: Array

    @property
    def pose(self) -> Array:
        """[R p], 3 × 4."""
        return np.column_stack([self.rotation, self.origin])

    def written(self, axes: str) -> FrameMotion:
        """The same twist along other axes or at another point: `_local`, `_world`, or "" as it
        is."""
        if axes == "_local":
            return self._local()
        return self._world() if axes == "_world" else self

    def _local(self) -> FrameMotion:
        """Rᵀ of each half; d(Rᵀ x)/dt = Rᵀ (ẋ − ω × x)."""
        back = np.kron(np.eye(2), self.rotation.T)
        omega = self.twist[3:]
        turning = np.concatenate([cross(omega, self.twist[:3]), np.zeros(3)])
        drift = back @ (self.drift - turning)
        return FrameMotion(self.rotation, self.origin, back @ self.J, drift, back @ self.twist)

    def _world(self) -> FrameMotion:
        """v + p × ω; its rate is v̇ + v × ω + p × ω̇."""
        moved = np.eye(6)
        moved[:3, 3:] = skew(self.origin)
        drift = moved @ self.drift
        drift[:3] += cross(self.twist[:3], self.twist[3:])
        return FrameMotion(self.rotation, self.origin, moved @ self.J, drift, moved @ self.twist)


def frame_motion(ref: Reference, s: State, kin: Kinematics, name: str) -> FrameMotion:
    """The frame of that name at one state, from where its body is and how that moves."""
    frame = frame_named(ref.model, name)
    body = STILL if frame.body == GROUND else s.frames[frame.body]
    seat, turn = placed(s, frame.at)
    arm = body.point(seat)
    rotation, origin = body.rotation @ turn, body.origin + arm
    if frame.body == GROUND:
        nothing = np.zeros(6)
        return FrameMotion(rotation, origin, np.zeros((6, ref.place.nv)), nothing, nothing)
    rows = ref.place.row(frame.body)
    angular, linear = kin.J[rows][:3], kin.J[rows][3:]
    alpha, rate = kin.drift[rows][:3], kin.drift[rows][3:]
    J = np.vstack([linear - skew(arm) @ angular, angular])
    swung = cross(alpha, arm) + cross(body.omega, cross(body.omega, arm))
    drift = np.concatenate([rate + swung, alpha])
    return FrameMotion(rotation, origin, J, drift, np.concatenate([body.speed(arm), body.omega]))
