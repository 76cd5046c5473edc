"""Planes that close a loop."""

from __future__ import annotations

from derive.mechanics.closures.parts import PARALLEL, right_angles, shifts
from derive.mechanics.closures.records import Closing
from derive.mechanics.scene import Block, Scene
from derive.model.records import (
    Closure,
)


def planar(scene: Scene, closure: Closure) -> list[Block]:
    return [shifts(scene, closure, (2,)), right_angles(scene, closure, PARALLEL)]


PLANAR = Closing("planar", planar)
