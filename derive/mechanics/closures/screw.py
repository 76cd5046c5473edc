"""Screws that close a loop."""

from __future__ import annotations

import casadi as ca
import numpy as np

from derive.mechanics.closures.cylindrical import cylindrical
from derive.mechanics.closures.records import Closing
from derive.mechanics.geometry.frames import (
    angular_velocity,
    closure_frames,
)
from derive.mechanics.records import Row
from derive.mechanics.rows import row_form
from derive.mechanics.scene import Block, Scene
from derive.model.records import (
    Closure,
)


def screw(scene: Scene, closure: Closure) -> list[Block]:
    """A cylindrical closure whose slide follows its turn. The turn has no single-valued angle, so
    that row is held as a velocity: axis · (ṗ₂ − ṗ₁) = pitch/2π axis · (ω₂ − ω₁), in m/s. It is
    integrable all the same, but where the slide stands along the thread is left to the initial
    values."""
    near = scene.among(closure.bodies)
    frames = closure_frames(near, closure)
    axis = frames.axes[0][2]
    slide = scene.rate(ca.dot(axis, frames.origins[1] - frames.origins[0]))
    spins = [ca.vertcat(*angular_velocity(near, near.places[body])) for body in closure.bodies]
    advance = scene.symbols.scalar(closure.pitch) / (2 * np.pi)
    name = f"{closure.name}.advance"
    row = row_form(scene, name, slide - advance * ca.dot(axis, spins[1] - spins[0]))
    return [*cylindrical(scene, closure), Block((Row(name, -1, "m/s"),), (), ((row,),))]


SCREW = Closing("screw", screw)
