"""Coordinates, generalized velocities, and the twists of the links."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import sympy

from derive.expressions.scalars import Scalar
from derive.joints.rotations import is_zero
from derive.mechanics.records import Link, System
from derive.mechanics.recursions.motion import STILL, Numbers, child_numbers
from derive.mechanics.recursions.tree import path, twists
from derive.model.records import Coordinate, Model, Velocity
from derive.textbook import names
from derive.textbook.formulas.notation import Extra
from derive.textbook.manuscript import Manuscript
from derive.textbook.records import Math, Runs, Text

AXES = "xyz"
MOST_LINKS = 12  # more links than this are not printed one by one
MOST_COMPONENTS = 18  # of twists that are read with the text
MOST_ROWS = 14  # of the table of links


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
    body = dict(system.model.body_symbols).get(link) or names.body(link)
    index = body if planar and k < 3 else f"{body},{axis}"
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
    doc.say(
        "Bold letters are matrices and columns; the same letter with indices is an entry, its row "
        "before its column. The configuration is described by the coordinates $!q$:"
    )
    _declared(doc, doc.q, model.coordinates)
    doc.say("The motion is described by the generalized velocities $!v$" + _in_words(model))
    _declared(doc, doc.v, model.velocities)
    for symbol, x in zip(doc.q, model.coordinates):
        doc.mean(doc.notation.latex[symbol], "coordinate {name}", x.unit, name=x.name)
    for symbol, x in zip(doc.v, model.velocities):
        latex = doc.notation.latex[symbol]
        doc.mean(latex, "generalized velocity {name}", x.unit, name=x.name)
    doc.mean(r"!q,\; !v", "coordinates, generalized velocities")
    _rates(doc)


def _in_words(model: Model) -> str:
    """What generalized velocities are in this model."""
    text = ""
    if any(x.owner for x in model.velocities):
        text = ", which say how each joint moves the body that it carries"
    if any(x.owner and not x.rate_of for x in model.velocities):
        text += (
            ". Those of joints with several degrees of freedom are components of the velocity and "
            "the angular velocity in the axes of the body that moves"
        )
    return f"{text}:"


def _declared(
    doc: Manuscript,
    symbols: Sequence[sympy.Symbol],
    declarations: Sequence[Coordinate] | Sequence[Velocity],
) -> None:
    """The table of coordinates, or of generalized velocities."""
    rows = [_row(doc.notation.latex[symbol], x) for symbol, x in zip(symbols, declarations)]
    head = ("symbol", "name in the file", "unit", "joint")
    shown = len(head) if any(x.owner for x in declarations) else len(head) - 1
    doc.table(head[:shown], [row[:shown] for row in rows])


def _row(latex: str, x: Coordinate | Velocity) -> tuple[Runs, ...]:
    owner = Text(names.words(x.owner) if x.owner else "–")
    return (Math(latex),), (Text(x.name),), (Text(names.unit(x.unit)),), (owner,)


def _rates(doc: Manuscript) -> None:
    """N, unless it is the identity."""
    N = doc.system.N
    if _is_identity(N):
        doc.say(
            "Every generalized velocity is the rate of one coordinate, so $!!q=!v$ and $!N=!1$."
        )
        return
    doc.say(
        "The rates of the coordinates follow from the generalized velocities by "
        "$!!q=!N\\,!v$, with:"
    )
    doc.matrix("N", r"!N", "N", N)
    doc.mean(r"!N", "rates of the coordinates per generalized velocity, $!!q=!N\\,!v$")


def _is_identity(N: ca.SX) -> bool:
    return N.is_square() and bool((N - ca.SX.eye(N.size1())).is_zero())


def links(doc: Manuscript) -> None:
    """Angular and linear velocity of every link, at its origin and in its own axes, from those of
    the link before."""
    count, parts = len(doc.system.links), components_of(doc)
    if not count:
        return
    doc.section("Kinematics")
    doc.say(
        "A link is a body with the joint that carries it. From base to tip every link hands its "
        "motion on. The angular velocity $!\\omega_i$ of link $i$ is that of its carrier $p$ plus "
        "what the joint adds; the velocity $!v_i$ of its origin follows through the joint point, "
        "at $!a_i$ in the carrier and at $!b_i$ in the link. $!H^{\\omega}_i$ and $!H^{v}_i$ hold "
        "the directions in which the joint turns and shifts the link. Everything is written in "
        "each link's own axes; $!R_i$ turns these into the carrier's:"
    )
    recursion(doc)
    long = not parts or len(parts) > MOST_COMPONENTS
    doc.say("What each link takes over and adds:" if long else "One link after the other:")
    if long:
        _table(doc)
    doc.folding = long
    _twists(doc, parts)
    doc.folding = False
    if 0 < len(parts) < 6 * count:
        doc.say("Components that are not listed are zero.")
    doc.mean(
        r"\omega_{i},\; v_{i}",
        "angular velocity of link $i$ and velocity of its origin, in its own axes",
        "rad/s, m/s",
    )


def recursion(doc: Manuscript) -> None:
    """ω and v of a link over those of its carrier, checked for all links."""
    system = doc.system
    v = [system.v[j] for j in range(system.v.numel())]
    values = twists(system.links, v)
    angular: list[ca.SX] = []
    linear: list[ca.SX] = []
    for link, (omega, velocity) in zip(system.links, values):
        carrier = values[link.parent] if link.parent >= 0 else STILL
        w, u, turned, moved = handed_on(link, carrier, v)
        angular.append(column(omega) - turned - w)
        at_joint = moved + u
        linear.append(column(velocity) - at_joint + ca.cross(column(omega), column(link.b)))
    doc.law("turning", r"!\omega_i", r"!R_i^T!\omega_p + !H^{\omega}_i!v", ca.vertcat(*angular))
    right = r"!R_i^T\left(!v_p + !\omega_p\times !a_i\right) + !H^{v}_i!v - !\omega_i\times !b_i"
    doc.law("moving", r"!v_i", right, ca.vertcat(*linear))
    doc.mean(
        r"!R_{i},\; !a_{i},\; !b_{i}", "rotation of link $i$ to its carrier, joint point in both"
    )
    doc.mean(r"!H_{i}", "what the joint of link $i$ adds per generalized velocity")


def handed_on(
    link: Link, carrier: Numbers, v: Sequence[Scalar]
) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """H^ω v, H^v v, Rᵀ ω_p and Rᵀ (v_p + ω_p × a)."""
    R = ca.vertcat(*(ca.horzcat(*(ca.SX(x) for x in row)) for row in link.R))
    own = ca.SX.zeros(6)
    for direction, j in zip(link.motion, link.columns):
        own = own + column(direction) * ca.SX(v[j])
    omega, velocity = column(carrier[0]), column(carrier[1])
    point = velocity + ca.cross(omega, column(link.a))
    return own[:3], own[3:], ca.mtimes(R.T, omega), ca.mtimes(R.T, point)


def column(entries: Sequence[Scalar]) -> ca.SX:
    """Scalars as a column."""
    return ca.vertcat(*(ca.SX(x) for x in entries))


def _table(doc: Manuscript) -> None:
    """Who carries a link, what its joint adds, and where its mass goes."""
    links = doc.system.links
    rows: list[tuple[Runs, ...]] = []
    for i, link in enumerate(links):
        carrier = links[link.parent].name if link.parent >= 0 else "ground"
        own = [doc.notation.latex[doc.v[j]] for j in link.columns]
        moved = sorted(j for k in path(links, i) for j in links[k].columns)
        inertia = Text(f"rows and columns {_ranges(moved)}" if moved else "none")
        added = Math(r",\; ".join(own)) if own else Text("none")
        name, carrier = names.words(link.name), names.words(carrier)
        rows.append(((Text(name),), (Text(carrier),), (added,), (inertia,)))
    head = ("link", "carried by", "its joint adds", "its mass adds to the mass matrix in")
    doc.table(head, rows[:MOST_ROWS])
    if len(rows) > MOST_ROWS:
        doc.say(f"The other {len(rows) - MOST_ROWS} links go on in the same way.")


def _ranges(places: Sequence[int]) -> str:
    """1–3, 7."""
    parts: list[list[int]] = []
    for k in places:
        if parts and parts[-1][1] == k:
            parts[-1][1] = k + 1
        else:
            parts.append([k + 1, k + 1])
    return ", ".join(str(a) if a == b else f"{a}–{b}" for a, b in parts)


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
                name=names.words(link.name),
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
