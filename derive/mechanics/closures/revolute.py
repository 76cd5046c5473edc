"""Hinges that close a loop."""

from __future__ import annotations

from derive.mechanics.closures.parts import meeting, parallel
from derive.mechanics.closures.records import Closing
from derive.mechanics.scene import Block, Scene
from derive.model.records import (
    Closure,
)


def revolute(scene: Scene, closure: Closure) -> list[Block]:
    """5 rows: the points meet (3, in m) and the axes stay parallel (2). In a plane the axes always
    are, and 2 rows are left."""
    return [
        meeting(scene, closure),
        *([] if scene.model.plane else [parallel(scene, closure)]),
    ]


REVOLUTE = Closing("revolute", revolute)
