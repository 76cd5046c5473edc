"""Coordinates, generalized velocities, twists of the links and the constraints: everything that has
no mass in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import sympy

from derive.joints.records import Scalar
from derive.joints.rotations import is_zero
from derive.mechanics.motion import STILL, Numbers, child_numbers
from derive.mechanics.records import System
from derive.mechanics.tree import twists
from derive.textbook import names
from derive.textbook.author import Author, Extra
from derive.textbook.records import Math, Text

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


def numbers_in_symbols(system: System, found: Sequence[Component]) -> list[Numbers]:
    """Every link's twist written with the components' symbols."""
    result: list[Numbers] = []
    for i in range(len(system.links)):
        entries: list[Scalar] = [0.0] * 6
        for x in found:
            if x.link == i:
                entries[x.place] = x.sx
        result.append((entries[:3], entries[3:]))
    return result


def coordinates(a: Author) -> None:
    """q, v and q̇ = N v."""
    system, model = a.system, a.system.model
    a.section("Coordinates and generalized velocities")
    a.say("The configuration is described by the coordinates $!q$:")
    a.table(
        ("symbol", "name", "unit", "belongs to"),
        [_row(a.names[s], c) for s, c in zip(a.q, model.coordinates)],
    )
    a.say(
        "The motion is described by the generalized velocities $!v$, which are what joints add to the motion of the body "
        "that carries them; those of a planar or free joint are components in the axes of the moving body:"
    )
    a.table(
        ("symbol", "name", "unit", "belongs to"),
        [_row(a.names[s], x) for s, x in zip(a.v, model.velocities)],
    )
    for s, c in (*zip(a.q, model.coordinates), *zip(a.v, model.velocities)):
        kind = "coordinate" if s in a.q else "generalized velocity"
        a.mean(a.names[s], f"{kind} {c.name}", c.unit)
    a.mean(r"!q,\; !v", "coordinates, generalized velocities")
    if _is_identity(system.N):
        a.say("Every generalized velocity is the rate of one coordinate, so $!!q=!v$ and $!N=!1$.")
        return
    a.say(
        "The rates of the coordinates follow from the generalized velocities by $!!q=!N\\,!v$, with"
    )
    a.matrix("N", r"!N", "N", system.N)
    a.mean(r"!N", "q̇ = N v")


def _is_identity(N: ca.SX) -> bool:
    return N.is_square() and bool((N - ca.SX.eye(N.size1())).is_zero())


def _row(latex: str, x) -> tuple:
    return (Math(latex),), (Text(x.name),), (Text(names.unit(x.unit)),), (Text(x.owner or "–"),)


def links(a: Author, found: Sequence[Component]) -> None:
    """Angular and linear velocity of every link, at its origin and in its own axes, from those of
    the link before."""
    system = a.system
    if not system.links:
        return
    a.section("Kinematics")
    if not found:
        a.say(
            f"The {len(system.links)} links are too many to be listed; their twists follow from base to tip by recursion."
        )
        return
    a.say(
        "Walking from base to tip, every link hands its motion on: the angular velocity of a link is that of its carrier "
        "plus the joint's, and the velocity of its origin follows through the joint point. In each link's own axes,"
    )
    known = numbers_in_symbols(system, found)
    for i, link in enumerate(system.links):
        parent = known[link.parent] if link.parent >= 0 else STILL
        by_recursion = child_numbers(link, parent, [system.v[j] for j in link.columns])
        if not _link(a, [x for x in found if x.link == i], [*by_recursion[0], *by_recursion[1]]):
            a.say(
                "The twists of {name} and of what follows are too long to be read here.",
                name=link.name,
            )
            break
    if len(found) < 6 * len(system.links):
        a.say("Components that are not listed are zero.")
    a.mean(
        r"\omega_{i},\; v_{i}",
        "angular velocity of link i and velocity of its origin, in its own axes",
        "rad/s, m/s",
    )


def _link(a: Author, mine: Sequence[Component], entries: Sequence[Scalar]) -> bool:
    """One link's components over those of its carrier. False where they cannot be printed."""
    shown = a.read(ca.vertcat(*[entries[x.place] for x in mine])) if mine else []
    if shown:
        values = ca.vertcat(*[x.value for x in mine])
        a.lines("twist", [x.symbol for x in mine], shown, values)
        a.reader.name(values, [x.symbol for x in mine])
    return shown is not None


def constraints(a: Author) -> None:
    """φ, A v = c and β."""
    system = a.system
    a.section("Constraints")
    if not system.rows:
        a.say("There are none: the generalized velocities are independent of each other.")
        return
    _positions(a)
    a.say("On the level of velocities the constraints are the rows of")
    a.state(r"!A\,!v", r"!c")
    a.mean(r"!A,\; !c", "constraint rows, A v = c")
    a.table(("row", "constraint", "kind"), [_named(i, row) for i, row in enumerate(system.rows)])
    a.say("with the coefficients")
    a.matrix("A", r"!A", "A", system.A)
    _moving(a)
    a.say(
        "Differentiating once more gives $!A\\,!!v=!\\beta$ with "
        "$!\\beta=!!c-!!A\\,!v$, a directional derivative along the motion:"
    )
    a.mean(r"!\beta", "A v̇ = β")
    if a.vector("beta", r"\beta", system.beta) and all(row == [0] for row in a.entries["beta"]):
        a.say("Here $!\\beta=!0$.")
    if a.has("E"):
        _combined(a)


def _combined(a: Author) -> None:
    """E, where rows that repeat others are kept."""
    a.say(
        "Some rows repeat others, and all are kept. With $!A=!L\\,!A_k$ and $!A_k$ independent rows, the pseudo-inverse "
        "$!E=!L^+$ makes independent rows of all; $!E\\,!A$, $!E\\,!c$ and $!E\\,!\\beta$ are what is meant by $!A$, $!c$ "
        "and $!\\beta$ in the following, and multipliers of these rows are those of all by $!E^T$."
    )
    a.matrix("E", r"!E", "E", a.named("E"))
    a.mean(r"!E", "independent combinations of the constraint rows")


def _positions(a: Author) -> None:
    system = a.system
    if not system.phi.numel():
        a.say("All constraints are nonholonomic: they tie velocities, not positions.")
        return
    a.say("The positions have to satisfy $!\\Phi(!q,t)=!0$ with")
    a.vector("phi", r"\Phi", system.phi)
    a.mean(r"!\Phi", "position constraints, Φ = 0")


def _named(i: int, row) -> tuple:
    kind = "holonomic, the rate of " if row.position >= 0 else "nonholonomic"
    of = (Math(rf"\Phi_{{{row.position + 1}}}"),) if row.position >= 0 else ()
    return (Text(str(i + 1)),), (Text(row.name),), (Text(kind), *of)


def _moving(a: Author) -> None:
    if a.system.c.is_zero():
        a.entries["c"] = [[sympy.Integer(0)]] * len(a.system.rows)
        a.say("No constraint moves by itself: $!c=!0$.")
        return
    a.say("Some of them move by themselves:")
    a.vector("c", "c", a.system.c)
