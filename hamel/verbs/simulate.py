"""simulate: integrate the compiled module from the consistent initial state and say how far the
motion can be trusted."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from codegen.integrators import INTEGRATORS, Integrator
from codegen.reals import FLOAT64, Real, real_of
from derive.choices.redundancy import lost
from derive.choices.resolution import survey_of
from derive.diagnostics import AssumptionError, ModelError, did_you_mean, listed
from derive.enforcement import ENFORCEMENTS, Enforcement, Options, kept_equations, usual_rate
from derive.formulations import equations
from derive.formulations.charts import charted, together
from derive.robots import load
from derive.states.initial import Initial, initial_state
from hamel import charts
from hamel.build.assurance import assure
from hamel.build.module import temporary_module
from hamel.build.stages import mechanics_of
from hamel.records import Simulated
from hamel.settings import settings
from hamel.simulate import motion
from hamel.simulate.exact import state_of as _state
from hamel.simulate.libraries import REFERENCES

if TYPE_CHECKING:
    from rich.console import Console

    from derive.formulations.records import Equations
    from derive.mechanics.records import System

ROWS = 500  # of the output when no step is given
MOST_ROWS = 10_000_000


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


def run(
    path: str | PathLike[str],
    method: Method,
    time: float,
    step: float | None,
    values: Mapping[str, float | str],
    out: str | Path | None,
    plot: str | Path | None,
    progress: Callable[[float], None] | None,
) -> Simulated:
    _check(method)
    times = _times(time, step, method.step_size)
    files = motion.writers(out, plot)
    real = real_of(method.real)
    tolerances = _tolerances(method.rtol, method.atol, real)
    mechanics = mechanics_of(load(path))
    given = settings(mechanics.model, values)
    u, p = np.array([*given.inputs.values()]), np.array([*given.parameters.values()])
    initial = initial_state(mechanics, given.initial, p)
    plain = equations(mechanics, method.choice, method.formulation)
    enforcement = _enforcement(method, plain)
    _check_options(method, enforcement)
    x = _state(plain, initial, p)
    _check_numbers(real, mechanics, x, u, p)
    alpha = (
        usual_rate(plain, 0.0, x, u, p, time)
        if enforcement.level == "rates" and method.alpha is None
        else method.alpha
    )
    options = Options(alpha, method.conserve, tuple(u), tuple(p))
    chosen = kept_equations(mechanics, method.choice, method.formulation, enforcement, options)
    stepping = motion.Stepping(method.integrator, enforcement.name, method.step_size, *tolerances)

    def moved(by: Equations) -> motion.Motion:
        with temporary_module(
            by, (method.integrator,) if _own(method) else (), (enforcement.name,), real=real.name
        ) as module:
            assure(plain, by, module)
            start, chart, given = x, 0, p
            if by.charts or by.frame:
                start, chart, given = charts.start(module, initial.q, initial.v, u, p)
            return motion.integrated(module, by, times, start, u, given, stepping, progress, chart)

    used = chosen
    try:
        found = moved(chosen)
    except AssumptionError as error:
        others = _others(mechanics, chosen, enforcement, options) if _own(method) else []
        if not others:
            raise _explained(error, mechanics, initial, p) from None
        used = charted([chosen, *others], survey_of(mechanics))
        try:
            found = moved(used)
        except AssumptionError:
            raise _explained(error, mechanics, initial, p) from None
    for write in files:
        write(found)
    return _record(
        used,
        replace(method, enforcement=enforcement.name, alpha=alpha),
        initial,
        found,
        out,
        plot,
    )


def _explained(
    error: AssumptionError, mechanics: System, initial: Initial, p: np.ndarray
) -> AssumptionError:
    """The error, or what is behind it: constraint rows that depend on each other at the start and
    with these parameters."""
    if not mechanics.rows:
        return error
    survey = survey_of(mechanics)
    A = survey.solver.velocities(0.0, initial.q, p)[0]
    text = lost(mechanics, A, survey.kept) if np.isfinite(A).all() else ""
    if not text:
        return error
    message = f"{mechanics.model.name}: at the start, with these parameters, {text}: {error.diagnostics[0].message}"
    return AssumptionError(
        message,
        "another start, or these values in the file: what repeats is found and dropped there",
    )


def _others(
    mechanics: System, chosen: Equations, enforcement: Enforcement, options: Options
) -> list[Equations]:
    """Other choices that can take over where the chosen one is singular."""
    if (
        not mechanics.rows
        or chosen.generalized_velocities
        or chosen.charts
        or enforcement.level not in ("none", "steps")
    ):
        return []
    found = []
    for name in dict.fromkeys(
        (*(choice.name for choice in mechanics.model.choices), "orthonormal")
    ):
        if name != chosen.choice:
            with contextlib.suppress(AssumptionError):
                found.append(
                    kept_equations(mechanics, name, chosen.formulation, enforcement, options)
                )
    return found


def _enforcement(method: Method, plain: Equations) -> Enforcement:
    """The enforcement asked for; projection where there is anything to project on when none is."""
    known = {enforcement.name: enforcement for enforcement in ENFORCEMENTS}
    if method.enforcement is not None and method.enforcement not in known:
        raise ModelError(
            f"unknown enforcement '{method.enforcement}'; {did_you_mean(method.enforcement, known) or listed(known)}"
        )
    own = _own(method)
    fitting = (
        enforcement
        for enforcement in ENFORCEMENTS
        if enforcement.level not in ("steps", "stages") or own is not None
    )
    usual = next(
        enforcement for enforcement in fitting if not enforcement.refusal(plain, Options())
    )
    enforcement = known[method.enforcement] if method.enforcement else usual
    if own is None:
        _check_reference(method, enforcement, plain)
    elif own.exact and enforcement.level == "stages":
        why = "it needs the exact Jacobian of what is integrated, and solving coordinates at every stage changes that"
        raise AssumptionError(
            f"{method.integrator} does not fit enforcement '{enforcement.name}': {why}; use projection"
        )
    return enforcement


def _check_options(method: Method, enforcement: Enforcement) -> None:
    """Refuse what this enforcement would not look at."""
    rates = [each.name for each in ENFORCEMENTS if each.level == "rates"]
    if method.alpha is not None:
        _positive("alpha", method.alpha)
    if method.alpha is not None and enforcement.name not in rates:
        raise ModelError(
            f"enforcement '{enforcement.name}' has no rate alpha; {listed(rates)} have one"
        )
    holding = [each.name for each in ENFORCEMENTS if each.conserves]
    if method.conserve and enforcement.name not in holding:
        raise ModelError(
            f"enforcement '{enforcement.name}' conserves no momenta; {listed(holding)} do"
        )


def _own(method: Method) -> Integrator | None:
    """The integrator as it is in generated code; None for one of another library."""
    return next(
        (integrator for integrator in INTEGRATORS if integrator.name == method.integrator), None
    )


def _check_reference(method: Method, enforcement: Enforcement, plain: Equations) -> None:
    if enforcement.level in ("steps", "stages"):
        why = "a library's loop has no place for it; none, baumgarte and feedback act on the equations"
        raise AssumptionError(
            f"{method.integrator} does not fit enforcement '{enforcement.name}': {why}"
        )
    if plain.charts:
        why = "a library's loop does not change them on the way"
        raise AssumptionError(
            f"{method.integrator} does not fit the charts {together(plain)}: {why}; name one choice"
        )
    reason = next(
        reference for reference in REFERENCES if reference.name == method.integrator
    ).refusal(plain)
    if reason or (method.integrator == "idas" and enforcement.name != "none"):
        raise AssumptionError(
            f"{method.integrator} does not fit: {reason or 'it holds the constraints itself, without an enforcement'}"
        )


def _check(method: Method) -> None:
    """Refuse what cannot be, before anything is computed."""
    names = [*(x.name for x in INTEGRATORS), *(x.name for x in REFERENCES)]
    if method.integrator not in names:
        raise ModelError(
            f"unknown integrator '{method.integrator}'; {did_you_mean(method.integrator, names) or listed(names)}"
        )
    own = _own(method)
    if own is None and method.real != FLOAT64.name:
        raise ModelError(
            f"{method.integrator} computes in float64: integrate {method.real} with {listed(x.name for x in INTEGRATORS)}"
        )
    if method.step_size is not None:
        _positive("step size", method.step_size)
        if own is None:
            raise ModelError(f"{method.integrator} chooses its own steps: leave the step size out")
    elif own is not None and not own.adaptive:
        raise ModelError(f"{method.integrator} has no step control: give it a step size")


def _times(time: float, step: float | None, step_size: float | None) -> np.ndarray:
    """0, step, 2 step … and the last time itself. Rows do not shorten equal steps unless asked
    for."""
    _positive("time", time)
    usual = time / ROWS if step_size is None else math.ceil(time / ROWS / step_size) * step_size
    step = usual if step is None else step
    _positive("step", step)
    if time / step > MOST_ROWS:
        raise ModelError(f"a step of {step:g} s makes more than {MOST_ROWS} rows in {time:g} s")
    count = math.floor(time / step * (1 + 1e-12))
    inner = np.arange(count + 1) * step
    return np.append(inner[inner < time * (1 - 1e-12)], time)


def _tolerances(rtol: float, atol: float | None, real: Real) -> tuple[float, float]:
    """No tighter than rounding."""
    _positive("rtol", rtol)
    rtol = max(rtol, real.rounding(1e-15))
    atol = rtol / 100 if atol is None else atol
    _positive("atol", atol)
    return rtol, atol


def _check_numbers(real: Real, mechanics: System, *given: np.ndarray) -> None:
    """Refuse values that lose their digits before anything is computed."""
    for value in np.concatenate(given):
        if not real.holds(float(value)):
            raise AssumptionError(
                f"{mechanics.model.name}: {real.name} cannot hold {value:.6g} with all digits",
                "float64 can; or choose units in which the numbers of the model are nearer to one",
            )


def _positive(name: str, value: float) -> None:
    if not (value > 0 and math.isfinite(value)):
        raise ModelError(f"{name} is {value}, which is not a positive number")


def _record(
    chosen: Equations,
    method: Method,
    initial: Initial,
    found: motion.Motion,
    out: str | Path | None,
    plot: str | Path | None,
) -> Simulated:
    return Simulated(
        model=chosen.system.model.name,
        formulation=chosen.formulation,
        choice=together(chosen),
        enforcement=method.enforcement or "",
        integrator=method.integrator,
        alpha=method.alpha,
        time=float(found.t[-1]),
        steps=found.steps,
        rejected=found.rejected,
        calls=found.calls,
        seconds=found.seconds,
        position_violation=found.position_violation,
        velocity_violation=found.velocity_violation,
        acceleration_violation=found.acceleration_violation,
        energy_balance=found.energy_balance,
        crossings=found.crossings,
        charts=found.charts,
        switches=found.switches,
        moved={name: {"given": wanted, "used": used} for name, wanted, used in initial.moved},
        final={name: float(values[-1]) for name, values in found.columns().items()},
        file=Path(out) if out else None,
        plot=Path(plot) if plot else None,
        motion=motion.written(found),
    )


def show(record: Simulated, console: Console) -> None:
    from hamel.show import number

    for name, by in record.moved.items():
        console.print(
            f"initial {name} = {by['given']:.6g} contradicts the constraints, {by['used']:.6g} is used"
        )
    steps = f"{record.steps} steps, {record.rejected} rejected, {record.seconds:.2g} s of computing"
    console.print(f"{record.model}, choice {record.choice}: {record.time:g} s in {steps}")
    console.print(f"  {record.formulation}, enforcement {record.enforcement}, {record.integrator}")
    console.print(f"  largest |φ|         {number(record.position_violation)}")
    console.print(f"  largest |A v − c|   {number(record.velocity_violation)}")
    console.print(f"  largest |A v̇ − β|   {number(record.acceleration_violation)}")
    console.print(
        f"  energy balance      {number(record.energy_balance)} of the largest energy exchanged"
        + (", as Jacobi's integral T₂ − T₀ + V" if "jacobi" in record.motion else "")
    )
    if record.crossings:
        console.print(
            f"  crossed {record.crossings} singular positions; two ways across each agree within the tolerance"
        )
    if record.charts:
        console.print(f"  charts used         {record.charts}")
    for switch in record.switches:
        console.print(
            f"  between {switch.time:.6g} s and {switch.before:.6g} s {switch.left} "
            f"came near where it fails; {switch.entered} took over"
        )
    for place in (record.file, record.plot):
        if place:
            console.print(f"  wrote {place}")
