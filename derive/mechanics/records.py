"""The System record: the mechanics of a model as named CasADi terms, before any choice of
quasi-velocities.

q̇ = N(q) v,  M v̇ + h = Q + Aᵀ λ,  φ(q, t) = 0,  A v = c,  A v̇ = β. Symbols are plain SX columns,
never functions of time. Parameters that were made constants are numbers already.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import casadi as ca

from derive.expressions.deferred import Term
from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.records import Rotation
from derive.mechanics.limits import LONG
from derive.mechanics.symbols import Symbols
from derive.model.records import FirstOrderState, Model, Parameter

if TYPE_CHECKING:
    from derive.mechanics.inverse.layouts import Layout

Numbers = tuple[Vector, Vector]  # a twist (ω, v)


@dataclass(frozen=True)
class Named:
    """An intermediate worth reading: the textbook prints it, the generated code names its section
    after it."""

    name: str  # as in design section 7: "A", "M", "beta" …
    about: str
    value: Term[ca.SX] = Term()


@dataclass(frozen=True)
class Row:
    """One scalar constraint. `position` is its index in φ, or −1 for a nonholonomic row; `unit` is
    that of A v."""

    name: str
    position: int
    unit: str


@dataclass(frozen=True)
class Inertia:
    """Of a link about its frame's origin, in its frame: mass, first moment m·c, and the 3 × 3
    tensor about the origin."""

    mass: Scalar
    moment: Vector
    tensor: Matrix


@dataclass(frozen=True)
class Link:
    """A body, with everything fixed to it, as the recursions see it: in its own frame, twist taken
    at its origin.

    `rotation`: parent ← link; `a`: the joint point in the parent's frame; `b`: the same point in
    the link's frame; `motion`: per joint velocity the relative (ω, v) at the joint point in the
    link's frame; `columns`: their indices in v. `turns_about`: 0, 1 or 2 where the joint is one
    turn about that axis of the link's frame, else −1.
    """

    name: str
    parent: int  # index of the parent link, −1 for the ground
    rotation: Rotation
    R: Matrix
    a: Vector
    b: Vector
    motion: tuple[Vector, ...]
    columns: tuple[int, ...]
    turns_about: int
    inertia: Inertia


@dataclass(frozen=True)
class Place:
    """A body as part of a link: body frame in the link's frame."""

    link: int
    rotation: Rotation
    position: Vector


@dataclass(frozen=True)
class TwistTerm:
    """direction · (v + ω × point) + moment · ω of a link, all in its frame.

    `fixed` says what directions are fixed to while the row is differentiated: "body" (constant in
    the link's frame), "ground" (they turn against the link), or "state" (the rates of direction,
    point and moment are given, in q and v).
    """

    link: int
    direction: Vector
    point: Vector
    moment: Vector
    fixed: str = "body"
    direction_rate: Vector = field(default_factory=list[Scalar])
    point_rate: Vector = field(default_factory=list[Scalar])
    moment_rate: Vector = field(default_factory=list[Scalar])


@dataclass(frozen=True)
class Rod:
    """Of a row along the line between two points: how long it is, where it points, in ground axes,
    and for each twist term, +1 at its end and −1 at its beginning, ground ← link."""

    length: Scalar
    direction: Vector
    ends: tuple[tuple[float, Matrix], ...]


@dataclass(frozen=True)
class RowForm:
    """A velocity row as the elimination reads it: Σ twist terms + Σ coefficients[j] v_j = value,
    and its derivative.

    For the derivative, the v-part and the value contribute `rate` = d(value)/dt −
    d(coefficients)/dt v, in (t, q, v).
    """

    name: str
    terms: tuple[TwistTerm, ...]
    coefficients: tuple[tuple[int, Scalar], ...] = ()
    value: Scalar = 0.0
    rate: Scalar = 0.0
    rod: Rod | None = None  # whose line turns as its ends move


@dataclass(frozen=True)
class Spinless:
    """A frame that takes no part in the last turn of a free joint, about e_k: its link, and where
    in the velocities ω·e_a, the frame's own ω·e_k and the body's Ω = ω·e_k stand. `along` and
    `about` are f·e_a and f·e_k of the axis f of the first turn."""

    link: int
    axis: int
    beside: int
    column: int
    spin: int
    along: Scalar
    about: Scalar

    def rate(self, beside: Scalar) -> Scalar:
        """ω·e_k of the frame, from ω·e_a."""
        return self.about * (beside / self.along)

    def still(self, v: Sequence[Scalar]) -> Vector:
        """The velocities of a frame that does not turn about e_k: the body's rate in it is Ω."""
        return [0.0 if j == self.column else x for j, x in enumerate(v)]

    def relative(self, v: Sequence[Scalar]) -> Vector:
        """With the body's rate in the frame, θ̇₃ = Ω − ω·e_k, in the place of Ω."""
        return [x - v[self.column] if j == self.spin else x for j, x in enumerate(v)]

    def turning(self, twists: Sequence[Numbers], v: Sequence[Scalar]) -> list[Numbers]:
        """Twists (ω, v) of links with the frame's own ω·e_k."""
        omega, velocity = twists[self.link]
        own = [v[self.column] if i == self.axis else x for i, x in enumerate(omega)]
        return [(own, velocity) if i == self.link else x for i, x in enumerate(twists)]


@dataclass(frozen=True)
class Carried:
    """The links of a system with a further frame, over velocities v' of their own. `blocks` are the
    constraint rows in every way of writing them; `speeds` is v and `qdot` q̇, over v'. `body` is the
    link whose twist, in the axes `turned` (body's own ← link), the velocities `columns` of the
    system are."""

    t: ca.SX
    q: ca.SX
    p: ca.SX
    v: ca.SX
    labels: tuple[str, ...]
    links: tuple[Link, ...]
    inertias: tuple[tuple[Inertia, ...], ...]
    blocks: tuple[tuple[tuple[RowForm, ...], ...], ...]
    gravity: Vector
    speeds: ca.SX
    qdot: ca.SX
    frame: Spinless
    body: int
    turned: Matrix
    columns: tuple[int, ...]


@dataclass(frozen=True)
class Pushed:
    """Q in two parts: `force` (nv) of what depends on the joints' own coordinates, and by link
    (n, f) about its origin, along its axes, over its own `poses` (R row by row, r, ω, v) and
    t, u, p."""

    force: ca.SX
    couples: Mapping[int, tuple[Vector, Vector]]
    poses: tuple[ca.SX, ...]


@dataclass(frozen=True)
class System:
    """See the module's first lines; `blocks` are the constraint rows grouped, each in several
    equivalent ways of writing."""

    model: Model
    symbols: Symbols
    constants: tuple[str, ...]  # parameters that are numbers here
    t: ca.SX
    q: ca.SX
    v: ca.SX
    u: ca.SX
    p: ca.SX  # the remaining parameters, and behind them z: mechanics takes both as given
    parameters: tuple[float, ...]  # their defaults, and initial values of z
    qdot: ca.SX  # N v
    N: ca.SX
    M: ca.SX  # all zeros where not `written`
    Q: ca.SX  # everything applied: springs, dampers, inputs, forces, nonideal constraint forces
    phi: ca.SX
    assembly: ca.SX  # φ by which loops are closed: zero with φ, and only where joints are as given
    # φ to first order: a step δ over v with φ_q N δ = −excess takes all of a turn away, where a
    # joint does not let bodies turn
    excess: ca.SX
    A: ca.SX
    c: ca.SX
    beta: ca.SX
    homogeneous: bool  # T is T₂ alone, and energy = T + V
    outputs: tuple[tuple[str, ca.SX, str], ...]  # name, value, unit
    events: tuple[tuple[str, ca.SX], ...]  # name, value
    rows: tuple[Row, ...]
    links: tuple[Link, ...]
    places: tuple[tuple[str, Place], ...]  # body name → where it is
    blocks: tuple[tuple[tuple[RowForm, ...], ...], ...]
    # M is written out; on long chains it is not, its entries grow with the square of the length
    written: bool
    definite: bool  # M is positive definite at the nominal values
    quaternions: tuple[int, ...]  # where in q a unit quaternion (w, x, y, z) starts
    M_extra: ca.SX  # nv × nv, of the kinetic energy that is not in the links
    M_given: ca.SX  # of that, what the file's formula gives; the rest is rotors
    h_extra: ca.SX
    gravity: Vector
    names: tuple[Named, ...]
    assumptions: tuple[str, ...]
    z: ca.SX  # first-order states
    zdot: ca.SX  # their rates, of t, q, v, u, p and z
    h: Term[ca.SX] = Term()  # velocity products, gravity and `potential`
    T: Term[ca.SX] = Term()
    V: Term[ca.SX] = Term()
    # what the motion balances: T + V or, where T = T₂ + T₁ + T₀ has terms linear in the rates or
    # free of them, Jacobi's integral T₂ − T₀ + V
    energy: Term[ca.SX] = Term()
    # of what is in Q and not −∂V/∂q, ∂(V − T)/∂t of formulas, ∂(V + T)/∂t of bodies that lose mass:
    # d(energy)/dt = power + λᵀ c
    power: Term[ca.SX] = Term()
    # the same with further frames, for rows that are short there (derive.mechanics.carriers)
    carried: Term[tuple[Carried, ...]] = Term()
    # equivalent sets: as given, and regrouped across the joints
    inertias: Term[tuple[tuple[Inertia, ...], ...]] = Term()
    layouts: Term[tuple[Layout, ...]] = Term()  # of the links, for their inverse dynamics
    # what acts, link by link; raises AssumptionError where it is not by link
    pushed: Callable[[], Pushed] | None = None

    @property
    def labels(self) -> tuple[str, ...]:
        """The names of v."""
        return tuple(x.name for x in self.model.velocities)

    @property
    def long(self) -> bool:
        """A tree of so many links that what grows with them is made on demand alone."""
        return len(self.links) >= LONG and not self.rows and not self.written

    @property
    def given(self) -> tuple[Parameter | FirstOrderState, ...]:
        """What stands in p."""
        free = (x for x in self.model.parameters if x.name not in self.constants)
        return (*free, *self.model.states)

    @property
    def own_p(self) -> ca.SX:
        """p without the states."""
        return self.p[: len(self.own_parameters), 0]  # 0 × 1 of none

    @property
    def own_parameters(self) -> tuple[float, ...]:
        """The defaults without the states."""
        return self.parameters[: len(self.parameters) - self.z.numel()]
