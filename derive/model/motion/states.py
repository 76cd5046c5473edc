"""First-order states: numbers whose rates are formulas of the motion, inputs and each other."""

from __future__ import annotations

from collections.abc import Mapping

from derive.expressions.dimensions import Inferred, infer
from derive.expressions.mistakes import FormulaError
from derive.expressions.tree import ZERO, Expression
from derive.expressions.units import NUMBER, TIME, pretty, quotient_of
from derive.model.document import Key, Scalar
from derive.model.language.entries import StateEntry
from derive.model.language.shape import Document
from derive.model.reader import Reader, dimension_of
from derive.model.records import FirstOrderState
from derive.model.scope import ANYTHING, CONSTANT, STATE, Symbol


def enter(reader: Reader, document: Document) -> dict[str, str]:
    """Makes the states known to formulas, and gives their units in SI by name: that of `unit:`,
    else that of the initial value."""
    units = {reader.name(key): _unit(reader, entry) for key, entry in document.states.items()}
    for name, unit in units.items():
        reader.scope.add(name, Symbol(frozenset({STATE}), dimension_of(unit), unit=unit))
    return units


def _unit(reader: Reader, entry: StateEntry) -> str:
    if entry.unit is not None:
        return reader.unit(entry.unit)
    if entry.initial is None:
        return ""
    initial = reader.formula(entry.initial, "an initial value")
    dimension = _dimension(reader, initial, entry.initial)
    return pretty(dimension) if isinstance(dimension, tuple) and dimension != NUMBER else ""


def _dimension(reader: Reader, formula: Expression, scalar: Scalar) -> Inferred:
    try:
        return infer(formula, reader.scope.dimensions, scalar.text)
    except FormulaError:
        return NUMBER  # reported by `formula`


def states(
    reader: Reader, document: Document, units: Mapping[str, str]
) -> tuple[FirstOrderState, ...]:
    """The entries of `states:` in the order of the file. Rates have the unit of the state per
    second; a rate that needs rates of states, its own or others', is reported where it does."""
    return tuple(
        _state(reader, key, entry, units[str(key)]) for key, entry in document.states.items()
    )


def _state(reader: Reader, key: Key, entry: StateEntry, unit: str) -> FirstOrderState:
    per_time = pretty(quotient_of(dimension_of(unit), TIME))
    rate = reader.formula(entry.rate, f"the rate of '{key}'", ANYTHING, per_time)
    initial: Expression = ZERO
    if entry.initial is not None:
        initial = reader.of_parameters(entry.initial, f"the initial {key}", unit)
        reader.value(initial, entry.initial)
    about = entry.about.text if entry.about else ""
    energy = _energy(reader, entry)
    return FirstOrderState(str(key), rate, initial, energy, unit, about, key.span)


def _energy(reader: Reader, entry: StateEntry) -> Expression | None:
    if entry.energy is None:
        return None
    return reader.formula(entry.energy, "the energy of a state", CONSTANT | {STATE}, "J")
