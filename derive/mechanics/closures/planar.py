"""Planes that close a loop."""

from __future__ import annotations

from derive.mechanics.closures.parts import parallel, shifts
from derive.mechanics.closures.records import Closing
from derive.mechanics.scene import Block, Scene
from derive.model.records import (
    Closure,
)


def planar(scene: Scene, closure: Closure) -> list[Block]:
    """3 rows: the point stays in the plane, n · (r₂ − r₁) = 0 in m, and its normal stays parallel
    to that of the other body."""
    return [shifts(scene, closure, (2,)), parallel(scene, closure)]


PLANAR = Closing("planar", planar)
