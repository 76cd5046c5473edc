"""The uses that examples/ shows come out as they should, at a smaller size."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from tests.scenes import ROOT


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, ROOT / "examples" / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_bicycle_is_stable_between_its_critical_speeds(tmp_path: Path) -> None:
    """At the benchmark's trail: weave speed 4.292 m/s, capsize speed 6.024 m/s (Meijaard et al.,
    2007)."""
    growth = example("bicycle_stability_map").stability(41, out=tmp_path).to_xarray()["growth"]
    line = growth.sel(c=0.08)
    stable = line.speed.values[line.values < 0]
    assert 4.29 < stable.min() < 4.55 and 5.7 < stable.max() < 6.03
    assert np.isfinite(growth).all()


@pytest.mark.slow
def test_the_basin_of_the_pole_is_about_upright(tmp_path: Path) -> None:
    _, data = example("cart_pole_basin").basin(15, out=tmp_path)
    middle = data.sel({"th": 0, "der(th)": 0}, method="nearest")
    assert bool(middle.caught) and 0.02 < float(data.caught.mean()) < 0.9
    # the mechanism is symmetric, and so is the basin
    assert (data.caught.values == data.caught.values[::-1, ::-1]).mean() > 0.97


@pytest.mark.slow
def test_tolerances_of_the_coupler_curve(tmp_path: Path) -> None:
    record = example("four_bar_tolerances").tolerances(400, out=tmp_path)
    top = record.kept[0]
    assert top.count == 400 and 1e-5 < top.deviation < 1e-3 and not record.failed


@pytest.mark.slow
def test_sobol_indices_of_the_waveboard(tmp_path: Path) -> None:
    record = example("waveboard_sobol").indices(512, out=tmp_path)
    found = record.sensitivities["growth"]
    assert not record.failed and max(found["total"]) > 0.3
    assert sum(found["first"]) < 1.2


@pytest.mark.slow
def test_random_mechanisms_are_reported(tmp_path: Path) -> None:
    """A chain and a loop, by two formulations; what is fast is among what is exact enough."""
    random = example("random_mechanisms")
    record = random.reported(
        2, out=tmp_path, formulations=["quasi_velocities", "augmented"], integrators=["dop853"],
        budget=20.0,
    )  # fmt: skip
    assert record.passed and len(record.models) == 2
    best = random.fastest(record.rows)
    assert sum(best.values()) == 2
    assert {integrator for _, integrator in best} == {"dop853"}
    assert random.mechanism(3) == random.mechanism(3) != random.mechanism(5)


@pytest.mark.slow
def test_the_snake_comes_nearer(tmp_path: Path) -> None:
    snake = example("mppi_snake")
    away, _ = snake.driven(snake.snake(tmp_path / "snake3"), 4.0, rollouts=512)
    assert away[-1] < 0.75 * np.linalg.norm(snake.GOAL)
