"""The JAX target, by JAX: values under jit and vmap, forward and adjoint products of the state
derivative, against the module and its Jacobians."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any

import numpy as np

from hamel.verify.records import CheckResult
from hamel.verify.targets.records import Subject, TargetCheck, generated, result, tool


def check(subject: Subject) -> tuple[CheckResult, ...]:
    """ToolchainError without jax."""
    jax = tool("jax")
    with _in_double(jax):
        functions = generated(subject, "jax")
        known = [name for name in functions.FUNCTIONS if name in subject.rows]
        one = [subject.error(name, jax.jit(getattr(functions, name))) for name in known]
        many = [subject.error(name, _mapped(jax, getattr(functions, name))) for name in known]
        results = [
            result(subject, "values under jit", one, "every function against the module"),
            result(subject, "values under vmap", many, "the same, by the function for many states"),
        ]
        if "dynamics_adjoint" in known:
            results += _derivatives(subject, jax, functions.dynamics)
        if "dynamics_hessian" in known:
            results.append(_second(subject, jax, functions.dynamics))
    return tuple(results)


@contextlib.contextmanager
def _in_double(jax: ModuleType) -> Iterator[None]:
    """JAX makes float32 of everything where nothing else is said."""
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    try:
        yield
    finally:
        jax.config.update("jax_enable_x64", before)


def _mapped(jax: ModuleType, function: Callable[..., Any]) -> Callable[..., np.ndarray]:
    """The state among others: in the middle of three."""
    many = jax.jit(jax.vmap(function, (None, 0, None, None)))

    def value(t: float, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.asarray(many(t, np.stack([0.5 * x, x, 2.0 * x]), u, p))[1]

    return value


def _derivatives(subject: Subject, jax: ModuleType, dynamics: Any) -> list[CheckResult]:
    """By x and u along the vectors of the module's products, by p and t as whole Jacobians; both
    ways through."""

    @jax.jit
    def forward(t: Any, x: Any, u: Any, p: Any) -> Any:
        along = (x[nx : 2 * nx], x[2 * nx :])
        return jax.jvp(lambda x, u: dynamics(t, x, u, p), (x[:nx], u), along)[1]

    @jax.jit
    def adjoint(t: Any, x: Any, u: Any, p: Any) -> Any:
        value, back = jax.vjp(lambda x, u: dynamics(t, x, u, p), x[:nx], u)
        return jax.numpy.concatenate(back(x[nx:].astype(value.dtype)))

    nx = subject.module.nx
    derivatives = []
    for name, product, call, jacobian in (
        ("jvp", "dynamics_forward", forward, jax.jacfwd),
        ("vjp", "dynamics_adjoint", adjoint, jax.jacrev),
    ):
        calls = {product: call, "jacobian_t": _mapped(jax, jacobian(dynamics, 0))}
        calls["jacobian_p"] = _mapped(jax, jacobian(dynamics, 3))
        known = [function for function in calls if function in subject.rows]
        errors = [subject.error(function, calls[function]) for function in known]
        derivatives.append(
            result(subject, name, errors, f"of the state derivative, against {', '.join(known)}")
        )
    return derivatives


def _second(subject: Subject, jax: ModuleType, dynamics: Any) -> CheckResult:
    """Hessians of yᵀ ẋ by x and u, forward over reverse and reverse over reverse, against the
    module's; forward over forward against both."""
    nx = subject.module.nx

    def way(outer: Any, inner: Any) -> Callable[..., Any]:
        def hessian(t: Any, x: Any, u: Any, p: Any) -> Any:
            def scalar(z: Any) -> Any:
                return jax.numpy.dot(x[nx:], dynamics(t, z[:nx], z[nx:], p))

            return outer(inner(scalar))(jax.numpy.concatenate([x[:nx], u]))

        return jax.jit(hessian)

    orders = [(jax.jacfwd, jax.jacrev), (jax.jacrev, jax.jacrev)]
    if "jacobian_forward" in subject.rows:
        orders += [(jax.jacfwd, jax.jacfwd), (jax.jacrev, jax.jacfwd)]
    errors = [subject.error("dynamics_hessian", way(*order)) for order in orders]
    return result(subject, "second derivatives", errors, "of yᵀ ẋ by x and u, all ways through")


JAX = TargetCheck("jax", "jax", check)
