"""Derivatives of ẋ = f(t, x, u, p) on request, by CasADi's differentiation of the same graph; and
what a step and its sensitivity call.

The entries of x count as independent, also where constraints tie coordinates to each other: on the
constraints the derivatives along admissible directions are those of the motion, off them they
depend on how `dynamics` is written. `…_values` hold the entries that are not zero for structural
reasons, row by row; the manifest has their rows and columns. Source: A. Griewank, A. Walther,
Evaluating Derivatives, 2nd ed., SIAM 2008 (forward and adjoint products, chapter 3).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, cached_property

import casadi as ca

from derive.diagnostics import AssumptionError
from derive.expressions.counting import alternatives
from derive.expressions.deferred import Deferred
from derive.expressions.roots import has_bounded_roots, with_finite_slopes
from derive.formulations.contraction import contractions
from derive.formulations.functions import as_loops
from derive.formulations.motion import Motion
from derive.formulations.records import Argument, Elimination, Function, Pattern, Request, Result
from derive.formulations.structured import Slopes, by_structure, looped
from derive.mechanics.records import System

_BY = {"x": "the state", "u": "the inputs", "p": "the parameters"}
RATE = "explicit rate ∂ẋ/∂t of the state derivative"
ALL = "ẋ, ∂ẋ/∂x and ∂ẋ/∂u side by side, [ẋ ∂ẋ/∂x ∂ẋ/∂u]: nx × (1 + nx + nu)"
FORWARD = "derivative of ẋ along (dx, du): ∂ẋ/∂x dx + ∂ẋ/∂u du, from (x, dx, du)"
ADJOINT = "adjoint product [(∂ẋ/∂x)ᵀ y, (∂ẋ/∂u)ᵀ y], from (x, y)"
CONTRACTION = (
    "second-order contraction Σₖ yₖ ∂²ẋₖ [dx, du]: a symmetric matrix times (dx, du), nx + nu, "
    "from (x, y, dx, du)"
)
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
    arguments: Sequence[Argument],
    functions: Sequence[Function],
    mechanics: tuple[System, Motion] | None = None,
) -> tuple[Request, ...]:
    """The requests that follow from `dynamics`; none where the module has no state derivative.

    Jacobians ∂ẋ/∂x (nx × nx), ∂ẋ/∂u (nx × nu), ∂ẋ/∂p (nx × np), ∂ẋ/∂t, products with them from the
    right (forward) and from the left (adjoint), and the steps of a controller with their
    sensitivities, which are loops around some of these. They are made when asked for:
    differentiating costs more than all default functions. With the `mechanics` that ẋ came from
    they are made by structure, where that takes fewer operations.
    """
    dynamics = {function.name: function for function in functions}.get("dynamics")
    if dynamics is None or not dynamics.result.size:
        return ()
    slots = {argument.name: argument for argument in arguments}
    ways = Ways(dynamics, slots, mechanics)
    by = slots | {"p": _parameters(slots["p"], mechanics)}
    requests = (
        *(
            request
            for name in "xup"
            if by[name].labels
            for request in _jacobians(dynamics, by[name], ways)
        ),
        Request("derivatives", ALL, lambda: _all(dynamics, slots, ways)),
        Request("jacobian_t", RATE, lambda: _rate(dynamics, slots["t"])),
        Request("dynamics_forward", FORWARD, lambda: _forward(dynamics, slots, mechanics)),
        Request("dynamics_adjoint", ADJOINT, lambda: _adjoint(dynamics, slots, mechanics)),
        Request(
            "jacobian_forward", JACOBIAN_FORWARD, lambda: _jacobian_forward(dynamics, slots, ways)
        ),
        Request("contraction", CONTRACTION, lambda: _contraction(dynamics, slots, ways)),
        Request("dynamics_hessian", HESSIAN, lambda: _hessian(dynamics, slots, ways)),
        Request("step", STEP, needs=("dynamics", *IMPLICIT)),
        Request("step_sensitivity", SENSITIVITY, needs=("dynamics", *IMPLICIT, *_slopes(slots))),
    )
    rooted = cache(lambda: dynamics.result.written and has_bounded_roots(dynamics.result.value))
    return tuple(_finite(request, rooted) for request in requests)


def _finite(request: Request, rooted: Callable[[], bool]) -> Request:
    """With slopes that are numbers, where `dynamics` takes roots of max(…, 0)."""
    make = request.make
    if make is None:
        return request

    def made() -> Function:
        function = make()
        if not rooted():
            return function
        value = with_finite_slopes(function.result.value)
        return replace(function, result=replace(function.result, value=value))

    return replace(request, make=made)


class Ways:
    """The ways to ∂ẋ/∂x and ∂ẋ/∂u, made when they are first asked for: `dynamics` differentiated
    as it stands, and by structure. Each function takes the one with the fewest operations."""

    def __init__(
        self,
        dynamics: Function,
        slots: dict[str, Argument],
        mechanics: tuple[System, Motion] | None,
    ) -> None:
        self._dynamics, self.slots, self.mechanics = dynamics, slots, mechanics

    @property
    def rates(self) -> ca.SX:
        """ẋ."""
        return self._dynamics.result.value

    @cached_property
    def looped(self) -> Elimination | None:
        """What is solved for, where that is long."""
        return looped(*self.mechanics) if self.mechanics else None

    @cached_property
    def all(self) -> tuple[Slopes, ...]:
        """CasADi's own first: of equal ones it is taken. Where solving is long, structure alone: it
        has never been seen to take more there, and counting would take minutes."""
        structured = by_structure(*self.mechanics) if self.mechanics else iter(())
        if self.looped is not None:
            return (self._masked(next(structured)),)
        plain = Slopes(self.rates, *(ca.jacobian(self.rates, z) for z in self._arguments))
        return tuple(self._masked(slopes) for slopes in (plain, *structured))

    @property
    def _arguments(self) -> tuple[ca.SX, ca.SX]:
        return self.slots["x"].symbols, self.slots["u"].symbols

    @cached_property
    def _patterns(self) -> tuple[ca.Sparsity, ...]:
        return tuple(ca.jacobian_sparsity(self.rates, z) for z in self._arguments)

    def _masked(self, slopes: Slopes) -> Slopes:
        """Without what is zero by the structure of ẋ."""
        by = zip((slopes.by_x, slopes.by_u), self._patterns)
        return Slopes(slopes.rates, *(ca.project(matrix, pattern) for matrix, pattern in by))

    def cheapest(self, of: Callable[[Slopes], ca.SX]) -> Slopes:
        """By the operations of what is made of it."""
        counts = alternatives([of(slopes) for slopes in self.all])
        return self.all[counts.index(min(counts))]

    def jacobian(self, by: Argument) -> ca.SX:
        """∂ẋ/∂x, ∂ẋ/∂u or ∂ẋ/∂p, sparse."""
        if by.name == "x":
            return self.cheapest(lambda slopes: ca.densify(slopes.by_x)).by_x
        if by.name == "u":
            return self.cheapest(lambda slopes: ca.densify(slopes.by_u)).by_u
        return ca.jacobian(self.rates, by.symbols)


def _slopes(slots: dict[str, Argument]) -> tuple[str, ...]:
    """What a step's sensitivity calls besides."""
    return ("jacobian_forward", *(("jacobian_u",) if slots["u"].labels else ()))


def _parameters(p: Argument, mechanics: tuple[System, Motion] | None) -> Argument:
    """Those of the model, without the directions of a frame behind them."""
    if mechanics is None or mechanics[1].frame is None:
        return p
    count = len(p.labels) - len(mechanics[1].frame.labels)
    return replace(p, symbols=p.symbols[:count], labels=p.labels[:count], units=p.units[:count])


def _jacobians(dynamics: Function, by: Argument, ways: Ways) -> tuple[Request, Request]:
    """All of ∂ẋ/∂x and its values alone; likewise for u and p."""
    name = "jacobian" if by.name == "x" else f"jacobian_{by.name}"
    about = f"Jacobian ∂ẋ/∂{by.name} of the state derivative by {_BY[by.name]}, nx × n{by.name}"
    values = f"entries of `{name}` that are not zero by structure, row by row"
    return (
        Request(name, about, lambda: _dense(dynamics, by, name, about, ways)),
        Request(
            f"{name}_values",
            values,
            lambda: _values(dynamics, by, f"{name}_values", values, ways),
            condition=lambda: _check_entries(dynamics, by, f"{name}_values"),
        ),
    )


def _check_entries(dynamics: Function, by: Argument, name: str) -> None:
    """There have to be any entries; a long ẋ is not written out only to tell."""
    if dynamics.result.written and not ca.depends_on(dynamics.result.value, by.symbols):
        raise AssumptionError(f"{name} would be empty: ẋ does not depend on {_BY[by.name]}")


def _dense(dynamics: Function, by: Argument, name: str, about: str, ways: Ways) -> Function:
    value = ca.densify(ways.jacobian(by))
    symbol = "J" if by.name == "x" else f"J{by.name}"
    result = Result(symbol, value, dynamics.result.labels, (), matrix=True)
    return Function(name, about, result, dynamics.named, dynamics.guards)


def _values(dynamics: Function, by: Argument, name: str, about: str, ways: Ways) -> Function:
    jacobian = ways.jacobian(by)
    _check_entries(dynamics, by, name)
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


def _all(dynamics: Function, slots: dict[str, Argument], ways: Ways) -> Function:
    """Where what is solved for is long, by a loop over columns."""
    best = ways.cheapest(lambda slopes: ca.vertcat(slopes.rates, _flat(slopes)))
    value = ca.horzcat(best.rates, best.by_x, best.by_u)
    labels = dynamics.result.labels
    result = Result("D", ca.densify(value), labels, (), matrix=True)
    return Function("derivatives", ALL, result, (), dynamics.guards, solving=ways.looped)


def _flat(slopes: Slopes) -> ca.SX:
    return ca.vertcat(ca.vec(ca.densify(slopes.by_x)), ca.vec(ca.densify(slopes.by_u)))


def _rate(dynamics: Function, t: Argument) -> Function:
    value = ca.densify(ca.jacobian(dynamics.result.value, t.symbols))
    return Function(
        "jacobian_t",
        RATE,
        Result("ft", value, dynamics.result.labels, ()),
        dynamics.named,
        dynamics.guards,
    )


def _forward(
    dynamics: Function, slots: dict[str, Argument], mechanics: tuple[System, Motion] | None
) -> Function:
    """No dx of a parameter: where those matter, jacobian_p has all of them at once."""
    x, u = slots["x"], slots["u"]
    d = [_seeds("d", argument.labels) for argument in (x, u)]
    taken = _longer(
        x, ca.vertcat(*d), (*_marked("d", x.labels), *_marked("d", u.labels)), (*x.units, *u.units)
    )

    def along() -> ca.SX:
        by = ca.vertcat(x.symbols, u.symbols)
        return ca.densify(ca.jtimes(dynamics.result.value, by, ca.vertcat(*d)))

    labels, units = _marked("d", dynamics.result.labels), dynamics.result.units
    result = Result("dxdot", _formed(dynamics, dynamics.result.size, along), labels, units)
    return Function(
        "dynamics_forward",
        FORWARD,
        result,
        dynamics.named,
        dynamics.guards,
        x=taken,
        recursion=as_loops(*mechanics, "dynamics_forward") if mechanics else None,
    )


def _formed(dynamics: Function, size: int, make: Callable[[], ca.SX]) -> ca.SX | Deferred[ca.SX]:
    """On demand where ẋ is."""
    return make() if dynamics.result.written else Deferred(make, size)


def _adjoint(
    dynamics: Function, slots: dict[str, Argument], mechanics: tuple[System, Motion] | None
) -> Function:
    x, u = slots["x"], slots["u"]
    y = _seeds("y", dynamics.result.labels)
    taken = _longer(x, y, _marked("y", dynamics.result.labels), ("",) * y.numel())
    by = ca.vertcat(x.symbols, u.symbols)

    def product() -> ca.SX:
        return ca.densify(ca.jtimes(dynamics.result.value, by, y, True))

    result = Result("product", _formed(dynamics, by.numel(), product), (*x.labels, *u.labels), ())
    return Function(
        "dynamics_adjoint",
        ADJOINT,
        result,
        dynamics.named,
        dynamics.guards,
        x=taken,
        recursion=as_loops(*mechanics, "dynamics_adjoint") if mechanics else None,
    )


def _contraction(dynamics: Function, slots: dict[str, Argument], ways: Ways) -> Function:
    """Of the ways there are the one with the fewest operations."""
    x, u, rates = slots["x"], slots["u"], dynamics.result
    y, z = _seeds("y", rates.labels), ca.vertcat(x.symbols, u.symbols)
    dz = ca.vertcat(*(_seeds("d", argument.labels) for argument in (x, u)))
    plain = ca.jtimes(ca.gradient(ca.dot(y, rates.value), z), z, dz)
    known = [plain, *(contractions(*ways.mechanics, z, y, dz) if ways.mechanics else ())]
    value = ca.densify(cheapest_column(known))
    marks = (*_marked("y", rates.labels), *_marked("d", x.labels), *_marked("d", u.labels))
    units = (*("" for _ in rates.labels), *x.units, *u.units)
    taken = _longer(x, ca.vertcat(y, dz), marks, units)
    result = Result("curvature", value, (*x.labels, *u.labels), ())
    return Function("contraction", CONTRACTION, result, (), dynamics.guards, x=taken)


def cheapest_column(known: Sequence[ca.SX]) -> ca.SX:
    """The one with the fewest operations, the first of equal ones."""
    counts = alternatives(known)
    return known[counts.index(min(counts))]


def _jacobian_forward(dynamics: Function, slots: dict[str, Argument], ways: Ways) -> Function:
    """One product for both: along (d, τ) the rate of ẋ is ∂ẋ/∂x d + ∂ẋ/∂t τ, and this its slope;
    or the rate of [∂ẋ/∂x ∂ẋ/∂u] along (d, τ), as second derivatives are symmetric."""
    t, x, u = slots["t"], slots["x"], slots["u"]
    d = ca.vertcat(_seeds("d", x.labels), ca.SX.sym("d_t"))
    along = ca.jtimes(dynamics.result.value, ca.vertcat(x.symbols, t.symbols), d)
    known = [ca.densify(ca.jacobian(along, ca.vertcat(x.symbols, u.symbols)))]
    for slopes in ways.all:
        entries = ca.vec(ca.horzcat(slopes.by_x, slopes.by_u))
        rate = ca.jtimes(ca.densify(entries), ca.vertcat(x.symbols, t.symbols), d)
        known.append(ca.reshape(rate, known[0].size1(), known[0].size2()))
    counts = alternatives([ca.vec(value) for value in known])
    value = known[counts.index(min(counts))]
    taken = _longer(x, d, (*_marked("d", x.labels), "d t"), (*x.units, "s"))
    result = Result("H", value, dynamics.result.labels, (), matrix=True)
    about = JACOBIAN_FORWARD
    return Function("jacobian_forward", about, result, dynamics.named, dynamics.guards, x=taken)


def _hessian(dynamics: Function, slots: dict[str, Argument], ways: Ways) -> Function:
    """The slope of the adjoint product, one sweep backwards and one forwards for each column; or
    the upper triangle of what the contraction is linear in (dx, du) by, whichever takes fewer
    operations."""
    x, u = slots["x"], slots["u"]
    y, z = _seeds("y", dynamics.result.labels), ca.vertcat(x.symbols, u.symbols)
    plain, _ = ca.hessian(ca.dot(y, dynamics.result.value), z)
    dz = ca.SX.sym("dz", z.numel())
    further = contractions(*ways.mechanics, z, y, dz) if ways.mechanics else ()
    slopes = (ca.jacobian(curvature, dz) for curvature in further)
    known = [plain, *(ca.triu2symm(ca.triu(slope)) for slope in slopes)]
    entries = cheapest_column([ca.densify(ca.vec(matrix)) for matrix in known])
    value = ca.reshape(entries, z.numel(), z.numel())
    taken = _longer(x, y, _marked("y", dynamics.result.labels), ("",) * y.numel())
    labels = (*x.labels, *u.labels)
    result = Result("H", value, labels, (), matrix=True)
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
