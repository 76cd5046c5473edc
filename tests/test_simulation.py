"""The generated integrator: accurate, on the constraints, the same in C, ctypes and NumPy, and honest when it must stop."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from fractions import Fraction
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from codegen import build, compiler, loader
from codegen.integrators import INTEGRATORS, Tableau
from codegen.passes import program
from tests.toy import circle

needs_compiler = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")


@pytest.fixture(scope="module")
def module(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    base = tmp_path_factory.mktemp("simulation")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        return loader.load(build.build(program(circle()), base / "circle").folder)


def ways(module: ModuleType) -> list[tuple[str, Callable[..., int]]]:
    found = [("numpy", importlib.import_module(f"{module.__name__}._simulate").advance)]
    if module.backend == "extension":
        found.append(("ctypes", importlib.import_module(f"{module.__name__}._library").advance))
    return found


@pytest.mark.parametrize("tableau", INTEGRATORS, ids=lambda tableau: tableau.name)
def test_order_conditions(tableau: Tableau) -> None:
    b = [*tableau.a[-1], Fraction(0)]
    for c, a in zip(tableau.c, tableau.a):
        assert sum(a) == c
    for power in range(tableau.order):
        assert sum(w * c**power for w, c in zip(b, tableau.c)) == Fraction(1, power + 1)
        low = sum((w - e) * c**power for w, e, c in zip(b, tableau.error, tableau.c))
        assert low == Fraction(1, power + 1) or power == tableau.order - 1
    assert sum(tableau.error) == 0


def test_motion_work_and_constraint(module: ModuleType) -> None:
    times = np.linspace(0, 5, 41)
    found = module.simulate(times, [1.0, 0.0], [0.7], rtol=1e-11, atol=1e-13)
    expected = np.column_stack([np.cos(2 * times), np.sin(2 * times)])
    np.testing.assert_allclose(found.x, expected, atol=2e-10)
    np.testing.assert_allclose(found.work, 0.7 * (1 - np.cos(2 * times)) / 2, atol=1e-10)
    np.testing.assert_allclose((found.x**2).sum(axis=1), 1, atol=1e-14)
    assert found.position_violation < 1e-13 and found.status == "ok" and found.steps > 40
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
    rest: tuple[Any, ...] = ([1.0, 0.0], [0.3], [1.5], 1e-8, 1e-10, [0.5, 0.5, 2.0, 7.25], 10_000, None)
    first = module.simulate((0.0, 1.0), [1.0, 0.0], [0.3], [1.5], rtol=1e-8, atol=1e-10, times=[0.5, 0.5, 2.0, 7.25])
    for backend, advance in ways(module):
        other = run(advance, backend, (0.0, 1.0), *rest)
        assert (other.steps, other.rejected, other.calls) == (first.steps, first.rejected, first.calls)
        np.testing.assert_allclose(other.x, first.x, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(other.work, first.work, rtol=1e-12, atol=1e-12)


def test_it_stops_at_a_singular_position(module: ModuleType) -> None:
    with pytest.raises(FloatingPointError, match=r"circle.simulate stopped at t = 8\.99") as error:
        module.simulate((0.0, 20.0), [1.0, 0.0], times=[3.0, 8.0, 20.0])
    partial = error.value.partial
    assert np.isfinite(partial.x[:2]).all() and np.isnan(partial.x[2]).all() and partial.status != "ok"


def test_it_stops_after_many_steps(module: ModuleType) -> None:
    with pytest.raises(FloatingPointError, match="too many steps"):
        module.simulate((0.0, 5.0), [1.0, 0.0], max_steps=7)


def test_progress_is_told(module: ModuleType) -> None:
    seen: list[float] = []
    simulate = importlib.import_module(f"{module.__name__}._simulate")
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(simulate.BUDGET, module.backend, 20)
        module.simulate((1.0, 6.0), [1.0, 0.0], progress=seen.append)
    assert len(seen) > 3 and seen == sorted(seen) and seen[-1] == 5.0


@pytest.mark.parametrize(
    "arguments",
    [
        {"t_span": (1.0, 0.0)},
        {"t_span": (0.0, np.inf)},
        {"t_span": (0.0, 1.0), "x": [1.0]},
        {"t_span": (0.0, 1.0), "x": [[1.0, 0.0]] * 2},
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
