"""Constraints of a model as positions φ and velocity rows.

A block is one constraint with the equivalent ways of writing its velocity rows; the first way
defines A, c and β. The rows of a closure can be taken along the axes of the ground or of either
body: the equations are the same, the pivots are not.
"""

from __future__ import annotations

from derive.mechanics.closures import CLOSING_OF
from derive.mechanics.constraints import TIE_OF
from derive.mechanics.rows import numbered
from derive.mechanics.scene import Block, Scene
from derive.model.records import (
    Closure,
)


def blocks(scene: Scene) -> list[Block]:
    """Closures first, then constraints, in the model's order."""
    result = [_closure(scene, closure) for closure in scene.model.closures]
    for constraint in scene.model.constraints:
        result.append(TIE_OF[type(constraint)](scene, constraint))
    return numbered(result)


def _closure(scene: Scene, closure: Closure) -> Block:
    """A joint that closes a loop: points that coincide first, then directions that stay at right
    angles.

    Points: φ = p₂ − p₁ in ground axes, or the parts of it along axes of the first body. Directions:
    φ = b · a with a, b fixed in the first and second body; never 1 − cos, whose gradient vanishes
    at the solution.
    """
    parts = CLOSING_OF[closure.type](scene.between(closure.bodies), closure)
    rest = tuple(row for part in parts[1:] for row in part.ways[0])
    rows = tuple(row for part in numbered(parts) for row in part.rows)
    return Block(
        rows,
        tuple(x for part in parts for x in part.phi),
        tuple((*way, *rest) for way in parts[0].ways),
        assembly=tuple(x for part in parts for x in part.closing),
        whole=tuple(x for part in parts for x in part.excess),
    )
