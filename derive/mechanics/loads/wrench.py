"""Forces and moments at named frames."""

from __future__ import annotations

import casadi as ca

from derive.joints.rotations import cross, matrix, rotated, sum_of, transpose
from derive.mechanics.geometry.named_frames import place_of
from derive.mechanics.loads.records import (
    Applied,
    Law,
    components_in_ground,
    couples_alone,
    force_alone,
)
from derive.mechanics.scene import Scene
from derive.model.load_records import Wrench
from derive.model.mechanism.named_frames import frame_named


def wrench(scene: Scene, load: Wrench) -> Applied:
    """Jᵀ (f, n) with J the geometric Jacobian of the frame: the wrench is handed down from link to
    link, and each joint takes what does work on it."""
    s, nv = scene.symbols, scene.symbols.v.numel()
    frame = frame_named(scene.model, load.frame)
    place = place_of(s, scene.places, frame)
    if place.link < 0:
        return force_alone(scene, ca.SX.zeros(nv))
    given = [s.vector(x) for x in (load.force, load.moment)]
    if load.axes == "frame":
        force, moment = (rotated(matrix(place.rotation), x) for x in given)
    else:
        to_link = transpose(scene.rotations[place.link])
        on_ground = [components_in_ground(scene, frame.body, load.axes, x) for x in given]
        force, moment = (rotated(to_link, x) for x in on_ground)
    couple = (sum_of(moment, cross(place.position, force)), force)
    return couples_alone(scene, {place.link: couple})


WRENCH = Law(Wrench, wrench)
