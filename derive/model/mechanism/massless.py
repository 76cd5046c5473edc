"""Massless tips: bodies at the end of a chain whose joint has nothing to accelerate, so that no
mass matrix can be inverted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from derive.expressions import tree
from derive.expressions.evaluate import number
from derive.expressions.mistakes import FormulaError
from derive.expressions.tree import Expression, Name, Rate
from derive.model.constraint_records import (
    Distance,
    Holonomic,
    Nonholonomic,
    NoSlip,
    OnSurface,
    Rolling,
)
from derive.model.load_records import Armature
from derive.model.reader import Reader
from derive.model.records import Body, Closure, Constraint, Joint, Model


def check_tips(reader: Reader, model: Model) -> None:
    """Report moving joints that carry no inertia at all, where no constraint speaks of what they
    carry either: M is singular then along a motion that nothing determines."""
    felt = _bodies_with_equations(reader, model)
    below: set[str] = set()  # bodies that carry one which was reported
    for joint in reversed(model.joints):
        if joint.child in felt:
            felt.add(joint.parent)
        elif joint.velocities and joint.child not in below:
            _report(reader, model, joint)
            below.add(joint.child)
        if joint.child in below:
            below.add(joint.parent)


def _report(reader: Reader, model: Model, joint: Joint) -> None:
    span = model.body(joint.child).span
    problem = (
        f"nothing gives '{joint.child}' inertia: the joint '{joint.name}' has nothing to accelerate"
    )
    reader.report(
        span,
        problem,
        "a mass, an inertia, or an armature at the joint",
        "a fixed joint carries a mere frame",
    )


def _bodies_with_equations(reader: Reader, model: Model) -> set[str]:
    """Bodies with mass, those that constraints speak of, and those whose joints have an inertia or
    a constraint of their own."""
    result = {body.name for body in model.bodies if not _is_massless(reader, body)}
    for tie in (*model.closures, *model.constraints):
        result |= set(_bodies(tie))
    names = set(_names(model, _formulas(model)))
    names |= {load.velocity for load in model.loads if isinstance(load, Armature)}
    own = {x.name: x.owner for x in (*model.coordinates, *model.velocities)}
    own |= {f"der({x.name})": x.owner for x in model.coordinates}
    owners = {own[name] for name in names if name in own}
    return result | {joint.child for joint in model.joints if joint.name in owners}


def _is_massless(reader: Reader, body: Body) -> bool:
    return all(_is_zero(formula, reader.values) for formula in (body.mass, *body.inertia))


def _is_zero(formula: Expression, values: Mapping[str, float]) -> bool:
    if any(isinstance(n, Name) and n.name not in values for n in tree.walk(formula)):
        return False  # it depends on t
    try:
        return number(formula, values, "") == 0.0
    except FormulaError:
        return False


def _bodies(tie: Closure | Constraint) -> tuple[str, ...]:
    match tie:
        case Closure() | Distance():
            return tie.bodies
        case NoSlip() | Rolling():
            return (tie.body,)
        case OnSurface():
            return tie.body, tie.frame_body
        case _:
            pass
    return ()


def _formulas(model: Model) -> Iterator[Expression]:
    """What gives a coordinate an equation of its own: constraints by formula, and the kinetic
    energy."""
    for tie in model.constraints:
        if isinstance(tie, Holonomic | Nonholonomic):
            yield tie.expression
    if model.kinetic is not None:
        yield model.kinetic


def _names(model: Model, formulas: Iterable[Expression]) -> Iterator[str]:
    """Coordinates and velocities in formulas, definitions opened."""
    definitions, waiting = dict(model.definitions), list(formulas)
    while waiting:
        for node in tree.walk(waiting.pop()):
            if isinstance(node, Rate):
                yield f"der({node.name})"
            elif isinstance(node, Name) and node.name in definitions:
                waiting.append(definitions.pop(node.name))
            elif isinstance(node, Name):
                yield node.name
