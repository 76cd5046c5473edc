"""What a kind of closure is to the mechanics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from derive.mechanics.scene import Block, Scene
from derive.model.records import (
    Closure,
)


@dataclass(frozen=True)
class Closing:
    """`parts` gives the blocks of rows by which a joint of the type `name` closes a loop: points
    that coincide first, then directions that stay at right angles."""

    name: str
    parts: Callable[[Scene, Closure], list[Block]]
