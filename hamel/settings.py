"""`--set name=value`: initial values, parameters and constant inputs by name, with units, checked
as in a model file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from derive.diagnostics import ModelError, did_you_mean, listed
from derive.expressions import tree
from derive.expressions.dimensions import infer
from derive.expressions.evaluate import number
from derive.expressions.limits import objection
from derive.expressions.mistakes import FormulaError
from derive.expressions.parser import expression
from derive.expressions.piece_order import value_of
from derive.expressions.quantities import quantity
from derive.expressions.quantities import unit as parsed_unit
from derive.model.kinks import check_order

if TYPE_CHECKING:
    from derive.model.records import Model


@dataclass(frozen=True)
class Settings:
    """`initial`: coordinates, `der(q)` and generalized velocities that are held; `parameters` and
    `inputs`: all of the model's."""

    initial: dict[str, float]
    parameters: dict[str, float]
    inputs: dict[str, float]


def settings(model: Model, values: Mapping[str, float | str]) -> Settings:
    """The model's own values with `values` put in; formulas may use the parameters as they are in
    the file."""
    parameters = {p.name: p.value for p in model.parameters}
    inputs = {i.name: 0.0 for i in model.inputs}
    initial: dict[str, float] = {}
    known = units(model)
    given = {"".join(name.split()): value for name, value in values.items()}
    result = {name: _value(name, value, known, parameters) for name, value in given.items()}
    for name, value in result.items():
        place = next((table for table in (parameters, inputs) if name in table), initial)
        place[name] = value
    changed = [name for name in result if name in parameters]
    if changed:
        _check_bodies(model, changed, parameters)
        check_order(model, parameters)
    return Settings(initial, parameters, inputs)


def _check_bodies(model: Model, changed: list[str], parameters: Mapping[str, float]) -> None:
    """What the file is checked for with its own parameters holds for others, too: no mass and no
    moment is negative."""
    known = dict(parameters)
    for name, formula in model.definitions:
        value = value_of(formula, known)
        known |= {} if value is None else {name: value}
    for body in model.bodies:
        for what, formula in (
            ("mass", body.mass),
            *(("moment of inertia", moment) for moment in body.inertia[:3]),
        ):
            value = value_of(formula, known)
            if value is not None and value < 0.0:
                given = ", ".join(f"{name} = {parameters[name]:g}" for name in changed)
                raise ModelError(
                    f"with {given} the {what} of '{body.name}' is {value:g}, less than zero"
                )


def units(model: Model) -> dict[str, str]:
    """Unit of everything that can be set."""
    units = {
        item.name: item.unit
        for item in (
            *model.parameters,
            *model.inputs,
            *model.coordinates,
            *model.velocities,
            *model.states,
            *model.speeds,
        )
    }
    rates = {f"der({c.name})": f"{c.unit or 1}/s" for c in model.coordinates}
    return rates | units


def _value(
    name: str, value: float | str, units: Mapping[str, str], parameters: Mapping[str, float]
) -> float:
    if name not in units:
        raise ModelError(_unknown(name, units))
    if isinstance(value, str):
        return parsed(name, value, units[name], parameters)
    if not math.isfinite(value):
        raise ModelError(f"{name} is set to {value}, which is not a finite number")
    if problem := objection(value):
        raise ModelError(f"value of {name}: {problem[0]}", f"expected: {problem[1]}")
    return float(value)


def _unknown(name: str, units: Mapping[str, str]) -> str:
    near = did_you_mean(name, units)
    return (
        f"'{name}' is set, but it is no initial value, parameter or input of this model; "
        f"{near or f'it has {listed(units)}'}"
    )


def parsed(name: str, text: str, unit: str | None, parameters: Mapping[str, float]) -> float:
    """The value of a formula of parameters, in any unit when `unit` is None; what is wrong with it
    is said of this name."""
    try:
        return _evaluated(name, text, unit, parameters)
    except FormulaError as error:
        raise ModelError(
            [replace(diagnostic, file=f"value of {name}") for diagnostic in error.diagnostics]
        ) from None


def _evaluated(name: str, text: str, unit: str | None, parameters: Mapping[str, float]) -> float:
    # as in a file, `50 N/m` is a quantity where a parameter is called m, too
    plain = quantity(text)
    if plain is not None and plain.unit and unit is not None and _same(plain.unit, unit):
        return plain.value
    formula = expression(text, parameters)
    strange = [
        node.name
        for node in tree.walk(formula)
        if isinstance(node, tree.Name | tree.Rate) and node.name not in parameters
    ]
    if strange and strange[0].lower() in ("nan", "inf", "infinity"):
        raise ModelError(f"{name} is set to '{text}'", "it is a finite number")
    if strange:
        raise ModelError(f"{name} is set to '{text}', but '{strange[0]}' is no parameter")
    dimension = infer(formula, {}, text)
    if (
        unit is not None
        and isinstance(dimension, tuple)
        and dimension != parsed_unit(unit).dimension
    ):
        raise ModelError(
            f"{name} is set to '{text}', which is no quantity in {unit or 'plain numbers'}"
        )
    return number(formula, parameters, text)


def _same(one: str, other: str) -> bool:
    """Whether two units measure the same."""
    return parsed_unit(one).dimension == parsed_unit(other).dimension
