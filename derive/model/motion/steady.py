"""Steady motions: what is held, what is found, and over which ranges they are looked at."""

from __future__ import annotations

from typing import Any

from derive.diagnostics import did_you_mean, listed
from derive.expressions import tree
from derive.expressions.dimensions import UNKNOWN
from derive.expressions.mistakes import FormulaError
from derive.expressions.parser import expression
from derive.expressions.tree import Expression
from derive.model.document import Items, Key, Scalar
from derive.model.motion.speeds import Speeds, moving_name, unit
from derive.model.names import objection
from derive.model.reader import Reader
from derive.model.records import SteadyMotion
from derive.model.scope import INPUT, PARAMETER, Symbol

RESERVED = ("guess", "sweep", "cyclic")  # keys of a steady motion that name no state
COUNT = 101  # values in a range that does not say how many


def steady_motion(reader: Reader, key: Key, entry: dict[Key, Any], known: Speeds) -> SteadyMotion:
    """What is held along a steady motion: coordinates, velocities, inputs, states and declared
    quasi-velocities. Names the model does not know are free: they can be swept. Inputs that are
    not named are zero, those called `free` are found with the motion."""
    reader.name(key)
    sweepable: dict[str, None] = {}
    values: dict[str, Expression] = {}
    free: list[str] = []
    for state, scalar in entry.items():
        if str(state) in RESERVED:
            continue
        name = moving_name(reader, state, known, inputs=True)
        if name is None:
            continue
        if not isinstance(scalar, Scalar):
            reader.report(
                state.span,
                f"'{state}' is a list or mapping",
                f"a formula, or one of {listed(RESERVED)}",
            )
        elif name in values or name in free:
            reader.report(state.span, f"'{state}' is given twice", "one of the two")
        elif scalar.text == "free":
            free.append(name)
            _check_input(reader, state, name, scalar)
        else:
            sweepable |= dict.fromkeys(_free_names(reader, scalar))
            values[name] = _with_free_names(reader, scalar, sweepable, unit(reader, name, known))
    rest = {str(k): (k, value) for k, value in entry.items() if str(k) in RESERVED}
    return SteadyMotion(
        name=str(key),
        values=tuple(values.items()),
        sweepable=tuple(sweepable),
        span=key.span,
        free=tuple(free),
        guesses=_guesses(reader, rest.get("guess"), values, tuple(sweepable), known),
        cyclic=_cyclic(reader, rest.get("cyclic")),
        ranges=_ranges(reader, rest.get("sweep"), tuple(sweepable)),
    )


def _check_input(reader: Reader, state: Key, name: str, scalar: Scalar) -> None:
    """Coordinates and velocities need no word to be found."""
    symbol = reader.scope.symbols.get(name)
    if symbol is None or symbol.kinds != frozenset({INPUT}):
        hint = (
            f"what is not held is found: leave '{state}' out, or say under guess where its "
            "search starts"
        )
        reader.report(scalar.span, f"'{state}' is free", "only inputs can be called free", hint)


Part = tuple[Key, Any] | None


def _entries(reader: Reader, part: Part, wanted: str) -> dict[Key, Any]:
    """The entries of a mapping under one of the reserved keys."""
    if part is None:
        return {}
    key, value = part
    if not isinstance(value, dict):
        reader.report(key.span, f"'{key}' is not a mapping", wanted)
        return {}
    return value  # pyright: ignore[reportUnknownVariableType]  # what a file holds there


def _guesses(
    reader: Reader,
    part: Part,
    held: dict[str, Expression],
    sweepable: tuple[str, ...],
    known: Speeds,
) -> tuple[tuple[str, Expression], ...]:
    guesses: dict[str, Expression] = {}
    for state, scalar in _entries(reader, part, "names and numbers to start from").items():
        if str(state) in sweepable:
            where = f"a range under sweep, or a value: hamel linearize --set {state}=…"
            reader.report(state.span, f"'{state}' is free to choose and is not searched for", where)
            continue
        name = moving_name(reader, state, known, inputs=True)
        if name is None:
            continue
        if name in held or name in guesses:
            how = "held and guessed" if name in held else "given twice"
            reader.report(state.span, f"'{state}' is {how}", "one of the two")
        elif not isinstance(scalar, Scalar):
            reader.report(state.span, f"a list for the guess of '{state}'", "a number")
        else:
            guesses[name] = reader.of_parameters(
                scalar, f"the guess of {state}", unit=unit(reader, name, known)
            )
    return tuple(guesses.items())


def _cyclic(reader: Reader, part: Part) -> tuple[str, ...] | None:
    if part is None:
        return None
    key, value = part
    if not isinstance(value, Items):
        reader.report(key.span, "'cyclic' is not a list", "names of coordinates")
        return None
    known = reader.scope.coordinates()
    return tuple(
        name for name in (reader.word(scalar, known, "coordinate") for scalar in value) if name
    )


def _ranges(
    reader: Reader, part: Part, sweepable: tuple[str, ...]
) -> tuple[tuple[str, float, float, int], ...]:
    known = (*sweepable, *reader.scope.of_kind(PARAMETER))
    ranges: list[tuple[str, float, float, int]] = []
    for name, items in _entries(reader, part, "ranges, such as speed: [0, 10]").items():
        if str(name) not in known:
            near = did_you_mean(str(name), known)
            reader.report(
                name.span,
                f"'{name}' is neither free in this motion nor a parameter",
                listed(known),
                near,
            )
        elif not isinstance(items, Items) or len(items) not in (2, 3):
            reader.report(
                name.span, f"the range of '{name}'", "[first, last] or [first, last, count]"
            )
        else:
            ranges += _range(reader, str(name), items)
    return tuple(ranges)


def _range(reader: Reader, name: str, items: Items) -> list[tuple[str, float, float, int]]:
    of = reader.scope.symbols
    measured = unit(reader, name, Speeds({}, {})) if name in of else None
    ends = [
        reader.value(reader.formula(x, f"a range of {name}", unit=measured), x) for x in items[:2]
    ]
    count = (
        reader.value(reader.formula(items[2], "a count", unit=""), items[2])
        if len(items) == 3
        else COUNT
    )
    first, last = ends
    if first is None or last is None or count is None:
        return []
    if first == last or count < 2 or count != int(count):
        reader.report(
            items.span,
            f"the range of '{name}'",
            "two different values, and a whole count of at least 2",
        )
        return []
    return [(name, first, last, int(count))]


def _free_names(reader: Reader, scalar: Scalar) -> list[str]:
    try:
        nodes = list(tree.walk(expression(scalar.text, names=reader.scope.symbols)))
    except FormulaError:
        return []  # reported by `formula`
    names = [
        node.name
        for node in nodes
        if isinstance(node, tree.Name) and node.name not in reader.scope.symbols
    ]
    return [name for name in names if objection(name) is None]


def _with_free_names(
    reader: Reader, scalar: Scalar, free: dict[str, None], unit: str | None
) -> Expression:
    added = [name for name in free if name not in reader.scope.symbols]
    for name in added:
        reader.scope.add(name, Symbol(frozenset({PARAMETER}), UNKNOWN))
    formula = reader.formula(scalar, "a steady motion", unit=unit)
    for name in added:
        reader.scope.remove(name)
    return formula
