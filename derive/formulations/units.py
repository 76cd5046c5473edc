"""Units of quasi-velocities: what the formula of the choice says, else what its speed row says."""

from __future__ import annotations

from collections.abc import Mapping

from derive.choices.reduction import Reduction
from derive.expressions.dimensions import Inferred, infer
from derive.expressions.mistakes import FormulaError
from derive.expressions.tree import Expression
from derive.expressions.units import Dimension, pretty
from derive.mechanics.records import System
from derive.model.reader import dimension_of
from derive.model.records import Model


def units(system: System, choice: str, reduction: Reduction) -> tuple[str, ...]:
    """The unit of each quasi-velocity; "" where nothing says it.

    A row of generalized velocities of one unit, whose formula has the dimension of that unit, is in
    it: the rate of an angle plus the sine of another times a rate is in rad/s. A formula of another
    dimension is in the unit of that. Rows without a formula keep the unit of the one generalized
    velocity they are a plain multiple of.
    """
    columns: dict[int, list[int]] = {}
    for k, j in zip(*reduction.B.sparsity().get_triplet()):
        columns.setdefault(k, []).append(j)
    formulas = _formulas(system.model, choice)
    known = _known(system.model)
    return tuple(
        _unit(system, reduction, k, columns.get(k, []), _dimension(formulas.get(name), known))
        for k, name in enumerate(reduction.names)
    )


def _unit(
    system: System, reduction: Reduction, k: int, columns: list[int], dimension: Inferred
) -> str:
    own = {system.model.velocities[j].unit for j in columns}
    if isinstance(dimension, tuple):
        alike = len(own) == 1 and dimension_of(*own) == dimension
        return own.pop() if alike else _readable(dimension)
    plain = len(columns) == 1 and reduction.B[k, columns[0]].is_constant()
    return own.pop() if plain else ""


def _readable(dimension: Dimension) -> str:
    """As a unit that the language reads back; "" for powers that it does not take."""
    text = pretty(dimension)
    try:
        dimension_of(text)
    except FormulaError:
        return ""
    return text


def _formulas(model: Model, choice: str) -> dict[str, Expression]:
    """The rows of the choice in the file, by the name of the quasi-velocity."""
    return {
        name: formula
        for each in model.choices
        if each.name == choice
        for name, formula in each.rows
    }


def _known(model: Model) -> Mapping[str, Inferred]:
    """The dimension of every name that has a unit; a parameter without one may be anything."""
    named = (*model.coordinates, *model.velocities)
    known: dict[str, Inferred] = {x.name: dimension_of(x.unit) for x in named}
    known |= {x.name: dimension_of(x.unit) for x in model.parameters if x.unit}
    return known | {f"der({x.name})": dimension_of(f"{x.unit or '1'}/s") for x in model.coordinates}


def _dimension(formula: Expression | None, known: Mapping[str, Inferred]) -> Inferred:
    return None if formula is None else infer(formula, known)
