"""SciPy's solvers over the compiled functions, step by step, with their own dense output at the
output times."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from codegen.runtime.simulation import Simulation
from hamel.optional import library
from hamel.simulate.libraries.records import Problem, Reference, refusal, simulation

EXPLICIT = ("DOP853",)  # whose error is no number, either, where a slope is none


def _prepared(solver: str, problem: Problem) -> Callable[[], Simulation]:
    integrate = library("scipy.integrate", f"the integrator {solver.lower()}", "sweep")
    return lambda: _run(getattr(integrate, solver), solver, problem)


def _run(method: Any, solver: str, problem: Problem) -> Simulation:
    times, module = problem.times, problem.module
    rows = np.empty((times.size, problem.x.size + 1))
    stepper = method(
        lambda t, y: (_tried if solver in EXPLICIT else _slope)(module, t, y, problem),
        times[0],
        np.append(problem.x, 0.0),
        times[-1],
        rtol=problem.rtol,
        atol=problem.atol,
    )
    done, steps = int(np.searchsorted(times, times[0], side="right")), 0
    rows[:done] = stepper.y
    while stepper.status == "running":
        message = stepper.step()
        if stepper.status == "failed":
            raise refusal(
                problem, f"{solver} of SciPy stopped at t = {float(stepper.t)!r}: {message}"
            )
        upto = int(np.searchsorted(times, stepper.t, side="right"))
        if upto > done:
            rows[done:upto] = stepper.dense_output()(times[done:upto]).T
        done, steps = upto, steps + 1
    return simulation(problem, rows[:, :-1], rows[:, -1], steps, 0, stepper.nfev)


def _slope(module: Any, t: float, y: np.ndarray, problem: Problem) -> np.ndarray:
    slope = np.zeros(y.size)
    slope[:-1] = module.dynamics(t, y[:-1], problem.u, problem.p)
    if hasattr(module, "power"):
        slope[-1] = module.power(t, y[:-1], problem.u, problem.p)[0]
    return slope


def _tried(module: Any, t: float, y: np.ndarray, problem: Problem) -> np.ndarray:
    """Not a number where a step that is too long leads to no value: it is rejected then."""
    try:
        return _slope(module, t, y, problem)
    except FloatingPointError:
        return np.full(y.size, np.nan)


def _reference(name: str, solver: str, about: str) -> Reference:
    source = "P. Virtanen et al.: SciPy 1.0, Nature Methods 17, 2020"
    return Reference(
        name,
        f"{solver} of SciPy over the compiled functions: {about}",
        source,
        lambda problem: _prepared(solver, problem),
    )


SCIPY = (
    _reference("scipy_dop853", "DOP853", "explicit Runge-Kutta of order 8"),
    _reference("scipy_radau", "Radau", "implicit Runge-Kutta of order 5 for stiff systems"),
    _reference("scipy_lsoda", "LSODA", "multistep methods, Adams or BDF by stiffness"),
)
