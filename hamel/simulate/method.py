"""How a model is simulated: a point of the product of formulation, choice, enforcement and
integrator, and whether its parts fit each other and the model."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from codegen.integrators import INTEGRATORS, Integrator, integrator_of
from codegen.reals import FLOAT64, Real
from derive.diagnostics import AssumptionError, ModelError, did_you_mean, listed
from derive.enforcement import ENFORCEMENTS, Enforcement, Options
from derive.formulations.charts import together
from derive.formulations.records import Equations
from derive.mechanics.records import System
from derive.model.records import Model
from hamel.simulate.inputs import Changes
from hamel.simulate.libraries import REFERENCES, library_of
from hamel.simulate.limits import TIGHTEST


@dataclass(frozen=True)
class Method:
    """A point of the product: formulation and choice, enforcement (the usual one when None),
    integrator; and how it steps."""

    formulation: str
    choice: str | None
    enforcement: str | None
    integrator: str
    step_size: float | None
    rtol: float
    atol: float | None
    alpha: float | None = None
    conserve: tuple[str, ...] = ()
    real: str = "float64"


def own_integrator(method: Method) -> Integrator | None:
    """The integrator as it is in generated code; None for one of another library."""
    return integrator_of(method.integrator)


def check_method(method: Method) -> None:
    """Refuse what cannot be, before anything is computed. Raises ModelError."""
    _check_integrator(method)
    own = own_integrator(method)
    if own is None and method.real != FLOAT64.name:
        others = listed(integrator.name for integrator in INTEGRATORS)
        raise ModelError(
            f"{method.integrator} computes in float64: integrate {method.real} with {others}"
        )
    if method.step_size is not None:
        check_positive("step size", method.step_size)
        if own is None:
            raise ModelError(f"{method.integrator} chooses its own steps: leave the step size out")
    elif own is not None and not own.adaptive:
        raise ModelError(
            f"{method.integrator} has no step control: give it a step size (--step-size)"
        )


def _check_integrator(method: Method) -> None:
    names = [*(integrator.name for integrator in INTEGRATORS), *(each.name for each in REFERENCES)]
    if method.integrator not in names:
        known = did_you_mean(method.integrator, names) or listed(names)
        raise ModelError(f"unknown integrator '{method.integrator}'; {known}")


def fitting_enforcement(method: Method, plain: Equations) -> Enforcement:
    """The enforcement asked for; projection where there is anything to project on when none is.

    Raises ModelError where it is not known, AssumptionError where it does not fit the integrator.
    """
    known = {enforcement.name: enforcement for enforcement in ENFORCEMENTS}
    if method.enforcement is None:
        enforcement = _usual_enforcement(method, plain)
    elif method.enforcement in known:
        enforcement = known[method.enforcement]
    else:
        names = did_you_mean(method.enforcement, known) or listed(known)
        raise ModelError(f"unknown enforcement '{method.enforcement}'; {names}")
    own = own_integrator(method)
    if own is None:
        _check_reference(method, enforcement, plain)
    elif own.exact and enforcement.level == "stages":
        raise AssumptionError(
            f"{method.integrator} does not fit enforcement '{enforcement.name}': it needs the "
            "exact Jacobian or series of what is integrated, and solving coordinates at every "
            "stage changes that; use projection"
        )
    return enforcement


def _usual_enforcement(method: Method, plain: Equations) -> Enforcement:
    """The first in the table that fits; a library's loop has no place for one that acts in it."""
    in_equations = own_integrator(method) is None
    return next(
        enforcement
        for enforcement in ENFORCEMENTS
        if not (in_equations and enforcement.level in ("steps", "stages"))
        and not enforcement.refusal(plain, Options())
    )


def check_changes(method: Method, changes: Changes, values: Mapping[str, Any]) -> None:
    """Refuse inputs that change where they cannot. Raises ModelError."""
    twice = [name for name in values if "".join(name.split()) in changes.tables]
    if twice:
        raise ModelError(f"{twice[0]} is set, and given as a table over time: one of the two")
    own = own_integrator(method)
    if changes and own is None:
        raise ModelError(f"{method.integrator} takes constant inputs; dop853 takes any")
    if own is not None and own.exact and changes.function and changes.sample is None:
        raise ModelError(
            f"{method.integrator} needs the exact Jacobian or series, which a function hides: give "
            "it sample times, or use radau"
        )


def check_events(method: Method, model: Model, events: Mapping[str, Any]) -> None:
    """Refuse events that nothing would look for, and what is no event. Raises ModelError."""
    stops = [event.name for event in model.events if event.stop]
    if own_integrator(method) is None and (events or stops):
        name = next(iter(events), *stops[:1])
        raise ModelError(f"{method.integrator} looks for no events such as {name}; dop853 does")
    own = [event.name for event in model.events]
    for name, event in events.items():
        if name in own:
            raise ModelError(f"{model.name} has an event '{name}' already")
        function = event if callable(event) else getattr(event, "function", None)
        if not callable(function):
            raise ModelError(f"event '{name}' is no function f(t, x), nor an Event of one")


def check_options(method: Method, enforcement: Enforcement) -> None:
    """Refuse what this enforcement would not look at. Raises ModelError."""
    if method.alpha is not None:
        check_positive("alpha", method.alpha)
        rates = [each.name for each in ENFORCEMENTS if each.level == "rates"]
        if enforcement.name not in rates:
            raise ModelError(
                f"enforcement '{enforcement.name}' has no rate alpha; {listed(rates)} have one"
            )
    conserving = [each.name for each in ENFORCEMENTS if each.conserves]
    if method.conserve and enforcement.name not in conserving:
        raise ModelError(
            f"enforcement '{enforcement.name}' conserves no momenta; {listed(conserving)} do"
        )


def _check_reference(method: Method, enforcement: Enforcement, plain: Equations) -> None:
    """Refuse what the loop of a library has no place for."""
    if enforcement.level in ("steps", "stages"):
        raise AssumptionError(
            f"{method.integrator} does not fit enforcement '{enforcement.name}': a library's loop "
            "has no place for it; none, baumgarte and feedback act on the equations"
        )
    if plain.charts:
        raise AssumptionError(
            f"{method.integrator} does not fit the charts {together(plain)}: a library's loop does "
            "not change them on the way; name one choice"
        )
    library = library_of(method.integrator)
    reason = library.refusal(plain) if library else ""
    if not reason and method.integrator == "idas" and enforcement.name != "none":
        reason = "it holds the constraints itself, without an enforcement"
    if reason:
        raise AssumptionError(f"{method.integrator} does not fit: {reason}")


def tolerances(method: Method, real: Real) -> tuple[float, float]:
    """rtol and atol of a step, no tighter than rounding."""
    check_positive("rtol", method.rtol)
    rtol = max(method.rtol, real.rounding(TIGHTEST))
    atol = rtol / 100 if method.atol is None else method.atol
    check_positive("atol", atol)
    return rtol, atol


def check_numbers(real: Real, system: System, *values: np.ndarray) -> None:
    """Refuse values that lose their digits before anything is computed. Raises AssumptionError."""
    for value in np.concatenate(values):
        if not real.holds(float(value)):
            raise AssumptionError(
                f"{system.model.name}: {real.name} cannot hold {value:.6g} with all digits",
                "float64 can; or choose units in which the numbers of the model are nearer to one",
            )


def check_positive(name: str, value: float) -> None:
    """Raises ModelError unless the value is finite and more than zero."""
    if not (value > 0 and math.isfinite(value)):
        raise ModelError(f"{name} is {value}, which is not a positive number")
