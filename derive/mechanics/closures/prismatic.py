"""Slides that close a loop."""

from __future__ import annotations

from derive.mechanics.closures.parts import LOCKED, locked, shifts
from derive.mechanics.closures.records import Closing
from derive.mechanics.scene import Block, Scene
from derive.model.records import (
    Closure,
)


def prismatic(scene: Scene, closure: Closure) -> list[Block]:
    """Across the axis nothing shifts and nothing turns: 2 rows in m and 3 of angles; in a plane one
    of each."""
    if scene.model.plane:
        return [shifts(scene, closure, (0,)), locked(scene, closure, ((0, 2),))]
    return [shifts(scene, closure, (0, 1)), locked(scene, closure, LOCKED)]


PRISMATIC = Closing("prismatic", prismatic)
