"""Derivatives of ẋ = f(t, x, u, p) on request, by CasADi's differentiation of the same graph; and
what a step and its sensitivity call.

The entries of x count as independent, also where constraints tie coordinates to each other: on the
constraints the derivatives along admissible directions are those of the motion, off them they
depend on how `dynamics` is written. `…_values` hold the entries that are not zero for structural
reasons, row by row; the manifest has their rows and columns. Source: A. Griewank, A. Walther,
Evaluating Derivatives, 2nd ed., SIAM 2008 (forward and adjoint products, chapter 3).
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from derive.diagnostics import AssumptionError
from derive.formulations.records import Argument, Function, Pattern, Request, Result

_BY = {"x": "the state", "u": "the inputs", "p": "the parameters"}
RATE = "explicit rate ∂ẋ/∂t of the state derivative"
FORWARD = "derivative of ẋ along (dx, du): ∂ẋ/∂x dx + ∂ẋ/∂u du, from (x, dx, du)"
ADJOINT = "adjoint product [(∂ẋ/∂x)ᵀ y, (∂ẋ/∂u)ᵀ y], from (x, y)"
JACOBIAN_FORWARD = (
    "derivative by (x, u) of ∂ẋ/∂x d + ∂ẋ/∂t τ with d and τ held, nx × (nx + nu), from (x, d, τ)"
)
HESSIAN = (
    "second derivative of yᵀ ẋ by (x, u) with y held, symmetric, (nx + nu) × (nx + nu), from (x, y)"
)
STEP = (
    "x after a step of length h, u held, from (x, h): explicit (rk4) or linearly implicit "
    "(rosenbrock), in substeps; not projected on constraints"
)
SENSITIVITY = "[∂x⁺/∂x, ∂x⁺/∂u] of `step`, nx × (nx + nu), from (x, h)"
IMPLICIT = ("jacobian", "jacobian_t")  # what a linearly implicit step calls besides


def derivatives(
    arguments: Sequence[Argument], functions: Sequence[Function]
) -> tuple[Request, ...]:
    """The requests that follow from `dynamics`; none where the module has no state derivative.

    Jacobians ∂ẋ/∂x (nx × nx), ∂ẋ/∂u (nx × nu), ∂ẋ/∂p (nx × np), ∂ẋ/∂t, products with them from the
    right (forward) and from the left (adjoint), and the steps of a controller with their
    sensitivities, which are loops around some of these. They are made when asked for:
    differentiating costs more than all default functions.
    """
    dynamics = {function.name: function for function in functions}.get("dynamics")
    if dynamics is None or not dynamics.result.value.numel():
        return ()
    slots = {argument.name: argument for argument in arguments}
    return (
        *(
            request
            for name in "xup"
            if slots[name].labels
            for request in _jacobians(dynamics, slots[name])
        ),
        Request("jacobian_t", RATE, lambda: _rate(dynamics, slots["t"])),
        Request("dynamics_forward", FORWARD, lambda: _forward(dynamics, slots)),
        Request("dynamics_adjoint", ADJOINT, lambda: _adjoint(dynamics, slots)),
        Request("jacobian_forward", JACOBIAN_FORWARD, lambda: _jacobian_forward(dynamics, slots)),
        Request("dynamics_hessian", HESSIAN, lambda: _hessian(dynamics, slots)),
        Request("step", STEP, needs=("dynamics", *IMPLICIT)),
        Request("step_sensitivity", SENSITIVITY, needs=("dynamics", *IMPLICIT, *_slopes(slots))),
    )


def _slopes(slots: dict[str, Argument]) -> tuple[str, ...]:
    """What a step's sensitivity calls besides."""
    return ("jacobian_forward", *(("jacobian_u",) if slots["u"].labels else ()))


def _jacobians(dynamics: Function, by: Argument) -> tuple[Request, Request]:
    """All of ∂ẋ/∂x and its values alone; likewise for u and p."""
    name = "jacobian" if by.name == "x" else f"jacobian_{by.name}"
    about = f"Jacobian ∂ẋ/∂{by.name} of the state derivative by {_BY[by.name]}, nx × n{by.name}"
    values = f"entries of `{name}` that are not zero by structure, row by row"
    return (
        Request(name, about, lambda: _dense(dynamics, by, name, about)),
        Request(f"{name}_values", values, lambda: _values(dynamics, by, f"{name}_values", values)),
    )


def _dense(dynamics: Function, by: Argument, name: str, about: str) -> Function:
    value = ca.densify(ca.jacobian(dynamics.result.value, by.symbols))
    symbol = "J" if by.name == "x" else f"J{by.name}"
    result = Result(symbol, value, dynamics.result.labels, (), matrix=True)
    return Function(name, about, result, dynamics.named, dynamics.guards)


def _values(dynamics: Function, by: Argument, name: str, about: str) -> Function:
    jacobian = ca.jacobian(dynamics.result.value, by.symbols)
    if not jacobian.nnz():
        raise AssumptionError(f"{name} would be empty: ẋ does not depend on {_BY[by.name]}")
    # CasADi stores by columns: those of the transpose are the rows wanted
    rows, columns = jacobian.T.sparsity().get_triplet()[::-1]
    labels = tuple(f"{dynamics.result.labels[i]} by {by.labels[j]}" for i, j in zip(rows, columns))
    result = Result(
        "values",
        jacobian.T.nz[:],
        labels,
        (),
        pattern=Pattern(jacobian.shape, tuple(rows), tuple(columns)),
    )
    return Function(name, about, result, dynamics.named, dynamics.guards)


def _rate(dynamics: Function, t: Argument) -> Function:
    value = ca.densify(ca.jacobian(dynamics.result.value, t.symbols))
    return Function(
        "jacobian_t",
        RATE,
        Result("ft", value, dynamics.result.labels, ()),
        dynamics.named,
        dynamics.guards,
    )


def _forward(dynamics: Function, slots: dict[str, Argument]) -> Function:
    """No dx of a parameter: where those matter, jacobian_p has all of them at once."""
    x, u = slots["x"], slots["u"]
    d = [_seeds("d", argument.labels) for argument in (x, u)]
    along = ca.jtimes(dynamics.result.value, ca.vertcat(x.symbols, u.symbols), ca.vertcat(*d))
    taken = _longer(
        x, ca.vertcat(*d), (*_marked("d", x.labels), *_marked("d", u.labels)), (*x.units, *u.units)
    )
    labels, units = _marked("d", dynamics.result.labels), dynamics.result.units
    result = Result("dxdot", ca.densify(along), labels, units)
    return Function("dynamics_forward", FORWARD, result, dynamics.named, dynamics.guards, x=taken)


def _adjoint(dynamics: Function, slots: dict[str, Argument]) -> Function:
    x, u = slots["x"], slots["u"]
    y = _seeds("y", dynamics.result.labels)
    product = ca.jtimes(dynamics.result.value, ca.vertcat(x.symbols, u.symbols), y, True)
    taken = _longer(x, y, _marked("y", dynamics.result.labels), ("",) * y.numel())
    result = Result("product", ca.densify(product), (*x.labels, *u.labels), ())
    return Function("dynamics_adjoint", ADJOINT, result, dynamics.named, dynamics.guards, x=taken)


def _jacobian_forward(dynamics: Function, slots: dict[str, Argument]) -> Function:
    """One product for both: along (d, τ) the rate of ẋ is ∂ẋ/∂x d + ∂ẋ/∂t τ, and this its slope."""
    t, x, u = slots["t"], slots["x"], slots["u"]
    d = ca.vertcat(_seeds("d", x.labels), ca.SX.sym("d_t"))
    along = ca.jtimes(dynamics.result.value, ca.vertcat(x.symbols, t.symbols), d)
    value = ca.densify(ca.jacobian(along, ca.vertcat(x.symbols, u.symbols)))
    taken = _longer(x, d, (*_marked("d", x.labels), "d t"), (*x.units, "s"))
    result = Result("H", value, dynamics.result.labels, (), matrix=True)
    about = JACOBIAN_FORWARD
    return Function("jacobian_forward", about, result, dynamics.named, dynamics.guards, x=taken)


def _hessian(dynamics: Function, slots: dict[str, Argument]) -> Function:
    """The slope of the adjoint product: one sweep backwards, and one forwards for each column."""
    x, u = slots["x"], slots["u"]
    y = _seeds("y", dynamics.result.labels)
    product = ca.dot(y, dynamics.result.value)
    value, _ = ca.hessian(product, ca.vertcat(x.symbols, u.symbols))
    taken = _longer(x, y, _marked("y", dynamics.result.labels), ("",) * y.numel())
    labels = (*x.labels, *u.labels)
    result = Result("H", ca.densify(value), labels, (), matrix=True)
    about = HESSIAN
    return Function("dynamics_hessian", about, result, dynamics.named, dynamics.guards, x=taken)


def _longer(
    x: Argument, further: ca.SX, labels: tuple[str, ...], units: tuple[str, ...]
) -> Argument:
    """The x slot with more behind it."""
    return Argument("x", ca.vertcat(x.symbols, further), (*x.labels, *labels), (*x.units, *units))


def _marked(mark: str, labels: Sequence[str]) -> tuple[str, ...]:
    return tuple(f"{mark} {label}" for label in labels)


def _seeds(mark: str, labels: Sequence[str]) -> ca.SX:
    return (
        ca.vertcat(*(ca.SX.sym(f"{mark}_{label}") for label in labels)) if labels else ca.SX(0, 1)
    )
