"""What the rows of a closure or constraint are called: the name alone where there is one, NAME.PART
where there are several."""

from __future__ import annotations

from derive.expressions.tree import Call, Expression, Vector
from derive.joints import JOINTS
from derive.model.constraint_records import Rolling
from derive.model.records import Closure, Model


def row_names(model: Model) -> tuple[str, ...]:
    """Of all rows of A: closures first, then constraints, in the model's order."""
    names: list[str] = []
    for item in (*model.closures, *model.constraints):
        match item:
            case Closure():
                names += named(item.name, closure_parts(item.type, model.plane))
            case Rolling():
                names += named(item.name, rolling_parts(model.plane))
            case _:
                names.append(item.name)
    return tuple(names)


def named(name: str, parts: tuple[str, ...]) -> list[str]:
    """NAME.PART for each part: rows of a constraint that has several."""
    return [f"{name}.{part}" for part in parts]


def closure_parts(kind: str, plane: str) -> tuple[str, ...]:
    """Meeting points along the ground's axes, shifts across an axis, and what must not turn: as the
    joint's own table says."""
    closing = {joint.name: joint.closing for joint in JOINTS}.get(kind)
    return closing(plane) if closing else ()


def rolling_parts(plane: str) -> tuple[str, ...]:
    """Rows of a rolling body: it stays on the plane (`normal`) and does not slip along it. In a
    plane there is no sideways."""
    return ("normal", "forward") if plane else ("normal", "forward", "sideways")


def is_reaction(formula: Expression) -> bool:
    """Whether an output is the reaction of a closure or a constraint."""
    return isinstance(formula, Call) and formula.function == "reaction"


def components(name: str, formula: Expression, letters: str) -> list[str]:
    """What the entries of an output are called in formulas; none of reactions."""
    function = formula.function if isinstance(formula, Call) else ""
    if function in ("position", "velocity") or isinstance(formula, Vector):
        return [f"{name}.{letter}" for letter in letters]
    return [] if is_reaction(formula) else [name]
