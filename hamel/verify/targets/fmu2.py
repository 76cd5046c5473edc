"""The FMU of FMI 2.0, by FMPy: its description, the rates and derivatives of an instance, and
motions by Co-Simulation and by Model Exchange with CVODE, against the module."""

from __future__ import annotations

import ctypes
import importlib
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from derive.diagnostics import VerificationError
from hamel.verify.records import CheckResult
from hamel.verify.reference.vectors import Array
from hamel.verify.targets.fmu import fmpy_package, motions, with_start
from hamel.verify.targets.records import Subject, TargetCheck, result


def check(subject: Subject) -> tuple[CheckResult, ...]:
    """A call that the FMU refuses, or a solver that fails, is a failure, too."""
    fmpy = fmpy_package()
    try:
        return tuple(_results(fmpy, subject))
    except (fmpy.fmi1.FMICallException, RuntimeError) as error:
        raise VerificationError(f"{subject.name}: the target fmu2: {error}") from error


def _results(fmpy: Any, subject: Subject) -> Iterator[CheckResult]:
    path = subject.folder / f"{subject.name}_fmi2.fmu"
    problems = fmpy.validation.validate_fmu(str(path))
    said = "; ".join(problems) or "no problems"
    yield CheckResult("description", float(len(problems)), 0.0, not problems, said)
    if problems:  # what is not described cannot be called
        return
    description = fmpy.read_model_description(str(path))
    subject = with_start(subject, description)
    with tempfile.TemporaryDirectory() as folder:
        fmpy.extract(str(path), folder)
        errors = [subject.error("dynamics", _call(description, Path(folder), _rates))]
        yield result(subject, "values", errors, "rates against the module")
        if description.modelExchange.providesDirectionalDerivative:
            call = _call(description, Path(folder), _along)
            errors = [subject.error("dynamics_forward", call)]
            yield result(subject, "derivatives", errors, "directional ones of the module")
    yield from motions(fmpy, subject, path)


def _call(
    description: Any, folder: Path, read: Callable[[Any, Any, Array], Array]
) -> Callable[..., Array]:
    """An instance for Model Exchange as a function of (t, x, u, p); what x has behind the states
    goes to `read`."""
    fmi2 = importlib.import_module("fmpy.fmi2")
    nx = description.numberOfContinuousStates

    def value(t: float, x: Array, u: Array, p: Array) -> Array:
        instance = fmi2.FMU2Model(
            guid=description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=description.modelExchange.modelIdentifier,
            instanceName="instance",
        )
        instance.instantiate()
        try:
            instance.setupExperiment(startTime=t)
            instance.enterInitializationMode()
            instance.exitInitializationMode()
            instance.setReal(_references(description, "parameter"), p)
            instance.enterContinuousTimeMode()
            instance.setReal(_references(description, "input"), u)
            states = np.ascontiguousarray(x[:nx])
            instance.setContinuousStates(_pointer(states), nx)
            return read(instance, description, x[nx:])
        finally:
            instance.freeInstance()

    return value


def _pointer(values: Array) -> Any:
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def _references(description: Any, causality: str) -> list[int]:
    variables = description.modelVariables
    return [v.valueReference for v in variables if v.causality == causality]


def _rates(instance: Any, description: Any, along: Array) -> Array:
    values = np.empty(description.numberOfContinuousStates)
    instance.getDerivatives(_pointer(values), len(values))
    return values


def _along(instance: Any, description: Any, along: Array) -> Array:
    """The rates' derivative along states and inputs."""
    unknowns = [unknown.variable for unknown in description.derivatives]
    states = [variable.derivative.valueReference for variable in unknowns]
    knowns = [*states, *_references(description, "input")]
    rates = [variable.valueReference for variable in unknowns]
    return np.array(instance.getDirectionalDerivative(rates, knowns, along))


FMU2 = TargetCheck("fmu2", "fmpy", check)
