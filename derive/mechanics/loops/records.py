"""What a function as loops over links is made of: sweeps, visits of links, tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import casadi as ca

from derive.expressions.scalars import Matrix, Scalar, Vector


@dataclass(frozen=True)
class Joint:
    """What a visit reads of a link of one kind: symbols, and floats where all links of the kind
    have the same number.

    Its frame is turned by Rz(γ) Rx(α) Rz(β) against that of its parent, then by the joint: about z
    by the `angle`, or by the matrix `turned`, or not at all. Its origin is at `place` where the
    joint is at zero; each coordinate shifts it from there along one of the axes behind the first
    three turns, or not at all (−1 of `shifts`). Each velocity is along one of the `axes` of a twist
    in the frame, 0 … 2 angular, 3 … 5 linear. `push` is what acts on the link by itself, (n, f) in
    its frame, over symbols for R, row by row, and r in the ground, and ω and v in the frame.
    """

    axes: tuple[int, ...]
    q: tuple[ca.SX, ...]
    v: tuple[ca.SX, ...]
    rates: Vector  # q̇ of coordinates that shift nothing
    tau: Vector  # what acts along each velocity
    rotor: Vector
    angle: Scalar | None
    turned: Matrix | None
    shifts: tuple[int, ...]
    alpha: tuple[Scalar, Scalar]  # sine, cosine
    beta: tuple[Scalar, Scalar]
    gamma: tuple[Scalar, Scalar]
    place: Vector
    mass: Scalar
    moment: Vector
    tensor: Matrix
    push: tuple[ca.SX, Vector] | None = None


@dataclass(frozen=True)
class Read:
    """A number of the link at hand: `symbol` stands for the entry of the `argument` (x or u) that
    the index of that name leads to."""

    name: str
    symbol: ca.SX
    argument: str
    index: str


@dataclass(frozen=True)
class Visit:
    """What a sweep does at one link: entries of the link's row that it keeps, what it hands on
    along the tree, and entries of the result, by the name of the index that leads there."""

    kept: dict[int, Scalar]
    handed: Vector
    results: dict[str, Scalar] = field(default_factory=dict[str, Scalar])


@dataclass(frozen=True)
class Sweep:
    """A loop over the links. What a link receives is what its parent handed on where the sweep is
    `rising`, else the sum of what its children did; `start` is what the ground hands on. Of the
    entries that are handed on by structure, those that are zero at every link are left out."""

    title: str
    rising: bool
    received: ca.SX
    start: Vector
    visits: tuple[Visit, ...]  # by kind


@dataclass(frozen=True)
class Kind:
    """Links that share a formula. `constants` are symbols for the columns of the `table`."""

    about: str
    constants: ca.SX
    table: tuple[tuple[Scalar, ...], ...]


@dataclass(frozen=True)
class Recursion:
    """A function of a tree. By link, parents before children and a child directly after its parent
    where it can be: parent (−1 the ground), kind, row of the kind's table, and by name the
    `indices` of entries of arguments and results. Of a result that several links have in common
    each adds its part. `row` stands for that of the link at hand; it begins with sine and cosine of
    the angle."""

    parents: tuple[int, ...]
    kinds_of: tuple[int, ...]
    rows_of: tuple[int, ...]
    indices: Mapping[str, tuple[int, ...]]
    reads: tuple[Read, ...]
    kinds: tuple[Kind, ...]
    angles: tuple[
        Scalar | None, ...
    ]  # by kind, where its links turn: sine and cosine go before all
    sweeps: tuple[Sweep, ...]
    t: ca.SX
    row: ca.SX
    p: ca.SX
    factors: ca.SX  # what is the same at all links, of parameters: symbols …
    formulas: tuple[ca.SX, ...]  # … and what they stand for

    @property
    def has_several(self) -> bool:
        """Whether a joint has several velocities."""
        return "velocity1" in self.indices
