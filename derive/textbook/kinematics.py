"""Coordinates, generalized velocities, and the twists of the links."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import sympy

from derive.expressions.scalars import Scalar
from derive.joints.rotations import is_zero
from derive.mechanics.motion import STILL, Numbers, child_numbers
from derive.mechanics.records import System
from derive.mechanics.tree import twists
from derive.model.records import Coordinate, Velocity
from derive.textbook import names
from derive.textbook.manuscript import Manuscript
from derive.textbook.notation import Extra
from derive.textbook.records import Math, Runs, Text

AXES = "xyz"
MOST_LINKS = 12  # more links than this are not printed one by one


@dataclass(frozen=True, eq=False)
class Component(Extra):
    """A component of a link's twist that is not zero, over the generalized velocities."""

    link: int
    place: int  # 0–2 of ω, 3–5 of v


def components(system: System) -> list[Component]:
    """Of all links, base to tip; none for a long chain."""
    if len(system.links) > MOST_LINKS:
        return []
    result: list[Component] = []
    values = twists(system.links, [system.v[j] for j in range(system.v.numel())])
    for i, (omega, velocity) in enumerate(values):
        shown = [k for k, x in enumerate([*omega, *velocity]) if not is_zero(x)]
        result += [_component(system, i, k, ca.SX([*omega, *velocity][k])) for k in shown]
    return result


def _component(system: System, i: int, k: int, value: ca.SX) -> Component:
    """In the plane an angular velocity needs no axis."""
    link, planar = system.links[i].name, system.model.plane
    stem, axis = ("omega", AXES[k]) if k < 3 else ("v", AXES[k - 3])
    index = names.body(link) if planar and k < 3 else f"{names.body(link)},{axis}"
    name = f"{stem}[{link},{axis}]"
    letter = r"\omega" if k < 3 else "v"
    return Component(ca.SX.sym(name), sympy.Symbol(name), f"{letter}_{{{index}}}", value, i, k)


def components_of(doc: Manuscript) -> list[Component]:
    """Those that formulas of the manuscript may be written over."""
    return [x for x in doc.notation.extra if isinstance(x, Component)]


def numbers_in_symbols(system: System, twists: Sequence[Component]) -> list[Numbers]:
    """Every link's twist written with the components' symbols."""
    result: list[Numbers] = []
    for i in range(len(system.links)):
        entries: list[Scalar] = [0.0] * 6
        for x in twists:
            if x.link == i:
                entries[x.place] = x.sx
        result.append((entries[:3], entries[3:]))
    return result


def coordinates(doc: Manuscript) -> None:
    """Prints q, v and q̇ = N v, with units and the joint that each belongs to."""
    model = doc.system.model
    doc.section("Coordinates and generalized velocities")
    doc.say("The configuration is described by the coordinates $!q$:")
    _declared(doc, doc.q, model.coordinates)
    doc.say(
        "The motion is described by the generalized velocities $!v$, which are what joints add to "
        "the motion of the body that carries them; those of a planar or free joint are components "
        "in the axes of the moving body:"
    )
    _declared(doc, doc.v, model.velocities)
    for symbol, x in zip(doc.q, model.coordinates):
        doc.mean(doc.notation.latex[symbol], f"coordinate {x.name}", x.unit)
    for symbol, x in zip(doc.v, model.velocities):
        doc.mean(doc.notation.latex[symbol], f"generalized velocity {x.name}", x.unit)
    doc.mean(r"!q,\; !v", "coordinates, generalized velocities")
    _rates(doc)


def _declared(
    doc: Manuscript,
    symbols: Sequence[sympy.Symbol],
    declarations: Sequence[Coordinate] | Sequence[Velocity],
) -> None:
    """The table of coordinates, or of generalized velocities."""
    rows = [_row(doc.notation.latex[symbol], x) for symbol, x in zip(symbols, declarations)]
    doc.table(("symbol", "name", "unit", "belongs to"), rows)


def _row(latex: str, x: Coordinate | Velocity) -> tuple[Runs, ...]:
    return (Math(latex),), (Text(x.name),), (Text(names.unit(x.unit)),), (Text(x.owner or "–"),)


def _rates(doc: Manuscript) -> None:
    """N, unless it is the identity."""
    N = doc.system.N
    if _is_identity(N):
        doc.say(
            "Every generalized velocity is the rate of one coordinate, so $!!q=!v$ and $!N=!1$."
        )
        return
    doc.say(
        "The rates of the coordinates follow from the generalized velocities by $!!q=!N\\,!v$, with:"
    )
    doc.matrix("N", r"!N", "N", N)
    doc.mean(r"!N", "q̇ = N v")


def _is_identity(N: ca.SX) -> bool:
    return N.is_square() and bool((N - ca.SX.eye(N.size1())).is_zero())


def links(doc: Manuscript) -> None:
    """Angular and linear velocity of every link, at its origin and in its own axes, from those of
    the link before."""
    count, twists = len(doc.system.links), components_of(doc)
    if not count:
        return
    doc.section("Kinematics")
    if not twists:
        doc.say(
            f"The {count} links are too many to be listed; their twists follow from "
            "base to tip by recursion."
        )
        return
    doc.say(
        "Walking from base to tip, every link hands its motion on: the angular velocity of a link "
        "is that of its carrier plus the joint's, and the velocity of its origin follows through "
        "the joint point. In each link's own axes:"
    )
    _twists(doc, twists)
    if len(twists) < 6 * count:
        doc.say("Components that are not listed are zero.")
    doc.mean(
        r"\omega_{i},\; v_{i}",
        "angular velocity of link i and velocity of its origin, in its own axes",
        "rad/s, m/s",
    )


def _twists(doc: Manuscript, twists: Sequence[Component]) -> None:
    """Link by link, as far as they can be read."""
    system = doc.system
    known = numbers_in_symbols(system, twists)
    for i, link in enumerate(system.links):
        parent = known[link.parent] if link.parent >= 0 else STILL
        omega, velocity = child_numbers(link, parent, [system.v[j] for j in link.columns])
        if not _link(doc, [x for x in twists if x.link == i], [*omega, *velocity]):
            doc.say(
                "The twists of {name} and of what follows are too long to be read here.",
                name=link.name,
            )
            return


def _link(doc: Manuscript, mine: Sequence[Component], entries: Sequence[Scalar]) -> bool:
    """One link's components over those of its carrier. False where they cannot be printed."""
    shown = doc.read(ca.vertcat(*[entries[x.place] for x in mine])) if mine else []
    if shown:
        values = ca.vertcat(*[x.value for x in mine])
        doc.lines("twist", [x.symbol for x in mine], shown, values)
        doc.reader.name(values, [x.symbol for x in mine])
    return shown is not None
