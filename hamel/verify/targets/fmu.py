"""The FMU, by FMPy: its description, the values and derivatives of an instance, and motions by
Co-Simulation and by Model Exchange with CVODE, against the module."""

from __future__ import annotations

import contextlib
import importlib
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from derive.diagnostics import ToolchainError, VerificationError
from hamel.verify.records import CheckResult
from hamel.verify.reference.vectors import Array
from hamel.verify.targets.records import Subject, TargetCheck, result

INSTALL = "pip install 'hamel[fmu]'"
GROUPS = ("outputs", "reactions", "energy", "power")
SPAN, ROWS = 0.5, 20  # s and communication points of the motions
MANY = 40  # states from which on the span shrinks: CVODE's Jacobian takes a call for each
STEPS = 150  # of the module in the span: CVODE's BDF takes some fifty times as many
SHORTER = 20  # times the span is halved until it has no more, and ends before what is singular
TOLERANCE = 1e-12  # of both integrations
# What is left of the motion's errors: those of CVODE's BDF at 1e-12, some hundred times that.
MOTION = 1e-8


def check(subject: Subject) -> Iterator[CheckResult]:
    """What the tool says of the description, then values, derivatives and motions."""
    fmpy = fmpy_package()
    path = subject.folder / f"{subject.name}.fmu"
    problems = fmpy.validation.validate_fmu(str(path))
    count = float(len(problems))
    yield CheckResult("description", count, 0.0, not problems, "; ".join(problems) or "no problems")
    if problems:  # what is not described cannot be called
        return
    subject = with_start(subject, fmpy.read_model_description(str(path)))
    with tempfile.TemporaryDirectory() as folder:
        fmpy.extract(str(path), folder)
        fmu = _Fmu(fmpy, Path(folder), fmpy.read_model_description(folder))
        values = [subject.error("dynamics", fmu.rates)]
        values += [subject.error(name, fmu.group(name)) for name in fmu.groups(subject)]
        about = "rates and variables against the module, entry by entry"
        yield result(subject, "values", values, about)
        if fmu.description.modelExchange.providesAdjointDerivatives:
            products = [
                subject.error("dynamics_forward", fmu.forward),
                subject.error("dynamics_adjoint", fmu.adjoint),
                subject.error("outputs_jacobian", fmu.outputs_jacobian),
            ]
            about = "directional and adjoint ones of the module"
            yield result(subject, "derivatives", products, about)
    yield from motions(fmpy, subject, path)


def fmpy_package() -> Any:
    try:
        for part in ("validation", "fmi3"):
            importlib.import_module(f"fmpy.{part}")
        return importlib.import_module("fmpy")
    except ImportError as error:
        raise ToolchainError(f"FMPy is missing: {error}", hint=INSTALL) from error


@dataclass(frozen=True)
class _Fmu:
    """An unpacked FMU, whose instances are functions of (t, x, u, p) as those of a module."""

    fmpy: Any
    folder: Path
    description: Any

    def groups(self, subject: Subject) -> list[str]:
        """The functions of the module whose results are variables, in the order of these."""
        return [name for name in GROUPS if hasattr(subject.module, name)]

    def references(self, causality: str) -> list[int]:
        """Value references of inputs or parameters."""
        variables = self.description.modelVariables
        return [v.valueReference for v in variables if v.causality == causality]

    @property
    def rate_references(self) -> list[int]:
        """Of the state derivatives, in the order of the states."""
        return [unknown.variable.valueReference for unknown in self.description.derivatives]

    @property
    def state_references(self) -> list[int]:
        """Of the states."""
        derivatives = self.description.derivatives
        return [unknown.variable.derivative.valueReference for unknown in derivatives]

    @contextlib.contextmanager
    def at(self, t: float, x: Array, u: Array, p: Array) -> Iterator[Any]:
        """An instance for Model Exchange in that state, in Continuous-Time Mode."""
        instance = self.fmpy.fmi3.FMU3Model(
            guid=self.description.guid,
            unzipDirectory=str(self.folder),
            modelIdentifier=self.description.modelExchange.modelIdentifier,
            instanceName="instance",
        )
        instance.instantiate()
        try:
            instance.enterInitializationMode(startTime=t)
            instance.exitInitializationMode()
            instance.setFloat64(self.references("parameter"), p)
            instance.enterContinuousTimeMode()
            instance.setFloat64(self.references("input"), u)
            states = np.ascontiguousarray(x)
            pointer = states.ctypes.data_as(self.fmpy.fmi3.POINTER(self.fmpy.fmi3.fmi3Float64))
            instance.setContinuousStates(pointer, len(states))
            yield instance
        finally:
            instance.freeInstance()

    def rates(self, t: float, x: Array, u: Array, p: Array) -> Sequence[float]:
        """`dynamics` of the module."""
        with self.at(t, x, u, p) as instance:
            return instance.getFloat64(self.rate_references)

    def group(self, name: str) -> Any:
        """A function whose results are variables, known by what the description says of them."""

        def values(t: float, x: Array, u: Array, p: Array) -> Sequence[float]:
            with self.at(t, x, u, p) as instance:
                return instance.getFloat64(self.of_group[name])

        return values

    @property
    def of_group(self) -> dict[str, list[int]]:
        """Value references by the functions that their variables come from."""
        groups: dict[str, list[int]] = {}
        states = set(self.state_references)
        for variable in self.description.modelVariables:
            name = _group(variable, states)
            groups.setdefault(name, []).append(variable.valueReference)
        return groups

    def forward(self, t: float, x: Array, u: Array, p: Array) -> Sequence[float]:
        """`dynamics_forward` of the module, from (x, dx, du)."""
        n = len(self.rate_references)
        with self.at(t, x[:n], u, p) as instance:
            return instance.getDirectionalDerivative(self.rate_references, self._knowns, x[n:])

    def adjoint(self, t: float, x: Array, u: Array, p: Array) -> Sequence[float]:
        """`dynamics_adjoint` of the module, from (x, y)."""
        n = len(self.rate_references)
        with self.at(t, x[:n], u, p) as instance:
            knowns = self._knowns
            return instance.getAdjointDerivative(self.rate_references, knowns, x[n:], len(knowns))

    def outputs_jacobian(self, t: float, x: Array, u: Array, p: Array) -> Array:
        """`outputs_jacobian` of the module, by one adjoint derivative for each output."""
        states = self.state_references
        with self.at(t, x, u, p) as instance:
            rows = [
                instance.getAdjointDerivative([output], states, [1.0], len(states))
                for output in self.of_group["outputs"]
            ]
        return np.array(rows)

    @property
    def _knowns(self) -> list[int]:
        return [*self.state_references, *self.references("input")]


def _group(variable: Any, states: set[int]) -> str:
    """Parameters, inputs and outputs may have such names, too: what came later has a number."""
    if variable.causality == "output" and variable.valueReference not in states:
        return "outputs"
    name = variable.name.split(" (")[0]
    if variable.causality != "local" or variable.initial != "calculated":
        return "none"
    if name in ("kinetic_energy", "potential_energy"):
        return "energy"
    if name.startswith("reaction "):
        return "reactions"
    return "power" if name == "power" else "none"


def _start(subject: Subject, description: Any) -> Array:
    """The start values, on the constraints."""
    states = [unknown.variable.derivative for unknown in description.derivatives]
    start = np.array([float(state.start) for state in states])
    return subject.module.project(0.0, start) if hasattr(subject.module, "project") else start


def with_start(subject: Subject, description: Any) -> Subject:
    """With the start as the only state where a model is so large that none are drawn."""
    if "dynamics" in subject.rows:
        return subject
    start = _start(subject, description)
    u = np.zeros(sum(v.causality == "input" for v in description.modelVariables))
    p = np.array(subject.module._shared.DEFAULTS, dtype=float)
    seeds = np.random.default_rng(0).normal(size=2 * len(start) + len(u))
    taken = {
        **dict.fromkeys(("dynamics", *GROUPS), start),
        "dynamics_forward": np.concatenate([start, seeds[: len(start) + len(u)]]),
        "dynamics_adjoint": np.concatenate([start, seeds[: len(start)]]),
    }
    rows: dict[str, Any] = {}
    for name, x in taken.items():
        if hasattr(subject.module, name):
            size = float(np.max(np.abs(getattr(subject.module, name)(0.0, x, u, p))))
            rows[name] = {"t": [0.0], "x": [x], "u": [u], "p": [p], "size": [size]}
    return replace(subject, rows=rows)


def _expected(subject: Subject, start: Array, u: Array) -> tuple[float, Array]:
    """A span in which the module takes few steps, and its motion there, row by row."""
    span = SPAN * min(1.0, MANY / len(start))
    tight = {"rtol": TOLERANCE, "atol": TOLERANCE / 100, "max_steps": STEPS}
    for _ in range(SHORTER):
        times = np.linspace(0.0, span, ROWS + 1)
        with contextlib.suppress(subject.module.Stopped):
            motion = subject.module.simulate((0.0, span), start, u, times=times, **tight)
            return span, motion.x
        span /= 2.0
    raise VerificationError(f"{subject.name}: no motion to compare the target fmu with")


def motions(fmpy: Any, subject: Subject, path: Path) -> Iterator[CheckResult]:
    """From the start values, with the inputs held."""
    description = fmpy.read_model_description(str(path))
    states = [unknown.variable.derivative for unknown in description.derivatives]
    names = [state.name for state in states]
    nominals = [float(state.nominal or 1.0) for state in states]
    inputs = [v.name for v in description.modelVariables if v.causality == "input"]
    u = subject.row("dynamics", 0)[2]
    span, expected = _expected(subject, _start(subject, description), u)
    for kind, about in (("CoSimulation", ""), ("ModelExchange", " with CVODE")):
        rows = fmpy.simulate_fmu(
            str(path),
            fmi_type=kind,
            stop_time=span,
            output_interval=span / ROWS,
            relative_tolerance=TOLERANCE,
            start_values=dict(zip(inputs, u)),
            output=names,
            record_events=False,
        )
        outcome = np.array([[row[name] for name in names] for row in rows])
        sizes = np.maximum(nominals, np.max(np.abs(expected), axis=0))
        value = float(np.max(np.abs(outcome - expected) / sizes))
        yield CheckResult(
            f"{kind}{about}", value, MOTION, value <= MOTION, "a motion of the module"
        )


def _outcomes(subject: Subject) -> tuple[CheckResult, ...]:
    """All checks. A call that the FMU refuses, or a solver that fails, is a failure, too."""
    try:
        return tuple(check(subject))
    except (fmpy_package().fmi1.FMICallException, RuntimeError) as error:
        raise VerificationError(f"{subject.name}: the target fmu: {error}") from error


FMU = TargetCheck("fmu", "fmpy", _outcomes)
