"""Cylinders that close a loop."""

from __future__ import annotations

from derive.mechanics.closures.parts import parallel, shifts
from derive.mechanics.closures.records import Closing
from derive.mechanics.scene import Block, Scene
from derive.model.records import (
    Closure,
)


def cylindrical(scene: Scene, closure: Closure) -> list[Block]:
    """4 rows: two against shifts across the axis, in m, and two by which the axes of both bodies
    stay parallel. Sliding along the axis and turning about it stay free."""
    return [shifts(scene, closure, (0, 1)), parallel(scene, closure)]


CYLINDRICAL = Closing("cylindrical", cylindrical)
