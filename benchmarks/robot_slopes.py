"""Frames and derivatives of a robot beside Pinocchio's: pose and Jacobian of every link and joint
that both name, and ∂v̇/∂q, ∂v̇/∂v, M⁻¹ of the joints that move by themselves.

Displacements are taken along velocities on both sides. Theirs are the derivatives of Pinocchio's
inverse dynamics, solved with its mass matrix on the joints that mimic no other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from derive.formulations.records import Equations, Function
from derive.model.mechanism.named_frames import frames_of
from derive.model.records import GROUND

Note = Callable[[str, np.ndarray, np.ndarray], None]
MOST = 60  # velocities up to which derivatives are compared


@dataclass(frozen=True)
class Slopes:
    """Our functions over (t, x, u, p): `both` by Pinocchio's frame, and `derivatives`."""

    derived: Equations
    both: dict[int, ca.Function]
    derivatives: ca.Function | None
    N: ca.Function
    S: ca.Function

    def check(self, peer: Any, s: Any, x: np.ndarray, u: np.ndarray, note: Note) -> None:
        """At one state."""
        self._frames(peer, s, x, u, note)
        if self.derivatives is not None:
            self._derivatives(peer, s, x, u, note)

    def _frames(self, peer: Any, s: Any, x: np.ndarray, u: np.ndarray, note: Note) -> None:
        pin, axes = peer.pin, peer.pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        pin.computeJointJacobians(peer.model, peer.data, s.pin_q)
        pin.updateFramePlacements(peer.model, peer.data)
        for index, both in self.both.items():
            found = np.asarray(both(0.0, x, u, [])).ravel()
            place = peer.data.oMf[index]
            theirs = np.column_stack([place.rotation, place.translation])
            note("pose", found[:12].reshape(3, 4), theirs)
            J = found[12:].reshape(6, -1)
            theirs = pin.getFrameJacobian(peer.model, peer.data, index, axes)
            scale = max(1.0, float(np.abs(theirs).max()))
            note("jacobian", 1.0 + J[:, peer.columns] / scale, 1.0 + theirs / scale)

    def _derivatives(self, peer: Any, s: Any, x: np.ndarray, u: np.ndarray, note: Note) -> None:
        assert self.derivatives is not None
        mechanics = self.derived.system
        nq, nv, nw = mechanics.q.numel(), mechanics.v.numel(), len(self.derived.w)
        found = np.asarray(self.derivatives(0.0, x, u, []))[nq:]
        S = np.asarray(self.S(0.0, x, u, []))
        rates, by_q, by_w = found[:, 0], found[:, 1 : 1 + nq], found[:, 1 + nq : 1 + nq + nw]
        over_v = by_q @ np.asarray(self.N(x[:nq]))
        along = np.zeros((nv, peer.G.shape[1]))
        along[peer.columns] = peer.G
        w_along = np.linalg.lstsq(S, along, rcond=None)[0]
        ours = [S @ rates, S @ over_v @ along, S @ by_w @ w_along]
        for name, own, theirs in zip(("v̇", "∂v̇/∂q", "∂v̇/∂v"), ours, self._theirs(peer, s, u)):
            # slopes that vanish are held to the accelerations
            scale = max(float(np.abs(x).max()) for x in (theirs, rates, np.ones(1)))
            note(name, 1.0 + own[peer.columns] / scale, 1.0 + theirs / scale)

    def _theirs(self, peer: Any, s: Any, u: np.ndarray) -> list[np.ndarray]:
        model = self.derived.system.model
        drives = {given.velocity: u[i] for i, given in enumerate(model.inputs)}
        force = np.array([drives.get(v.name, 0.0) for v in model.velocities])[peer.columns]
        rub = np.tanh(s.pin_v / peer.width)
        damping = np.asarray(peer.model.damping)
        total = force - damping * s.pin_v - peer.friction * rub
        slope = np.diag(damping + peer.friction * (1.0 - rub**2) / peer.width)
        # by inverse dynamics: `computeABADerivatives`, whose recursion is in the world's frame, has
        # up to three digits less
        G = peer.G
        reduced = G.T @ peer.mass(s) @ G
        rates = G @ np.linalg.solve(reduced, G.T @ (total - peer.bias(s)))
        args = (peer.model, peer.data, s.pin_q, s.pin_v, rates)
        by_q, by_v, _ = (np.array(x) for x in peer.pin.computeRNEADerivatives(*args))
        solved = [-G @ np.linalg.solve(reduced, G.T @ D @ G) for D in (by_q, by_v + slope)]
        return [rates, *solved]


def slopes(derived: Equations, peer: Any, ours: dict[str, str], S: ca.Function) -> Slopes:
    """`ours`: names of the file → names of the model, where they differ."""
    family = next(x for x in derived.families if x.name == "pose_jacobian")
    known = frames_of(derived.system.model)
    both: dict[int, ca.Function] = {}
    for index, frame in enumerate(peer.model.frames):
        name = ours.get(frame.name, frame.name)
        if name in known and name != GROUND and frame.name != "universe":
            both[index] = _function(derived, family.make(name))
    mechanics = derived.system
    found = None
    if mechanics.v.numel() <= MOST:
        found = _function(derived, derived.request("derivatives").function)
    N = ca.Function("N", [mechanics.q], [ca.densify(mechanics.N)])
    return Slopes(derived, both, found, N, S)


def _function(derived: Equations, chosen: Function) -> ca.Function:
    slots = [
        chosen.x if slot.name == "x" and chosen.x is not None else slot
        for slot in derived.arguments
    ]
    return ca.Function("f", [slot.symbols for slot in slots], [ca.densify(chosen.result.value)])
