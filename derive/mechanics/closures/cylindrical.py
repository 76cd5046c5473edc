"""Cylinders that close a loop."""

from __future__ import annotations

from derive.mechanics.closures.parts import PARALLEL, right_angles, shifts
from derive.mechanics.closures.records import Closing
from derive.mechanics.scene import Block, Scene
from derive.model.records import (
    Closure,
)


def cylindrical(scene: Scene, closure: Closure) -> list[Block]:
    """4 rows: no shift along the first two axes of the joint frame (m), and its axis stays parallel
    to that of the other body (1). Sliding along the axis and turning about it stay free."""
    return [shifts(scene, closure, (0, 1)), right_angles(scene, closure, PARALLEL)]


CYLINDRICAL = Closing("cylindrical", cylindrical)
