"""What the model file says: parameters, bodies, joints, closures, constraints, loads, inputs."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import casadi as ca
import sympy

from derive.model.records import Body, Closure, Constraint, Input, Load, Parameter
from derive.textbook import names
from derive.textbook.given.closures import closure
from derive.textbook.given.constraints import constraint
from derive.textbook.given.events import events
from derive.textbook.given.frames import of_loads, of_pairs, turned
from derive.textbook.given.joints import joints
from derive.textbook.given.loads import laws, load
from derive.textbook.given.sentences import driven, kind, point, whose
from derive.textbook.manuscript import Manuscript
from derive.textbook.records import Math, Run, Runs, Text

AXIS_OF = {"xy": 2, "xz": 1, "yz": 0}  # plane → the place of its normal
PRINCIPAL = 3  # moments of inertia that are always shown
ANGLES = ("", "rad")  # units of numbers that may be shares of π
FINEST = 24  # the largest denominator of such a share: 7.5 degrees
MOMENTS = ("xx", "yy", "zz", "xy", "xz", "yz")


def given(doc: Manuscript) -> None:
    """The section, one table per kind of thing that is there."""
    doc.section("Given")
    description = doc.system.model.description
    if description:
        doc.say("{text}", text=description)
    _scene(doc)
    _parameters(doc)
    _bodies(doc)
    _energies(doc)
    _tied(doc)
    _driven(doc)
    events(doc)
    if doc.rounded:
        doc.say(
            "Numbers of these tables, but for the values of parameters, are rounded to six digits; "
            "the formulas have them all."
        )


def _scene(doc: Manuscript) -> None:
    model = doc.system.model
    if model.bodies and model.plane:
        doc.say(f"The mechanism moves in the {model.plane[0]}, {model.plane[1]} plane.")
    elif model.bodies:
        doc.say("The mechanism moves in space.")
    if model.gravity is not None:
        _gravity(doc)


def _gravity(doc: Manuscript) -> None:
    """The vector, and its magnitude g where that is a number."""
    assert doc.system.model.gravity is not None
    vector, g = doc.system.model.gravity, doc.notation.g
    if g is None:
        doc.say("Gravity is {g} m/s².", g=_equal(r"!g", point(doc, vector, "gravity")))
        doc.mean(r"!g", "gravity", "m/s^2")
        return
    doc.say("The magnitude of gravity is, in m/s²:")
    doc.lines("g", [g.symbol], [sympy.Float(repr(g.value), 15)], ca.SX(g.value))
    doc.say("As a vector it is {g}.", g=_equal(r"!g", point(doc, vector, "gravity")))
    doc.mean(r"!g,\; g", "gravity, its magnitude", "m/s^2")


def _equal(left: str, right: Math) -> Math:
    """left = right, in the short hand of names.bold."""
    return Math(f"{names.bold(left)} = {right.latex}")


def _parameters(doc: Manuscript) -> None:
    parameters, constants = doc.system.model.parameters, doc.system.constants
    if not parameters:
        return
    numbers = constants and not doc.notation.p
    doc.say(
        "The parameters and their values are"
        + (" (numbers in all formulas below):" if numbers else ":")
    )
    head = ("symbol", "value", "unit", *(["meaning"] if any(x.about for x in parameters) else []))
    doc.listing(head, parameters, lambda x: _parameter(doc, x)[: len(head)])
    free = [x for x in parameters if x.name not in constants]
    for x, symbol in zip(free, doc.notation.p):
        about = x.about or f"parameter {x.name}"
        doc.mean(doc.notation.latex[symbol], "{about}", x.unit, about=about)


def _parameter(doc: Manuscript, x: Parameter) -> tuple[Runs, ...]:
    return (
        (Math(doc.notation.typeset(x.name)),),
        (_value(x),),
        (Text(names.unit(x.unit)),),
        (Text(x.about),),
    )


def _value(x: Parameter) -> Run:
    """The number; a simple share of π for an angle that is one."""
    share = Fraction(x.value / math.pi).limit_denominator(FINEST)
    if x.unit not in ANGLES or not share or float(share) * math.pi != x.value:
        return _decimal(x.value)
    times = "" if share.numerator in (1, -1) else f"{abs(share.numerator)}\\,"
    under = "" if share.denominator == 1 else f"/{share.denominator}"
    return Math(f"{'-' if share < 0 else ''}{times}\\pi{under}")


def _decimal(x: float) -> Run:
    """All its digits; a very large or small one with a power of ten."""
    mantissa, _, exponent = f"{x:.15g}".partition("e")
    if not exponent:
        return Text(mantissa.replace("-", "−"))
    return Math(rf"{mantissa} \cdot 10^{{{int(exponent)}}}")


def _bodies(doc: Manuscript) -> None:
    """Bodies and joints."""
    model = doc.system.model
    if not model.bodies:
        return
    doc.say(
        "The bodies are the following. Every body has axes of its own; centres of mass are given "
        "in these, and moments of inertia about the centre of mass:"
    )
    head = ("body", "mass / kg", "centre of mass / m", "moment of inertia / kg·m²", "meaning")
    shown = len(head) if any(x.about for x in model.bodies) else len(head) - 1
    doc.listing(head[:shown], model.bodies, lambda x: _body(doc, x)[:shown])
    joints(doc)


def _body(doc: Manuscript, x: Body) -> tuple[Runs, ...]:
    about = f"body {x.name}"
    mass, com = doc.formula(x.mass, about), point(doc, x.com, about)
    called = dict(doc.system.model.body_symbols).get(x.name)
    name: Runs = (Text(names.words(x.name)), *((Text(", "), Math(called)) if called else ()))
    return name, (mass,), (com,), _inertia(doc, x, about), (Text(x.about),)


def _inertia(doc: Manuscript, x: Body, about: str) -> Runs:
    """One moment in the plane; in space the three principal ones, and the products where there are
    some."""
    plane = doc.system.model.plane
    if plane in AXIS_OF:
        return (doc.formula(x.inertia[AXIS_OF[plane]], about),)
    moments: list[Run] = []
    for k, (label, moment) in enumerate(zip(MOMENTS, x.inertia)):
        latex = doc.formula(moment, about).latex
        if k < PRINCIPAL or latex != "0":
            moments += [Text(", ")] if moments else []
            moments.append(Math(f"I_{{{label}}}={latex}"))
    return tuple(moments)


def _energies(doc: Manuscript) -> None:
    """Where they are given as formulas."""
    model = doc.system.model
    if model.kinetic is None:
        return
    T = doc.formula(model.kinetic, "given T")
    V = doc.formula(model.potential or 0.0, "given V")
    doc.say(
        "The kinetic and the potential energy are given as {T} and {V}.",
        T=_equal("T", T),
        V=_equal("V", V),
    )


def _name(x: Any) -> Text:
    return Text(names.words(x.name))


def _tied(doc: Manuscript) -> None:
    """Closures and constraints."""
    model = doc.system.model
    closures = model.closures
    ties = (*closures, *model.constraints)
    if ties:
        doc.say(f"The motion is tied by the following{whose(ties, ', axes and normals')}:")
        doc.listing(("name", "kind", "what it says"), ties, lambda x: _tie(doc, x))
    turned(
        doc, "Closures have a frame in each body. These are turned in theirs:", of_pairs(closures)
    )


def _tie(doc: Manuscript, x: Closure | Constraint) -> tuple[Runs, ...]:
    if isinstance(x, Closure):
        return (_name(x),), (Text(f"{x.type} closure"),), closure(doc, x)
    return (_name(x),), (Text(kind(x)),), constraint(doc, x)


def _driven(doc: Manuscript) -> None:
    """Loads and inputs."""
    model = doc.system.model
    inputs = tuple(x for _, x in zip(doc.u, model.inputs))
    latex = {x.name: doc.notation.latex[symbol] for symbol, x in zip(doc.u, inputs)}
    for x in inputs:
        doc.mean(latex[x.name], "{about}", x.unit, about=x.about or f"input {x.name}")

    def driving(x: Load | Input) -> tuple[Runs, ...]:
        if isinstance(x, Input):
            return (Math(latex[x.name]),), driven(doc, x)
        return (_name(x),), load(doc, x)

    drives = (*model.loads, *inputs)
    if drives:
        doc.say(f"Applied forces and inputs are the following{whose(drives, '')}:")
        doc.listing(("name", "what it does"), drives, driving)
    laws(doc)
    frames = "Frames of these are turned in their body:"
    turned(doc, frames, of_loads(model, model.loads))
