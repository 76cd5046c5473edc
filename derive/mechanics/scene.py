"""What constraints and loads need to know of a model, and what a constraint gives: a block of
rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import casadi as ca

from derive.diagnostics import AssumptionError
from derive.expressions.scalars import Vector
from derive.mechanics.limits import DEEP, DEEP_IN_PLANE
from derive.mechanics.records import Link, Place, Row, RowForm, Spinless
from derive.mechanics.recursions.motion import STILL, Numbers, child_numbers
from derive.mechanics.recursions.tree import (
    Positions,
    Rotations,
    ground_positions,
    ground_rotations,
    nearest_carrier,
    origin_on,
    path,
    rotations_on,
    twists,
)
from derive.mechanics.symbols import Symbols
from derive.model.records import (
    Model,
)

NORMAL = {"xy": [0.0, 0.0, 1.0], "xz": [0.0, -1.0, 0.0], "yz": [1.0, 0.0, 0.0], "": [0.0, 0.0, 1.0]}
IN_PLANE = {"xy": (0, 1), "xz": (0, 2), "yz": (1, 2), "": (0, 1, 2)}
NOTHING: Vector = [0.0, 0.0, 0.0]
OF_A_LINK = 18  # numbers: R, r, ω, v


@dataclass(frozen=True)
class Scene:
    """What a constraint needs to know: symbols, q̇ = N v, and where every body is; `frame` where the
    links are those of a tree with a further frame (derive.mechanics.carriers). `carrier` and
    `beyond` where the axes are those of a link: it stands still, and what lies beyond it moves.
    `cut` has symbols by link, R row by row, r, ω and v, where these stand for themselves."""

    model: Model
    symbols: Symbols
    qdot: ca.SX
    links: tuple[Link, ...]
    places: dict[str, Place]
    frame: Spinless | None = None
    carrier: int = -1
    beyond: tuple[int, ...] | None = None
    cut: tuple[ca.SX, ...] = ()

    @cached_property
    def rotations(self) -> Rotations:
        """Ground ← link."""
        if self.cut:
            return [[[x[3 * i + k] for k in range(3)] for i in range(3)] for x in self.cut]
        return ground_rotations(self.links)

    @cached_property
    def positions(self) -> Positions:
        """Of the links' origins, in the ground."""
        if self.cut:
            return [_vector(x[9:12]) for x in self.cut]
        return ground_positions(self.links, self.rotations)

    @cached_property
    def numbers(self) -> list[Numbers]:
        """Twists (ω, v) of the links, in their frames."""
        if self.cut:
            return [(_vector(x[12:15]), _vector(x[15:])) for x in self.cut]
        v = [self.symbols.v[i] for i in range(self.symbols.v.numel())]
        if self.frame is None:
            return twists(self.links, v)
        return self.frame.turning(twists(self.links, self.frame.still(v)), v)

    @cached_property
    def omegas(self) -> list[Vector]:
        """Angular velocities of the links, in their frames."""
        return [list(angular) for angular, _ in self.numbers]

    def twist(self, link: int) -> Numbers:
        """(ω, v) of a link, or the ground, against what stands still here, in its frame."""
        if link < 0:
            return STILL
        return self.numbers[link] if self.beyond is None else self._relative[link]

    @cached_property
    def _relative(self) -> dict[int, Numbers]:
        """Twists against the carrier."""
        found: dict[int, Numbers] = {self.carrier: STILL}
        for i in self.beyond or ():
            link = self.links[i]
            own: Vector = [self.symbols.v[j] for j in link.columns]
            found[i] = child_numbers(link, found[link.parent], own)
        return found

    def is_deep(self, link: int) -> bool:
        """Are there many links on the way to it, or is it not looked at?"""
        if self.cut:
            return link >= 0
        most = DEEP_IN_PLANE if self.model.plane else DEEP
        return len(path(self.links, link)) > most

    def at_links(self) -> Scene:
        """With symbols for where the links are and how they move."""
        poses = [ca.SX.sym(f"pose{i}", OF_A_LINK) for i in range(len(self.links))]
        return replace(self, cut=tuple(poses))

    def with_symbols(self, symbols: Symbols) -> Scene:
        """With more names; what was computed is kept."""
        made = replace(self, symbols=symbols)
        given = {f.name for f in fields(self)}
        vars(made).update({name: x for name, x in vars(self).items() if name not in given})
        return made

    def between(self, bodies: Sequence[str]) -> Scene:
        """As a constraint between these bodies sees it: positions are counted from the link that
        carries all of them, in ground axes. What it does is not between them, and would leave
        rounding; where they are parts of one link nothing is, and that stands still."""
        first, second = (self.places[body].link for body in bodies)
        carrier, beyond = nearest_carrier(self.links, first, second)
        if carrier < 0:
            return self
        if not beyond:
            resting = {body: replace(self.places[body], link=-1) for body in bodies}
            return replace(self, places=self.places | resting)
        near = self.with_symbols(self.symbols)
        vars(near)["positions"] = self._positions(carrier, beyond, self.rotations)
        return near

    def among(self, bodies: Sequence[str]) -> Scene:
        """The same in the axes of that link, for what has no other axes than those of the bodies:
        how the link is turned is no part of it, either."""
        return self.near(*[self.places[body].link for body in bodies])

    def near(self, *tips: int) -> Scene:
        """The same for what links carry, by their numbers."""
        carrier, beyond = nearest_carrier(self.links, *tips)
        if carrier < 0 or not beyond:
            return self
        rotations = rotations_on(self.links, carrier, beyond)
        near = replace(self, carrier=carrier, beyond=tuple(beyond))
        vars(near)["rotations"] = rotations
        vars(near)["positions"] = self._positions(carrier, beyond, rotations)
        return near

    def _positions(
        self, carrier: int, beyond: Sequence[int], rotations: Rotations
    ) -> dict[int, Vector]:
        """The origins of what lies beyond the carrier as seen from it."""
        found: dict[int, Vector] = {carrier: NOTHING}
        for i in beyond:
            link = self.links[i]
            above = (found[link.parent], rotations[link.parent])
            found[i] = origin_on(above, link, rotations[i])
        return found

    def rate(self, expression: ca.SX) -> ca.SX:
        """d/dt of a function of t and q: ∂/∂t + ∂/∂q N v. Raises AssumptionError for one of where
        a link is, by a symbol."""
        s = self.symbols
        if self.cut and ca.depends_on(expression, ca.vertcat(*self.cut)):
            raise AssumptionError("a force depends on how a length or a place changes")
        return ca.jtimes(expression, ca.vertcat(s.t, s.q), ca.vertcat(1, self.qdot))

    def speeding(self, expression: ca.SX) -> ca.SX:
        """d/dt of a function of t, q and v: the same and ∂/∂v v̇."""
        s = self.symbols
        return ca.jtimes(expression, ca.vertcat(s.t, s.q, s.v), ca.vertcat(1, self.qdot, s.vdot))

    def over_v(self, expression: ca.SX) -> ca.SX:
        """The same with q̇ replaced by N v: formulas of a file may speak of either, the System
        speaks of v alone."""
        return ca.substitute(expression, self.symbols.qd, self.qdot)


@dataclass(frozen=True)
class Block:
    """The rows of one constraint: names and units, φ where there is one (nonholonomic rows have
    none), and the velocity rows in every equivalent way of writing them."""

    rows: tuple[Row, ...]
    phi: tuple[ca.SX, ...]
    ways: tuple[tuple[RowForm, ...], ...]
    nonideal: tuple[ca.SX, ...] = ()  # generalised force per coordinate, conjugate to q̇
    # φ for whoever closes the loop from afar, where φ has solutions that are none of the joint's
    assembly: tuple[ca.SX, ...] = ()
    # what a step along the slopes of φ has to take away, where that is φ to first order alone
    whole: tuple[ca.SX, ...] = ()

    @property
    def closing(self) -> tuple[ca.SX, ...]:
        """φ as the loop is closed by."""
        return self.assembly or self.phi

    @property
    def excess(self) -> tuple[ca.SX, ...]:
        """φ as a step along its slopes takes it away."""
        return self.whole or self.phi


def _vector(column: ca.SX) -> Vector:
    return [*ca.vertsplit(column)]
