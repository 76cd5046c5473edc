"""Welds that close a loop."""

from __future__ import annotations

from derive.mechanics.closures.parts import LOCKED, locked, meeting
from derive.mechanics.closures.records import Closing
from derive.mechanics.scene import Block, Scene
from derive.model.records import (
    Closure,
)


def fixed(scene: Scene, closure: Closure) -> list[Block]:
    """6 rows (3 in a plane): the points meet, in m, and pairs of axes of the two frames stay at
    right angles, each eᵢ · e'ⱼ = 0.

    Right angles are products of unit vectors: smooth, and regular near the position where the
    frames agree.
    """
    return [
        meeting(scene, closure),
        locked(scene, closure, ((0, 1),) if scene.model.plane else LOCKED),
    ]


FIXED = Closing("fixed", fixed)
