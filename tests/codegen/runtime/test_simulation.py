"""The generated integrator: accurate, on the constraints, the same in C, ctypes and NumPy, and
honest when it must stop.

Of codegen.runtime: events, simulation.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from codegen import compiler, loader
from codegen.integrators import INTEGRATORS, Collocation, Integrator, Tableau
from codegen.passes import program
from derive.formulations.derivatives import derivatives
from hamel.build.module import published
from tests.toy import circle

needs_compiler = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")


@pytest.fixture(scope="module")
def module(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    base = tmp_path_factory.mktemp("simulation")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        equations = circle()
        equations = replace(
            equations, requests=derivatives(equations.arguments, equations.functions)
        )
        names = ("dopri5", *(method.name for method in INTEGRATORS if method.name != "dopri5"))
        return loader.load(published(program(equations, integrators=names), base / "circle").folder)


def ways(module: ModuleType) -> list[tuple[str, Callable[..., int]]]:
    found = [("numpy", importlib.import_module(f"{module.__name__}._simulate").advance)]
    if module.backend == "extension":
        found.append(("ctypes", importlib.import_module(f"{module.__name__}._library").advance))
    return found


# Orders of the solutions the step is compared with.
LOW = {"dop853": (5, 3), "verner9": (8,), "dopri5": (4,), "rkf45": (4,), "rk4": ()}


@pytest.mark.parametrize(
    "tableau", [x for x in INTEGRATORS if isinstance(x, Tableau)], ids=lambda tableau: tableau.name
)
def test_order_conditions(tableau: Tableau) -> None:
    """Of quadrature and of c; decimals are rounded to 28 digits."""
    tiny = Fraction(1, 10**26)
    for c, a in zip(tableau.c, tableau.a):
        assert abs(sum(a) - c) < tiny
    for power in range(tableau.order):
        assert (
            abs(
                sum(w * c**power for w, c in zip(tableau.a[-1], tableau.c)) - Fraction(1, power + 1)
            )
            < tiny
        )
    for error, low in zip(tableau.errors, LOW[tableau.name], strict=True):
        moments = [
            abs(sum(e * c**power for e, c in zip(error, tableau.c))) for power in range(low + 1)
        ]
        assert all(moment < tiny for moment in moments[:low]) and moments[low] > tiny


@pytest.mark.parametrize(
    "method", [x for x in INTEGRATORS if isinstance(x, Collocation)], ids=lambda method: method.name
)
def test_collocation(method: Collocation) -> None:
    """A = T Λ⁻¹ T⁻¹ integrates polynomials up to every c, b up to 1, and the solution compared with
    is of order one less."""
    c, T, inverse = (
        np.array(values, dtype=float) for values in (method.c, method.T, method.inverse)
    )
    blocks = np.zeros_like(T)
    blocks[0, 0] = method.real
    for k, (alpha, beta) in enumerate(method.pairs):
        blocks[1 + 2 * k : 3 + 2 * k, 1 + 2 * k : 3 + 2 * k] = [[alpha, beta], [-beta, alpha]]
    A = T @ np.linalg.inv(blocks) @ inverse
    powers = np.arange(len(c))
    tight = {"rtol": 0.0, "atol": 2e-14}
    np.testing.assert_allclose(
        A @ c[:, None] ** powers, c[:, None] ** (powers + 1) / (powers + 1), **tight
    )
    np.testing.assert_allclose(np.array(method.b, dtype=float), A[-1], **tight)
    powers = np.arange(method.order)
    np.testing.assert_allclose(A[-1] @ c[:, None] ** powers, 1 / (powers + 1), **tight)
    # with the weight of the slope at the start, the weights of the estimate add up to nothing up to
    # the power s − 1
    weights = np.array(method.error, dtype=float) @ A
    moments = [float(k == 0) + weights @ c**k for k in range(len(c) + 1)]
    np.testing.assert_allclose(moments[:-1], 0.0, atol=1e-13)
    assert abs(moments[-1]) > 1e-3


@needs_compiler
@pytest.mark.parametrize(
    "method", [x for x in INTEGRATORS if x.order], ids=lambda method: method.name
)
def test_order_with_equal_steps(module: ModuleType, method: Integrator) -> None:
    errors = []
    for h in {8: (0.4, 0.2), 9: (0.8, 0.4)}.get(method.order, (0.1, 0.05)):
        found = module.simulate(
            (0.0, 4.0), [1.0, 0.0], integrator=method.name, step_size=h, enforcement="none"
        )
        errors.append(np.abs(found.x[-1] - [np.cos(8.0), np.sin(8.0)]).max())
        assert found.steps == round(4.0 / h)
    above = (
        1.5 if method.order == 9 else 0.15
    )  # its leading error is so small that the next ones show down to rounding
    assert -0.15 < np.log2(errors[0] / errors[1]) - method.order < above


def test_motion_work_and_constraint(module: ModuleType) -> None:
    times = np.linspace(0, 5, 41)
    found = module.simulate(times, [1.0, 0.0], [0.7], rtol=1e-11, atol=1e-13)
    expected = np.column_stack([np.cos(2 * times), np.sin(2 * times)])
    np.testing.assert_allclose(found.x, expected, atol=2e-10)
    np.testing.assert_allclose(found.work, 0.7 * (1 - np.cos(2 * times)) / 2, atol=1e-10)
    np.testing.assert_allclose((found.x**2).sum(axis=1), 1, atol=1e-14)
    assert (
        found.position_violation < 1e-13 and found.status == module.Status.OK and found.steps > 40
    )
    assert found.calls >= 6 * (found.steps + found.rejected)


def test_error_follows_the_tolerance(module: ModuleType) -> None:
    errors = []
    for rtol in (1e-5, 1e-7, 1e-9):
        end = module.simulate((0.0, 4.0), [1.0, 0.0], rtol=rtol, atol=rtol).x[-1]
        errors.append(np.abs(end - [np.cos(8.0), np.sin(8.0)]).max())
    assert errors[0] < 1e-3 and errors[1] < errors[0] / 10 and errors[2] < errors[1] / 10


@needs_compiler
def test_all_ways_take_the_same_steps(module: ModuleType) -> None:
    run = importlib.import_module(f"{module.__name__}._simulate").run
    rest: tuple[Any, ...] = (
        [1.0, 0.0],
        [0.3],
        [1.5],
        1e-8,
        1e-10,
        [0.5, 0.5, 2.0, 7.25],
        10_000,
        None,
    )
    first = module.simulate(
        (0.0, 7.25), [1.0, 0.0], [0.3], [1.5], rtol=1e-8, atol=1e-10, times=[0.5, 0.5, 2.0, 7.25]
    )
    for backend, advance in ways(module):
        other = run(advance, backend, (0.0, 7.25), *rest)
        assert (other.steps, other.rejected, other.calls) == (
            first.steps,
            first.rejected,
            first.calls,
        )
        np.testing.assert_allclose(other.x, first.x, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(other.work, first.work, rtol=1e-12, atol=1e-12)


@needs_compiler
@pytest.mark.parametrize(
    "options",
    [{"integrator": "dop853"}, {"integrator": "rk4", "step_size": 0.1}, {"enforcement": "none"}],
    ids=str,
)
def test_numpy_takes_the_same_steps(module: ModuleType, options: dict[str, Any]) -> None:
    simulate = importlib.import_module(f"{module.__name__}._simulate")
    first = module.simulate((0.0, 3.0), [1.0, 0.0], **options)
    rest: tuple[Any, ...] = ([1.0, 0.0], [0.0], None, 1e-9, 1e-11, None, 10_000, None)
    names = [options.get(name) for name in ("integrator", "enforcement", "step_size")]
    other = simulate.run(simulate.advance, "numpy", (0.0, 3.0), *rest, *names)
    assert (other.steps, other.rejected, other.calls) == (first.steps, first.rejected, first.calls)
    np.testing.assert_allclose(other.x, first.x, rtol=1e-12, atol=1e-12)


def test_what_cannot_be_is_refused(module: ModuleType) -> None:
    simulate = importlib.import_module(f"{module.__name__}._simulate")
    with pytest.raises(ValueError, match="no integrator 'euler' here; it has dopri5, "):
        module.simulate((0.0, 1.0), [1.0, 0.0], integrator="euler")
    with pytest.raises(ValueError, match="needs a step_size for rk4"):
        module.simulate((0.0, 1.0), [1.0, 0.0], integrator="rk4")
    with pytest.raises(FloatingPointError, match="needs compiled code"):
        simulate.run(
            simulate.advance,
            "numpy",
            (0.0, 1.0),
            [1.0, 0.0],
            [0.0],
            None,
            1e-9,
            1e-11,
            None,
            99,
            None,
            "implicit_midpoint",
            None,
            0.1,
        )


def test_it_stops_at_a_singular_position(module: ModuleType) -> None:
    with pytest.raises(FloatingPointError, match=r"circle.simulate stopped at t = 8\.99") as error:
        module.simulate((0.0, 20.0), [1.0, 0.0], times=[3.0, 8.0, 20.0])
    partial = error.value.partial
    assert (
        np.isfinite(partial.x[:2]).all()
        and np.isnan(partial.x[2]).all()
        and partial.status == module.Status.SINGULAR
    )


def test_it_stops_after_many_steps(module: ModuleType) -> None:
    with pytest.raises(FloatingPointError, match="too many steps"):
        module.simulate((0.0, 5.0), [1.0, 0.0], max_steps=7)


def test_progress_is_told(module: ModuleType) -> None:
    seen: list[float] = []
    one_motion = importlib.import_module(f"{module.__name__}._one_motion")
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(one_motion.BUDGET, module.backend, 20)
        module.simulate((1.0, 6.0), [1.0, 0.0], progress=seen.append)
    assert len(seen) > 3 and seen == sorted(seen) and seen[-1] == 5.0


@pytest.mark.parametrize(
    "arguments",
    [
        {"t_span": (1.0, 0.0)},
        {"t_span": (0.0, np.inf)},
        {"t_span": (0.0, 1.0), "x": [1.0]},
        {"t_span": (0.0, 1.0), "rtol": 0.0},
        {"t_span": (0.0, 1.0), "times": [-1.0, 1.0]},
    ],
)
def test_bad_arguments(module: ModuleType, arguments: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"needs|takes"):
        module.simulate(**{"x": [1.0, 0.0], **arguments})


def test_start_that_is_not_finite(module: ModuleType) -> None:
    with pytest.raises(FloatingPointError, match="not finite"):
        module.simulate((0.0, 1.0), [np.nan, 0.0])
