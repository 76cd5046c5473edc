"""What constraints and loads need to know of a model, and what a constraint gives: a block of
rows."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from derive.expressions.scalars import Matrix, Vector
from derive.mechanics.records import Link, Place, Row, RowForm
from derive.mechanics.symbols import Symbols
from derive.model.records import (
    Model,
)

NORMAL = {"xy": [0.0, 0.0, 1.0], "xz": [0.0, -1.0, 0.0], "yz": [1.0, 0.0, 0.0], "": [0.0, 0.0, 1.0]}
IN_PLANE = {"xy": (0, 1), "xz": (0, 2), "yz": (1, 2), "": (0, 1, 2)}
NOTHING: Vector = [0.0, 0.0, 0.0]


@dataclass(frozen=True)
class Scene:
    """What a constraint needs to know: symbols, q̇ = N v, and where every body is."""

    model: Model
    symbols: Symbols
    qdot: ca.SX
    links: tuple[Link, ...]
    places: dict[str, Place]
    rotations: list[Matrix]  # ground ← link
    positions: list[Vector]  # of the links' origins, in the ground
    omegas: list[Vector]  # of the links, in their frames

    def rate(self, expression: ca.SX) -> ca.SX:
        """d/dt of a function of t and q: ∂/∂t + ∂/∂q N v."""
        s = self.symbols
        return ca.jtimes(expression, ca.vertcat(s.t, s.q), ca.vertcat(1, self.qdot))

    def over_v(self, expression: ca.SX) -> ca.SX:
        """The same with q̇ replaced by N v: formulas of a file may speak of either, the System
        speaks of v alone."""
        return ca.substitute(expression, self.symbols.qd, self.qdot)


@dataclass(frozen=True)
class Block:
    rows: tuple[Row, ...]
    phi: tuple[ca.SX, ...]
    ways: tuple[tuple[RowForm, ...], ...]
    nonideal: tuple[ca.SX, ...] = ()  # generalised force per coordinate, conjugate to q̇
