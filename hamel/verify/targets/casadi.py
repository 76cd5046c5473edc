"""The CasADi target, by CasADi: values, Jacobians and adjoint products of the functions of symbols,
and of the external functions of the compiled library, against the module."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import casadi as ca
import numpy as np

from codegen.compiler import shared_library
from hamel.verify.records import CheckResult
from hamel.verify.reference.vectors import Array
from hamel.verify.targets.records import Subject, TargetCheck, generated, result

STEP = 0.01  # of what the state comes to: its change in a step
ADJOINT = "yᵀ ∂ẋ/∂(t, x, u, p)"
JACOBIANS = ("jacobian_t", "derivatives", "derivatives", "jacobian_p")  # by t, x, u and p


def check(subject: Subject) -> tuple[CheckResult, ...]:
    """Values of every function, Jacobians and adjoint of the state derivative, both ways in."""
    symbols = generated(subject, "casadi")
    library = subject.folder / shared_library(subject.name)
    functions = {"symbols": {name: symbols.function(name) for name in symbols.functions}}
    if library.is_file():
        functions["external"] = {name: symbols.external(name, library) for name in symbols.compiled}
    outcomes = [
        x for kind, function in functions.items() for x in _outcomes(subject, kind, function)
    ]
    steps = {kind: function["step"] for kind, function in functions.items() if "step" in function}
    return (*outcomes, *(_step(subject, kind, step) for kind, step in steps.items()))


def _step(subject: Subject, kind: str, step: ca.Function) -> CheckResult:
    """Against the classical method over `dynamics` of the module, from every state."""
    errors = []
    for k, _ in enumerate(subject.sizes("dynamics")):
        t, x, u, p = subject.row("dynamics", k)
        f = subject.module.dynamics
        h = STEP * float(np.max(np.abs(x))) / max(float(np.max(np.abs(f(t, x, u, p)))), 1.0)
        k1 = f(t, x, u, p)
        k2 = f(t + h / 2, x + h / 2 * k1, u, p)
        k3 = f(t + h / 2, x + h / 2 * k2, u, p)
        k4 = f(t + h, x + h * k3, u, p)
        expected = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        value = np.asarray(step(t, np.append(x, h), u, p)).ravel()
        errors.append(_worst(value - expected) / float(np.max(np.abs(expected))))
    about = "a step by the classical method over dynamics of the module"
    return result(subject, f"{kind}: step", errors, about)


def _outcomes(
    subject: Subject, kind: str, functions: Mapping[str, ca.Function]
) -> Iterator[CheckResult]:
    known = [name for name in functions if name in subject.rows]
    values = [subject.error(name, functions[name]) for name in known]
    yield result(
        subject, f"{kind}: values", values, "every function against the module, entry by entry"
    )
    if "dynamics" in known and "derivatives" in subject.rows:
        jacobians, adjoints = _derivatives(subject, functions["dynamics"])
        yield result(
            subject, f"{kind}: Jacobians", jacobians, "of the state derivative by x, u and p"
        )
        yield result(subject, f"{kind}: adjoint", adjoints, ADJOINT)


def _derivatives(subject: Subject, dynamics: ca.Function) -> tuple[list[float], list[float]]:
    """The worst error of each Jacobian, and of products with a random vector from the left."""
    jacobian, reverse = dynamics.jacobian(), dynamics.reverse(1)
    random = np.random.default_rng(0)
    forward, adjoint = [0.0], [0.0]
    for number, name in enumerate(JACOBIANS):
        for k, size in enumerate(subject.sizes(name)):
            given = subject.row(name, k)
            all_of_it = np.asarray(getattr(subject.module, name)(*given))
            expected = _part(all_of_it, number, len(given[1]))
            value = dynamics(*given)
            block = np.asarray(jacobian(*given, value)[number])
            forward.append(_worst(block - expected.reshape(block.shape)) / size)
            y = random.normal(size=value.shape[0])
            product = np.asarray(reverse(*given, value, y)[number]).ravel()
            bound = size * float(np.sum(np.abs(y)))
            adjoint.append(_worst(product - y @ expected.reshape(block.shape)) / bound)
    return forward, adjoint


def _part(result: Array, number: int, states: int) -> Array:
    """∂ẋ/∂x or ∂ẋ/∂u of [ẋ ∂ẋ/∂x ∂ẋ/∂u]; all of the others."""
    parts = {1: slice(1, 1 + states), 2: slice(1 + states, None)}
    return result[:, parts[number]] if number in parts else result


def _worst(difference: Array | Any) -> float:
    return float(np.max(np.abs(difference), initial=0.0))


CASADI = TargetCheck("casadi", "casadi", check)
