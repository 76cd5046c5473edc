"""What a kind of constraint is to the mechanics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from derive.mechanics.scene import Block, Scene


@dataclass(frozen=True)
class Tie:
    """`block` gives the rows of a constraint of the type `record` (derive.model)."""

    record: type
    block: Callable[[Scene, Any], Block]
