"""Formulas of the coordinates that stay zero."""

from __future__ import annotations

import casadi as ca

from derive.mechanics.constraints.records import Tie
from derive.mechanics.records import Row
from derive.mechanics.rows import nonideal_forces, row_form
from derive.mechanics.scene import Block, Scene
from derive.model.constraint_records import Holonomic


def holonomic(scene: Scene, constraint: Holonomic) -> Block:
    """φ(q, t) = 0 as given, with its rate φ_q N v + φ_t = 0 as velocity row; `nonideal` are forces
    that act where the constraint does work."""
    s = scene.symbols
    phi = ca.SX(s.scalar(constraint.expression))
    velocity = scene.rate(phi)
    row = row_form(scene, constraint.name, velocity)
    return Block(
        (Row(constraint.name, 0, ""),),
        (phi,),
        ((row,),),
        nonideal_forces(scene, constraint.nonideal),
    )


HOLONOMIC = Tie(Holonomic, holonomic)
