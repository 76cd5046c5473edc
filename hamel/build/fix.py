"""Inputs and parameters fixed to numbers before anything is derived, so that no function takes them
any more.

A fixed input becomes a definition of the model and, where it drives a velocity, a constant force
along it, gear · value; one that is zero is no force at all. A fixed parameter has another default
and is a constant. What the model says of its motions with the inputs free (steady motions,
published values, extremes) is left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from derive.diagnostics import ModelError, did_you_mean, listed
from derive.expressions.tree import Number, Product
from derive.model.kinks import check_order
from derive.model.load_records import GeneralisedForce
from derive.model.records import Input, Load, Model
from hamel.build.options import Constants
from hamel.settings import settings


def fixed(
    model: Model, constants: Constants, values: Mapping[str, float | str]
) -> tuple[Model, Constants]:
    """The model with the named inputs and parameters as numbers, and what is constant in it then.

    Values are numbers in SI units, or text with a unit. Raises ModelError for a name that is
    neither an input nor a parameter, and where bounds, places or widths of formulas in pieces are
    not in order then.
    """
    if not values:
        return model, constants
    known = [item.name for item in (*model.inputs, *model.parameters)]
    for name in values:
        if name not in known:
            near = did_you_mean(name, known) or f"it has {listed(known)}"
            raise ModelError(
                f"'{name}' is to be fixed, but {model.name} has no such input or parameter; {near}"
            )
    result = settings(model, values)
    u = {i.name: result.inputs[i.name] for i in model.inputs if i.name in values}
    p = {x.name: result.parameters[x.name] for x in model.parameters if x.name in values}
    changed = replace(
        model,
        inputs=tuple(i for i in model.inputs if i.name not in u),
        definitions=(*((name, Number(value)) for name, value in u.items()), *model.definitions),
        loads=(
            *model.loads,
            *(_force(i, u[i.name]) for i in model.inputs if i.velocity and u.get(i.name)),
        ),
        parameters=tuple(
            replace(x, value=p[x.name]) if x.name in p else x for x in model.parameters
        ),
        steady_motions=(),
        published=(),
        extremes=(),
        fixed=tuple((u | p).items()),
    )
    check_order(changed, result.parameters)
    return changed, constants if isinstance(constants, str) else (
        *constants,
        *(name for name in p if name not in constants),
    )


def _force(given: Input, value: float) -> Load:
    return GeneralisedForce(
        given.name, given.velocity, Product((given.gear, Number(value))), given.span
    )
