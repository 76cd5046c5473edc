"""Declared quasi-velocities by name, for the places that hold or guess them like velocities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from derive.diagnostics import listed
from derive.expressions.dimensions import infer
from derive.expressions.tree import Expression
from derive.expressions.units import pretty
from derive.model.document import Key
from derive.model.motion.motions import state_name
from derive.model.reader import Reader
from derive.model.records import Choice, Speed


@dataclass(frozen=True)
class Speeds:
    """The quasi-velocities that a file declares with names, alone and as CHOICE.NAME. Where two
    choices give one name to different formulas the name alone is `ambiguous`."""

    formulas: Mapping[str, Expression]
    ambiguous: Mapping[str, tuple[str, ...]]


def speeds(choices: Sequence[Choice]) -> Speeds:
    """The named rows of all choices."""
    formulas: dict[str, Expression] = {}
    owners: dict[str, list[str]] = {}
    ambiguous: set[str] = set()
    for choice in choices:
        for name, formula in choice.rows:
            formulas[f"{choice.name}.{name}"] = formula
            owners.setdefault(name, []).append(f"{choice.name}.{name}")
            if formulas.setdefault(name, formula) != formula:
                ambiguous.add(name)
    return Speeds(formulas, {name: tuple(owners[name]) for name in ambiguous})


def records(reader: Reader, known: Speeds) -> tuple[Speed, ...]:
    """Those that one name stands for. A name of the model itself keeps its own meaning."""
    return tuple(
        Speed(name, formula, unit(reader, name, known) or "")
        for name, formula in known.formulas.items()
        if name not in known.ambiguous and name not in reader.scope.symbols
    )


def moving_name(reader: Reader, key: Key, known: Speeds, inputs: bool = False) -> str | None:
    """The canonical spelling of the coordinate, velocity or quasi-velocity (or input, or state)
    that a key names; None after reporting that it is nothing."""
    name = str(key)
    if name in known.ambiguous:
        wanted = listed(known.ambiguous[name])
        reader.report(key.span, f"'{name}' is a quasi-velocity of several choices", wanted)
        return None
    if name in known.formulas and name not in reader.scope.symbols:
        return name
    return state_name(reader, key, inputs, known.formulas)


def unit(reader: Reader, name: str, known: Speeds) -> str | None:
    """What the value of a name is measured in; None where the name says nothing of it."""
    symbol = reader.scope.symbols.get(name)
    if symbol is None:
        dimension = infer(known.formulas[name], reader.scope.dimensions, "")
        return pretty(dimension) if isinstance(dimension, tuple) else None
    if symbol.unit:
        return symbol.unit
    return pretty(symbol.dimension) if isinstance(symbol.dimension, tuple) else None
