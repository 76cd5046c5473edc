"""What a formulation found, and the arguments of the functions that are made of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import casadi as ca

from derive.choices.records import Frame, Guard
from derive.expressions.deferred import Term
from derive.expressions.scalars import Scalar, Vector
from derive.formulations.records import Argument
from derive.mechanics.records import Named, System


@dataclass(frozen=True)
class Minimal:
    """v = S w + R c, v̇ = S ẇ + σ and what is left of the equations, mass ẇ = force: mass = Sᵀ M S,
    force = Sᵀ (Q − h − M σ). A, c, β and λ are of the independent rows."""

    S: ca.SX
    sigma: ca.SX
    A: ca.SX
    c: ca.SX
    beta: ca.SX
    lam: ca.SX
    R: Term[ca.SX] = Term()
    mass: Term[ca.SX] = Term()
    force: Term[ca.SX] = Term()
    shift: Term[ca.SX | None] = Term()
    solve: Callable[[Vector], Vector] | None = None
    nearest: Callable[[Sequence[Scalar]], Vector] | None = None  # least δ of A δ, in the metric M


@dataclass(frozen=True)
class Motion:
    """What a formulation found, over (t, q, w, u, p)."""

    w: ca.SX
    names: tuple[str, ...]
    units: tuple[str, ...]
    B: ca.SX
    v: ca.SX
    qdot: ca.SX
    lam: ca.SX
    guards: tuple[Guard, ...]  # of v
    solving: tuple[Guard, ...]  # of ẇ and λ beyond those
    named: tuple[Named, ...]
    kept: tuple[int, ...]  # independent constraint rows
    closing: tuple[int, ...]  # independent rows among the holonomic ones
    projects_velocity: bool
    wdot: Term[ca.SX] = Term()
    vdot: Term[ca.SX] = Term()
    frame: Frame | None = None
    minimal: Minimal | None = None  # none where w are all of v, held by forces


def arguments(system: System, motion: Motion) -> tuple[Argument, ...]:
    """The slots t (s), x = (q, w, z), u and p with labels and SI units. A frame of directions,
    where the choice has one, stands behind the model's own parameters."""
    model = system.model
    free = system.given[: len(system.own_parameters)]
    return (
        Argument("t", system.t, ("t",), ("s",)),
        Argument(
            "x",
            ca.vertcat(system.q, motion.w, system.z),
            labels_of_state(system, motion),
            units_of_state(system, motion),
        ),
        Argument(
            "u", system.u, tuple(i.name for i in model.inputs), tuple(i.unit for i in model.inputs)
        ),
        with_frame(
            Argument(
                "p",
                system.p[: len(free), 0],
                tuple(x.name for x in free),
                tuple(x.unit for x in free),
            ),
            motion.frame,
        ),
    )


def labels_of_state(system: System, motion: Motion) -> tuple[str, ...]:
    """Names of the entries of x = (q, w, z)."""
    model = system.model
    own = (*(c.name for c in model.coordinates), *motion.names)
    return (*own, *(x.name for x in model.states))


def units_of_state(system: System, motion: Motion) -> tuple[str, ...]:
    """SI units of the entries of x = (q, w, z)."""
    model = system.model
    own = (*(c.unit for c in model.coordinates), *motion.units)
    return (*own, *(x.unit for x in model.states))


def with_frame(p: Argument, frame: Frame | None) -> Argument:
    """The parameters with the frame behind them."""
    if frame is None:
        return p
    return replace(
        p,
        symbols=ca.vertcat(p.symbols, frame.symbols),
        labels=(*p.labels, *frame.labels),
        units=(*p.units, *("" for _ in frame.labels)),
    )


def at_motion(system: System, motion: Motion, expression: ca.SX) -> ca.SX:
    """An expression of v over w, v = S w + R c."""
    return ca.substitute(expression, system.v, motion.v)


def is_unit(S: ca.SX) -> bool:
    """Exactly the unit matrix."""
    return S.is_square() and bool((S - ca.SX.eye(S.size1())).is_zero())


def per_second(unit: str) -> str:
    """The unit of a rate: m/s of m, m/s^2 of m/s."""
    if unit.endswith("/s"):
        return f"{unit}^2"
    return f"{unit}/s" if unit and unit != "1" else "1/s"


def guards_of(motion: Motion, expression: ca.SX, system: System) -> tuple[Guard, ...]:
    """The guards matter where v does, because v = S w + R c needs the pivots."""
    return motion.guards if ca.depends_on(expression, system.v) else ()
