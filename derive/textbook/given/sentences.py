"""What sentences about a model share: names of bodies, points, directions, values with their unit.

A kind without a sentence of its own is listed field by field.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields
from typing import Any, cast

import casadi as ca
from sympy import Symbol

from derive.expressions.tree import ONE, ZERO, Expression
from derive.model.algebra import dot, negated
from derive.model.records import GROUND, Input, Placement, Vector3
from derive.textbook import names
from derive.textbook.manuscript import Manuscript
from derive.textbook.names import words
from derive.textbook.prose import runs
from derive.textbook.records import Math, Run, Runs, Text

AXES = "xyz"
UNREADABLE = Math(r"\ldots")  # of a formula that is too long
NAMES = ("body", "bodies", "velocity", "coordinate", "frame_body")  # fields that name something
# fields of what has points; a moment is that of a wrench, whose frame has one
PLACES = ("point", "points", "placements", "centre", "path", "moment")
UNSAID = ("surface",)  # formulas over letters of their own


def kind(x: object) -> str:
    """NoSlip → no slip."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(x).__name__).lower()


def whose(declared: Iterable[Any], what: str) -> str:
    """In which axes points, and what else, of these are given; nothing where they have none."""
    placed = any(field.name in PLACES for x in declared for field in fields(x))
    return f"; points (in m){what} are given in the axes of their body" if placed else ""


def called(body: str) -> str:
    """A body by its name."""
    return "the ground" if body == GROUND else words(body)


def point(doc: Manuscript, entries: Sequence[Expression], about: str) -> Math:
    """Components in the plane, or all three."""
    return vector(doc, in_plane(doc, entries), about)


def in_plane(doc: Manuscript, entries: Sequence[Expression]) -> list[Expression]:
    """The components along the axes of the model."""
    axes = doc.system.model.plane or AXES
    return [entries[AXES.index(axis)] for axis in axes]


def vector(doc: Manuscript, entries: Sequence[Expression], about: str) -> Math:
    """(a, b, c)."""
    return Math("(" + r",\; ".join(doc.formula(x, about).latex for x in entries) + ")")


def place(doc: Manuscript, at: Placement) -> Math:
    """Where a joint or closure sits in a body."""
    return point(doc, at.position, "joint point")


def direction(doc: Manuscript, along: Vector3, at: Placement, about: str) -> Math:
    """An axis that is given in the frame of a joint, in the axes of the body that has the frame."""
    if at.rotation is None:
        return point(doc, along, about)
    a, b, c = at.rotation
    return point(doc, (dot(a, along), dot(b, along), dot(c, along)), about)


def measured(doc: Manuscript, x: Expression, about: str, unit: str) -> Math:
    """A formula, and the unit of one that is a number: symbols have theirs in their tables."""
    formula = doc.formula(x, about)
    return Math(formula.latex + _unit(unit)) if _is_number(doc, x) else formula


def measured_point(doc: Manuscript, entries: Sequence[Expression], about: str, unit: str) -> Math:
    """Components, and their unit where all are numbers."""
    return measured_vector(doc, in_plane(doc, entries), about, unit)


def measured_vector(doc: Manuscript, entries: Sequence[Expression], about: str, unit: str) -> Math:
    """The same of components that are all to be shown; one alone has no brackets."""
    if len(entries) == 1:
        return measured(doc, entries[0], about, unit)
    shown = vector(doc, entries, about)
    numbers = all(_is_number(doc, x) for x in entries)
    return Math(shown.latex + _unit(unit)) if numbers else shown


def _is_number(doc: Manuscript, x: Expression) -> bool:
    """Parameters may be numbers in all formulas."""
    return ca.SX(doc.system.symbols.scalar(x)).is_constant()


def _unit(text: str) -> str:
    """N*m/rad → N m/rad in upright letters, with the space before it."""
    spaced = text.replace("*", r"\,")
    return rf"\;\mathrm{{{spaced}}}" if text else ""


def about_normal(doc: Manuscript, entries: Vector3) -> list[Expression]:
    """Components of a moment or turn: one in a plane, in the sense in which angles grow."""
    plane = doc.system.model.plane
    if not plane:
        return list(entries)
    k = next(k for k in range(3) if AXES[k] not in plane)
    return [negated(entries[k]) if plane == "xz" else entries[k]]


def is_nothing(entries: Sequence[Expression]) -> bool:
    """Whether the file gives none of these."""
    return all(x == ZERO for x in entries)


def driven(doc: Manuscript, x: Input) -> Runs:
    """What an input acts along, with its gear where it has one."""
    unit = names.unit(x.unit)
    told = "" if unit == "–" else f" in {unit}"
    where = "acts along {velocity}" if x.velocity else "occurs in the formulas"
    text = list(runs(f"input{told}, {where}", velocity=velocity(doc, x.velocity)))
    if x.gear != ONE:
        text += [Text(", times "), doc.formula(x.gear, x.name)]
    if x.about:
        text.append(Text(f": {x.about}"))
    return tuple(text)


def velocity(doc: Manuscript, name: str) -> Math | str:
    """A generalized velocity by its symbol, or the rate of a coordinate that is none."""
    model = doc.system.model
    if name in model.other_rates:
        symbol = doc.q[model.coordinate_index(model.other_rates[name].rate_of)]
        return Math(names.dotted(doc.notation.latex[symbol]))
    return _symbol(doc, name, doc.v, model.velocity_index)


def coordinate(doc: Manuscript, name: str) -> Math | str:
    """A coordinate by its symbol."""
    return _symbol(doc, name, doc.q, doc.system.model.coordinate_index)


def _symbol(
    doc: Manuscript, name: str, symbols: Sequence[Symbol], place: Callable[[str], int]
) -> Math | str:
    """What the formulas write for it; the name itself where they have no symbol."""
    try:
        return Math(doc.notation.latex[symbols[place(name)]])
    except ValueError:
        return name


def joined(parts: Sequence[Runs], between: str = "; ") -> Runs:
    """Parts of a sentence, those that are there."""
    text: list[Run] = []
    for part in filter(None, parts):
        text += [Text(between)] if text else []
        text += part
    return tuple(text)


def listed(doc: Manuscript, x: Any) -> Runs:
    """Any other declaration: what it names, then every formula in it that is a quantity."""
    return joined([_field(doc, field.name, getattr(x, field.name)) for field in fields(x)])


def _field(doc: Manuscript, name: str, value: Any) -> Runs:
    """One field of a declaration; nothing where it is neither a name nor a quantity."""
    label = name.replace("_", " ")
    if name in NAMES:
        return (Text(words(value if isinstance(value, str) else ", ".join(value))),)
    if name in UNSAID:
        return ()
    if isinstance(value, Expression):
        return Text(f"{label} "), doc.formula(value, label)
    if _is_vector(value):
        return Text(f"{label} "), vector(doc, value, label)
    return ()


def _is_vector(value: object) -> bool:
    if not isinstance(value, tuple):
        return False
    entries = cast(tuple[object, ...], value)
    return len(entries) == 3 and all(isinstance(x, Expression) for x in entries)
