"""Balls that close a loop."""

from __future__ import annotations

from derive.mechanics.closures.parts import meeting
from derive.mechanics.closures.records import Closing
from derive.mechanics.scene import Block, Scene
from derive.model.records import (
    Closure,
)


def ball(scene: Scene, closure: Closure) -> list[Block]:
    """φ = p₂ − p₁: the two joint points meet, 3 rows in m; all rotations stay free."""
    return [meeting(scene, closure)]


BALL = Closing("ball", ball)
