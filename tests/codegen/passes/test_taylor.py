"""Taylor coefficients by recurrences over a program: every operation gives the series that many
digits give.

Of codegen.passes: recurrences, series.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import casadi as ca
import mpmath
import numpy as np
import pytest

from codegen import compiler
from codegen.passes import program
from codegen.passes import taylor as passes
from codegen.passes.recurrences import Recurrences
from codegen.passes.taylor import HIGHEST, series
from codegen.program import Load
from derive.diagnostics import AssumptionError
from derive.formulations.records import Argument, Equations, Function, Result
from hamel.build.module import published
from tests.scenes import derived

needs_compiler = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
X, Y = (0.3, 0.7), (1.2, -0.4)  # values and rates of the two operands
RULES: dict[str, tuple[Callable[..., Any], Callable[..., Any]]] = {
    "add": (lambda x, y: x + y, lambda x, y: x + y),
    "sub": (lambda x, y: x - y, lambda x, y: x - y),
    "mul": (lambda x, y: x * y, lambda x, y: x * y),
    "square": (lambda x, y: x * x, lambda x, y: x * x),
    "div": (lambda x, y: x / y, lambda x, y: x / y),
    "inverse": (lambda x, y: 1 / x, lambda x, y: 1 / x),
    "sqrt": (lambda x, y: ca.sqrt(x), lambda x, y: mpmath.sqrt(x)),
    "exp": (lambda x, y: ca.exp(x), lambda x, y: mpmath.exp(x)),
    "expm1": (lambda x, y: ca.expm1(x), lambda x, y: mpmath.expm1(x)),
    "log": (lambda x, y: ca.log(x), lambda x, y: mpmath.log(x)),
    "log1p": (lambda x, y: ca.log1p(x), lambda x, y: mpmath.log1p(x)),
    "sin": (lambda x, y: ca.sin(x * y), lambda x, y: mpmath.sin(x * y)),
    "cos": (lambda x, y: ca.cos(x), lambda x, y: mpmath.cos(x)),
    "tan": (lambda x, y: ca.tan(x), lambda x, y: mpmath.tan(x)),
    "asin": (lambda x, y: ca.asin(x), lambda x, y: mpmath.asin(x)),
    "acos": (lambda x, y: ca.acos(x), lambda x, y: mpmath.acos(x)),
    "atan": (lambda x, y: ca.atan(x), lambda x, y: mpmath.atan(x)),
    "atan2": (lambda x, y: ca.atan2(y, -x), lambda x, y: mpmath.pi - mpmath.atan(y / x)),
    "sinh": (lambda x, y: ca.sinh(x), lambda x, y: mpmath.sinh(x)),
    "cosh": (lambda x, y: ca.cosh(y), lambda x, y: mpmath.cosh(y)),
    "tanh": (lambda x, y: ca.tanh(x), lambda x, y: mpmath.tanh(x)),
    "asinh": (lambda x, y: ca.asinh(x), lambda x, y: mpmath.asinh(x)),
    "acosh": (lambda x, y: ca.acosh(y), lambda x, y: mpmath.acosh(y)),
    "atanh": (lambda x, y: ca.atanh(x), lambda x, y: mpmath.atanh(x)),
    "erf": (lambda x, y: ca.erf(x), lambda x, y: mpmath.erf(x)),
    "hypot": (ca.hypot, mpmath.hypot),
    "power": (lambda x, y: x**2.5, lambda x, y: x**2.5),
    "exponent": (lambda x, y: 2.0**y, lambda x, y: mpmath.mpf(2) ** y),
    "powers": (lambda x, y: x**y, lambda x, y: x**y),
    "whole": (lambda x, y: x**-3, lambda x, y: x**-3),
    "fabs": (lambda x, y: ca.fabs(-x), lambda x, y: x),
    "sign": (lambda x, y: ca.sign(-x) * x, lambda x, y: -x),
    "copysign": (lambda x, y: ca.copysign(x, -y), lambda x, y: -x),
    "least": (ca.fmin, lambda x, y: x),
    "largest": (ca.fmax, lambda x, y: y),
    "remainder": (lambda x, y: ca.fmod(y, x), lambda x, y: y - 4 * x),
    "where": (lambda x, y: ca.if_else(x < y, x * y, ca.sqrt(-x)), lambda x, y: x * y),
}


def made_of(functions: dict[str, Callable[..., Any]]) -> Equations:
    """x' and y' constant, and a rate for each function of them: its integral."""
    x = ca.SX.sym("x", 2 + len(functions))
    labels = ("x", "y", *(f"z_{name}" for name in functions))
    rates = ca.vertcat(X[1], Y[1], *(function(x[0], x[1]) for function in functions.values()))
    units = ("",) * len(labels)
    dynamics = Function("dynamics", "all of them", Result("xdot", rates, labels, units))
    slots = {"t": (ca.SX.sym("t"), ("t",), ("s",)), "x": (x, labels, units)}
    empty = (ca.SX(0, 1), (), ())
    arguments = tuple(Argument(name, *slots.get(name, empty)) for name in "txup")
    model = SimpleNamespace(name="rules", description="", fixed=())
    system: Any = SimpleNamespace(
        model=model, constants=(), quaternions=(), links=(), phi=ca.SX(0, 1)
    )
    return Equations(system, "quasi-velocities", "one", "", arguments, (dynamics,), (), (), (), ())


def expansion(equations: Equations, folder: Path) -> Callable[[list[float], int], np.ndarray]:
    """x, order → coefficients by the generated code: a row of each order, without the work."""
    made = program(equations, ("dynamics",), ("taylor",))
    place = published(made, folder).folder / compiler.shared_library(made.name)
    function = getattr(ctypes.CDLL(str(place)), f"{made.name}_taylor")

    def rows(x: list[float], order: int) -> np.ndarray:
        out, start = np.zeros((order + 1, len(x) + 1)), np.array(x)
        time, nothing = ctypes.c_double(0.0), ctypes.c_void_p(None)
        state = ctypes.c_void_p(start.ctypes.data)
        assert function(time, state, *(nothing,) * 4, order, ctypes.c_void_p(out.ctypes.data)) == 0
        return out[:, :-1]

    return rows


@needs_compiler
def test_every_operation_has_the_series_of_many_digits(tmp_path: Path) -> None:
    order = 14
    code = {name: rule[0] for name, rule in RULES.items()}
    start = [X[0], Y[0], *(0.0,) * len(RULES)]
    found = expansion(made_of(code), tmp_path / "rules")(start, order)
    with mpmath.workdps(60):
        for k, (name, (_, rule)) in enumerate(RULES.items(), 2):
            wanted = mpmath.taylor(
                lambda t, rule=rule: rule(
                    mpmath.mpf(X[0]) + mpmath.mpf(X[1]) * t, mpmath.mpf(Y[0]) + mpmath.mpf(Y[1]) * t
                ),
                0,
                order - 1,
            )
            wanted = np.array([float(w) / (n + 1) for n, w in enumerate(wanted)])
            scale = np.abs(wanted) + 1e-3 * np.abs(wanted).max()
            error = np.abs(found[1:, k] - wanted) / scale
            assert error.max() < 1e-11, name


@needs_compiler
@pytest.mark.parametrize("count", [1, 3, 7, 9, 17])
def test_any_number_of_products_and_any_order(count: int, tmp_path: Path) -> None:
    """Sums of whole vectors, of what is left over, and of no order but the first."""
    code = {f"s{k}": lambda x, y, k=k: x * (x + (k + 1) * y) for k in range(count)}
    rows = expansion(made_of(code), tmp_path / "products")
    x, y = np.poly1d(X[::-1]), np.poly1d(Y[::-1])
    for order in (1, 2, 3, 4, 5, HIGHEST):
        found = rows([X[0], Y[0], *(0.0,) * count], order)
        for k in range(count):
            wanted = np.zeros(HIGHEST + 4)
            wanted[:4] = (x * (x + (k + 1) * y)).integ().coeffs[::-1]
            full = wanted[: order + 1]
            np.testing.assert_allclose(found[:, 2 + k], full, rtol=1e-14, atol=1e-15)


def test_equal_products_have_one_slot_and_constants_none() -> None:
    code = {"a": lambda x, y: 2 * x * y, "b": lambda x, y: 3 * y * x, "c": lambda x, y: 5 * x}
    found = series(program(made_of(code), ("dynamics",), ("taylor",)))
    assert len(found.slots) == 1


@pytest.mark.parametrize("operation", ["sin", "cos"])
def test_a_sine_of_what_does_not_vary_comes_with_its_cosine(operation: str) -> None:
    """They are written by one call. Of a parameter alone there was no partner: the statement behind
    it was taken for that."""
    tape = Recurrences()
    tape.loads["p", 0] = Load("p0", "p", 0)
    tape.put(operation, "p0")
    tape.put("mul", "p0", "p0")
    kinds = [statement.value[0] for statement in tape.start if isinstance(statement.value, tuple)]
    assert sorted(kinds[:2]) == ["cos", "sin"] and kinds[2:] == ["mul"]


def test_sums_of_sums_are_one_step() -> None:
    """What one later sum alone needs is no step of its own."""
    code = {"a": lambda x, y: x * y + ca.sin(x) * y - 3 * (x - y * y)}
    found = series(program(made_of(code), ("dynamics",), ("taylor",)))
    shown = {slot.left for slot in found.slots} | {slot.right for slot in found.slots}
    names = {step.name for step in found.steps}
    assert len(names) == 4  # sine, cosine, the factor of y and the rate
    assert len(names - shown) == 1


def test_too_long_a_program_is_refused_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(passes, "MOST_SLOTS", 20)
    with pytest.raises(AssumptionError, match=r"taylor does not fit four_bar: .* more than the 20"):
        program(derived("four_bar"), None, ("taylor",))
