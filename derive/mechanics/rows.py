"""Velocity rows from formulas, and blocks from positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from derive.expressions.scalars import Scalar
from derive.expressions.tree import Expression
from derive.mechanics.records import Row, RowForm
from derive.mechanics.scene import Block, Scene
from derive.mechanics.symbols import Symbols


def numbered(found: Sequence[Block]) -> list[Block]:
    """φ indices counted through all blocks."""
    result: list[Block] = []
    start = 0
    for block in found:
        rows = tuple(
            Row(r.name, r.position + start if r.position >= 0 else -1, r.unit) for r in block.rows
        )
        result.append(replace(block, rows=rows))
        start += len(block.phi)
    return result


def block_of_positions(
    scene: Scene, names: Sequence[str], phi: Sequence[ca.SX], unit: str
) -> Block:
    """Rows found by differentiating φ."""
    forms = tuple(row_form(scene, name, scene.rate(x)) for name, x in zip(names, phi))
    return Block(tuple(Row(name, i, unit) for i, name in enumerate(names)), tuple(phi), (forms,))


def row_form(scene: Scene, name: str, velocity: ca.SX) -> RowForm:
    """Coefficients, value and rate of a row given as an expression a(q, t)·v + b(q, t) = 0."""
    coefficients, value, rate = velocity_row(scene.symbols, scene.qdot, velocity)
    return RowForm(name, (), coefficients, value, rate)


def velocity_row(
    s: Symbols, qdot: ca.SX, velocity: ca.SX
) -> tuple[tuple[tuple[int, Scalar], ...], Scalar, Scalar]:
    """((j, aⱼ), …), −b and −d(a)/dt v − d(b)/dt of a·v + b, for a velocity that is linear in v. The
    row then reads a v = −b, and its rate a v̇ = −ȧ v − ḃ."""
    coefficients = ca.jacobian(velocity, s.v)
    offset = ca.substitute(velocity, s.v, ca.SX.zeros(s.v.numel()))
    rate = -ca.jtimes(velocity, ca.vertcat(s.t, s.q), ca.vertcat(1, qdot))
    columns = coefficients.sparsity().get_triplet()[1]
    return tuple((j, coefficients[0, j]) for j in columns), -offset, rate


def nonideal_forces(scene: Scene, forces: Sequence[Expression]) -> tuple[ca.SX, ...]:
    """The force C of a nonideal constraint (Udwadia and Kalaba 2001), one entry for each coordinate
    and conjugate to q̇; rates in the formulas are put over v by q̇ = N v."""
    return tuple(scene.over_v(ca.SX(scene.symbols.scalar(f))) for f in forces)
