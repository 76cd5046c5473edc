"""Derivatives of ẋ = f(t, x, u, p) and of one integration step, on request, by CasADi's
differentiation of the same graph.

The entries of x count as independent, also where constraints tie coordinates to each other: on the
constraints the derivatives along admissible directions are those of the motion, off them they
depend on how `dynamics` is written. `…_values` hold the entries that are not zero for structural
reasons, row by row; the manifest has their rows and columns. Source: A. Griewank, A. Walther,
Evaluating Derivatives, 2nd ed., SIAM 2008 (forward and adjoint products, chapter 3); the step is W.
Kutta's classical one of order four, differentiated stage by stage.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca

from derive.choices.records import Guard
from derive.diagnostics import AssumptionError
from derive.formulations.records import Argument, Function, Pattern, Request, Result

_BY = {"x": "the state", "u": "the inputs", "p": "the parameters"}
RATE = "explicit rate ∂ẋ/∂t of the state derivative"
FORWARD = "derivative of ẋ along (dx, du): ∂ẋ/∂x dx + ∂ẋ/∂u du, from (x, dx, du)"
ADJOINT = "adjoint product [(∂ẋ/∂x)ᵀ y, (∂ẋ/∂u)ᵀ y], from (x, y)"
STEP = (
    "x after one step of length h of the classical Runge–Kutta method, u held, from (x, h); "
    "not projected on constraints"
)
SENSITIVITY = "[∂x⁺/∂x, ∂x⁺/∂u] of `step`, nx × (nx + nu), from (x, h)"


def derivatives(
    arguments: Sequence[Argument], functions: Sequence[Function]
) -> tuple[Request, ...]:
    """The requests that follow from `dynamics`; none where the module has no state derivative.

    Jacobians ∂ẋ/∂x (nx × nx), ∂ẋ/∂u (nx × nu), ∂ẋ/∂p (nx × np), ∂ẋ/∂t, products with them from the
    right (forward) and from the left (adjoint), and one Runge–Kutta step with its sensitivities.
    They are made when asked for: differentiating costs more than all default functions.
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
        Request("step", STEP, lambda: _step(dynamics, slots)),
        Request("step_sensitivity", SENSITIVITY, lambda: _sensitivity(dynamics, slots)),
    )


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


@dataclass(frozen=True)
class _Stage:
    """ẋ, its guards and d ẋ / d(x₀, u) at one stage."""

    rate: ca.SX
    guards: tuple[ca.SX, ...]
    slope: ca.SX


def _step(dynamics: Function, slots: dict[str, Argument]) -> Function:
    x, h = slots["x"], ca.SX.sym("h")
    stages = _stages(_evaluation(dynamics, slots, sensitive=False), slots, h)
    result = Result("x", x.symbols + _mean([stage.rate for stage in stages], h), x.labels, x.units)
    return Function(
        "step", STEP, result, (), _guards(dynamics, stages), x=_longer(x, h, ("h",), ("s",))
    )


def _sensitivity(dynamics: Function, slots: dict[str, Argument]) -> Function:
    x, h = slots["x"], ca.SX.sym("h")
    stages = _stages(_evaluation(dynamics, slots, sensitive=True), slots, h)
    value = _start(slots) + _mean([stage.slope for stage in stages], h)
    result = Result("S", ca.densify(value), x.labels, (), matrix=True)
    return Function(
        "step_sensitivity",
        SENSITIVITY,
        result,
        (),
        _guards(dynamics, stages),
        x=_longer(x, h, ("h",), ("s",)),
    )


_Evaluation = Callable[[ca.SX, ca.SX, ca.SX], _Stage]


def _evaluation(dynamics: Function, slots: dict[str, Argument], sensitive: bool) -> _Evaluation:
    """(t, x, ∂x/∂(x₀, u)) → the stage there, by the chain rule: ∂ẋ/∂x ∂x/∂(x₀, u) + [0, ∂ẋ/∂u].

    Per stage, this needs less than differentiating all four at once.
    """
    t, x, u, p = (slots[name].symbols for name in "txup")
    f = dynamics.result.value
    by_x, by_u = (
        (ca.jacobian(f, x), ca.jacobian(f, u))
        if sensitive
        else (ca.SX(f.numel(), 0), ca.SX(f.numel(), 0))
    )
    function = ca.Function(
        "stage", [t, x, u, p], [f, by_x, by_u, *(guard.value for guard in dynamics.guards)]
    )

    def at(time: ca.SX, state: ca.SX, slope: ca.SX) -> _Stage:
        """One stage of the step: ẋ there, its guards, and the slope chained through it.

        With k = f(t, X, u) and X' = ∂X/∂(x₀, u), the chain rule gives k' = ∂f/∂x X' + [0, ∂f/∂u]:
        the sensitivity of the stage to the state at the start of the step and to u.
        """
        rate, along_x, along_u, *guards = function.call([time, state, u, p], True, False)
        chained = (
            ca.mtimes(along_x, slope) + ca.horzcat(ca.SX(x.numel(), x.numel()), along_u)
            if sensitive
            else slope
        )
        return _Stage(rate, tuple(guards), chained)

    return at


def _stages(at: _Evaluation, slots: dict[str, Argument], h: ca.SX) -> list[_Stage]:
    t, x = slots["t"].symbols, slots["x"].symbols
    stages = [at(t, x, _start(slots))]
    for part in (0.5, 0.5, 1.0):
        last = stages[-1]
        stages.append(
            at(t + part * h, x + part * h * last.rate, _start(slots) + part * h * last.slope)
        )
    return stages


def _start(slots: dict[str, Argument]) -> ca.SX:
    """∂x/∂(x₀, u) at the beginning: [1, 0]."""
    nx, nu = slots["x"].symbols.numel(), slots["u"].symbols.numel()
    return ca.horzcat(ca.SX.eye(nx), ca.SX(nx, nu))


def _mean(rates: Sequence[ca.SX], h: ca.SX) -> ca.SX:
    first, second, third, fourth = rates
    return h / 6.0 * (first + 2.0 * (second + third) + fourth)


def _guards(dynamics: Function, stages: Sequence[_Stage]) -> tuple[Guard, ...]:
    """Those of every stage."""
    return tuple(
        Guard(f"{guard.name} at stage {number}", value, guard.tolerance, guard.part)
        for number, stage in enumerate(stages, 1)
        for guard, value in zip(dynamics.guards, stage.guards)
    )


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
