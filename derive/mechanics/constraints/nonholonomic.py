"""Formulas linear in the rates that stay zero."""

from __future__ import annotations

import casadi as ca

from derive.mechanics.constraints.records import Tie
from derive.mechanics.records import Row
from derive.mechanics.rows import nonideal_forces, row_form
from derive.mechanics.scene import Block, Scene
from derive.model.constraint_records import Nonholonomic


def nonholonomic(scene: Scene, constraint: Nonholonomic) -> Block:
    """A row linear in the rates, as given. Rates of coordinates are put over v by q̇ = N v first,
    as A multiplies v."""
    velocity = scene.over_v(ca.SX(scene.symbols.scalar(constraint.expression)))
    row = row_form(scene, constraint.name, velocity)
    return Block(
        (Row(constraint.name, -1, ""),), (), ((row,),), nonideal_forces(scene, constraint.nonideal)
    )


NONHOLONOMIC = Tie(Nonholonomic, nonholonomic)
