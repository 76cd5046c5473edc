"""What the rows of a closure or constraint are called: the name alone where there is one, NAME.PART
where there are several."""

from __future__ import annotations

from derive.expressions.tree import Call, Expression
from derive.model.records import Closure, Model, Rolling

PARALLEL = ("turn1", "turn2")
LOCKED = (*PARALLEL, "turn3")


def row_names(model: Model) -> tuple[str, ...]:
    """Of all rows of A: closures first, then constraints, in the model's order."""
    found: list[str] = []
    for item in (*model.closures, *model.constraints):
        match item:
            case Closure():
                found += named(item.name, closure_parts(item.type, model.plane))
            case Rolling():
                found += named(item.name, rolling_parts(model.plane))
            case _:
                found.append(item.name)
    return tuple(found)


def named(name: str, parts: tuple[str, ...]) -> list[str]:
    return [f"{name}.{part}" for part in parts]


def closure_parts(kind: str, plane: str) -> tuple[str, ...]:
    """Meeting points along the ground's axes, shifts across an axis, and what must not turn."""
    meeting = tuple(plane or "xyz")
    parts = {
        "revolute": (*meeting, *(() if plane else PARALLEL)),
        "ball": meeting,
        "fixed": (*meeting, *(("turn1",) if plane else LOCKED)),
        "prismatic": ("shift1", "turn1") if plane else ("shift1", "shift2", *LOCKED),
        "cylindrical": ("shift1", "shift2", *PARALLEL),
        "planar": ("shift1", *PARALLEL),
        "universal": (*meeting, "cross"),
        "screw": ("shift1", "shift2", *PARALLEL, "advance"),
    }
    return parts.get(kind, ())


def rolling_parts(plane: str) -> tuple[str, ...]:
    return ("normal", "forward") if plane else ("normal", "forward", "sideways")


def components(name: str, formula: Expression, letters: str) -> list[str]:
    """What the entries of an output are called in formulas; none of reactions."""
    function = formula.function if isinstance(formula, Call) else ""
    if function in ("position", "velocity"):
        return [f"{name}.{letter}" for letter in letters]
    return [] if function == "reaction" else [name]
