"""The System record: the mechanics of a model as named CasADi terms, before any choice of quasi-velocities.

q̇ = N(q) v,  M v̇ + h = Q + Aᵀ λ,  φ(q, t) = 0,  A v = c,  A v̇ = β.
Symbols are plain SX columns, never functions of time. Parameters that were made constants are numbers already.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from derive.model.records import Model


@dataclass(frozen=True)
class Named:
    """An intermediate worth reading: the textbook prints it, the generated code names its section after it."""

    name: str  # as in design section 7: "A", "M", "beta" …
    about: str
    value: ca.SX


@dataclass(frozen=True)
class Row:
    """One scalar constraint. `position` is its index in φ, or −1 for a nonholonomic row."""

    name: str
    position: int
    unit: str


@dataclass(frozen=True)
class Link:
    """A body as the recursions see it, in its own frame (origin at the model's body origin).

    parent is an index into the links, −1 for the ground. R: parent ← body rotation; r: the body's origin in the parent frame;
    H: 6 × k columns, the relative twist (ω, v at the body's origin, body frame) is H v[columns]; H_rate: Ḣ v, 6. mass, com (3) and inertia (3 × 3, about com) in the body frame.
    """

    name: str
    parent: int
    R: ca.SX
    r: ca.SX
    H: ca.SX
    H_rate: ca.SX
    columns: tuple[int, ...]
    mass: ca.SX
    com: ca.SX
    inertia: ca.SX
    force: ca.SX  # applied force and moment about the origin, body frame: (n, f), 6; gravity not included


@dataclass(frozen=True)
class TwistTerm:
    """coefficients (1 × 6) · twist of a link, in that link's frame; `rate` is d(coefficients)/dt."""

    link: int
    coefficients: ca.SX
    rate: ca.SX


@dataclass(frozen=True)
class RowForm:
    """A velocity row as the elimination reads it: Σ twist terms + coefficients · v = value; its rate is Σ … = rate.

    Where `terms` is empty the row is `coefficients` alone. `combination` are the weights of the rows of A it is made of.
    """

    terms: tuple[TwistTerm, ...]
    coefficients: ca.SX  # 1 × nv
    coefficients_rate: ca.SX  # 1 × nv, d/dt
    value: ca.SX
    value_rate: ca.SX


@dataclass(frozen=True)
class System:
    model: Model
    constants: tuple[str, ...]  # parameters that are numbers here
    t: ca.SX
    q: ca.SX
    v: ca.SX
    u: ca.SX
    p: ca.SX  # the remaining parameters
    qdot: ca.SX  # N v
    N: ca.SX
    M: ca.SX
    h: ca.SX
    Q: ca.SX
    phi: ca.SX
    A: ca.SX
    c: ca.SX
    beta: ca.SX
    T: ca.SX
    V: ca.SX
    power: ca.SX  # of all forces that are not −∂V/∂q: d(T + V)/dt = power + λᵀ c
    outputs: tuple[tuple[str, ca.SX], ...]
    rows: tuple[Row, ...]
    links: tuple[Link, ...]
    forms: tuple[tuple[RowForm, ...], ...]  # equivalent ways to write the constraint rows, block by block
    M_extra: ca.SX  # what the links do not carry (analytic kinetic energy), nv × nv
    h_extra: ca.SX
    Q_extra: ca.SX
    gravity: ca.SX
    names: tuple[Named, ...]
    assumptions: tuple[str, ...]
