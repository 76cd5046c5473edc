"""Soft welds."""

from __future__ import annotations

import casadi as ca

from derive.mechanics.frames import joint_frame
from derive.mechanics.loads.records import Applied, Law
from derive.mechanics.scene import Scene
from derive.model.load_records import Bushing


def bushing(scene: Scene, load: Bushing) -> Applied:
    """A soft weld: ½ Σ kᵢ dᵢ² + ½ Σ κᵢ θᵢ² and the dampings, in the first body's joint frame.

    d is the second origin's displacement, θ = ½ Σ aᵢ × bᵢ of the two frames' axes: the rotation
    vector while it is small.
    """
    s, near = scene.symbols, scene.among(load.bodies)
    frames = [joint_frame(near, body, at, ()) for body, at in zip(load.bodies, load.placements)]
    (start, a), (end, b) = frames
    turn = 0.5 * sum((ca.cross(x, y) for x, y in zip(a, b)), ca.SX.zeros(3))
    parts = [(ca.vertcat(*[ca.dot(e, end - start) for e in a]), load.stiffness, load.damping)]
    parts.append((ca.vertcat(*[ca.dot(e, turn) for e in a]), load.torsion, load.torsion_damping))
    energy, force = ca.SX(0), ca.SX.zeros(s.v.numel())
    for deflection, stiffness, damping in parts:
        energy += 0.5 * ca.dot(ca.vertcat(*s.vector(stiffness)), deflection * deflection)
        rate = scene.rate(deflection)
        force -= ca.jtimes(rate, s.v, ca.vertcat(*s.vector(damping)) * rate, True)
    return Applied(energy, force)


BUSHING = Law(Bushing, bushing)
