"""What bodies touch, and with what: planes, surfaces by their formula, and round shapes."""

from __future__ import annotations

import casadi as ca
import sympy

from derive.expressions.evaluate import value
from derive.expressions.tree import Expression
from derive.model.constraint_records import Rolling
from derive.model.load_records import Contact
from derive.textbook.formulas.convert import Reader
from derive.textbook.formulas.layout import is_long, rounded
from derive.textbook.formulas.typeset import Typesetter
from derive.textbook.given.sentences import AXES, called, measured, point
from derive.textbook.manuscript import Manuscript
from derive.textbook.prose import runs
from derive.textbook.records import Math, Runs

Touching = Rolling | Contact


def touched(doc: Manuscript, x: Touching) -> Runs:
    """The plane or surface; in a planar model a line or curve."""
    if x.surface is not None:
        return surface(doc, x.surface, x.carrier)
    return runs(
        ("the line" if doc.system.model.plane else "the plane")
        + " of {carrier} through {origin}, normal to {normal}",
        carrier=called(x.carrier),
        origin=point(doc, x.origin, x.name),
        normal=point(doc, x.normal, x.name),
    )


def surface(doc: Manuscript, formula: Expression, carrier: str) -> Runs:
    """The formula over the letters of its own that are coordinates in the frame of the carrier."""
    letters = doc.system.model.plane or AXES
    return runs(
        ("the curve" if doc.system.model.plane else "the surface")
        + " {formula} of {carrier}, with {letters} along its axes",
        formula=Math(f"{_over_letters(doc, formula, letters)} = 0"),
        carrier=called(carrier),
        letters=Math(r",\; ".join(letters)),
    )


def _over_letters(doc: Manuscript, formula: Expression, letters: str) -> str:
    """The letters shadow whatever the model calls x, y or z, so they are read apart from it."""
    s, notation = doc.system.symbols, doc.notation
    own = ca.vertcat(*[ca.SX.sym(letter) for letter in letters])
    shown = {sympy.Symbol(f"at[{letter}]"): letter for letter in letters}
    names = s.names | dict(zip(letters, ca.vertsplit(own)))
    reader = Reader(
        ca.vertcat(s.t, s.p, own),
        [notation.t, *notation.p, *shown],
        bool(doc.system.constants) and not notation.p,
    )
    read = reader.whole(ca.SX(value(formula, names, s.rates, s.functions)))
    if read is None:
        return r"\ldots"
    doc.rounded = doc.rounded or is_long(read[0])
    return Typesetter(notation.latex | shown, len(notation.p)).latex(rounded(read[0]))


def shape(doc: Manuscript, x: Touching, tube: Expression | None = None) -> Runs:
    """What of the body touches; a wheel and a knife edge are thin disks."""
    return runs(
        _shape(doc, x),
        body=called(x.body),
        centre=point(doc, x.centre, x.name),
        radius=measured(doc, x.radius, x.name, "m"),
        axis=point(doc, x.axis, x.name),
        tube="" if tube is None else measured(doc, tube, x.name, "m"),
    )


def _shape(doc: Manuscript, x: Touching) -> str:
    if x.shape == "point":
        return "the point of {body} at {centre}"
    if x.shape == "sphere":
        return "a sphere of {body} about {centre}, of radius {radius},"
    if doc.system.model.plane:
        return "a circle of {body} about {centre}, of radius {radius},"
    if x.shape == "torus":
        return (
            "a torus of {body} about {centre}, a tube of radius {tube} round a circle of radius "
            "{radius} with the axis {axis},"
        )
    return "a thin disk of {body} about {centre}, of radius {radius} and with the axis {axis},"
