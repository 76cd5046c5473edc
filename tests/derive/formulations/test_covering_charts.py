"""The charts of a module whose choice is left open go on wherever the constraints do."""

from __future__ import annotations

import numpy as np
import pytest

from derive.formulations import equations
from derive.mechanics.records import System
from derive.model import load_text
from derive.robots.reading import load
from derive.states import system
from derive.states.initial import initial_state
from hamel import charts
from hamel.build.module import temporary_module
from tests.scenes import MODELS

FINDINGS = MODELS.parent / "tests" / "findings"


def mechanics(name: str) -> System:
    return system(load(FINDINGS / f"{name}.yaml"))


@pytest.mark.parametrize(
    "name",
    [
        "rnd19",
        pytest.param("rnd16", marks=pytest.mark.slow),
        pytest.param("rnd124", marks=pytest.mark.slow),
    ],
)
def test_partitions_that_may_fail_together_are_followed_by_the_orthonormal_choice(
    name: str,
) -> None:
    """Every pivot changes sign between the sampled states: no pair of partitions is far from
    singular at all of them."""
    made = equations(mechanics(name), charts=True, moving=True)
    assert [chart.choice for chart in made.charts] == ["orthonormal"]


def test_long_chains_held_at_both_ends_have_partitions_for_charts() -> None:
    """The orthonormal choice is dense: it took ten times the operations of a partition."""
    links = 14
    made = equations(system(load_text(held(links))), charts=True, moving=True)
    assert made.charts
    for chart in made.charts:
        assert len(chart.choice.split()) == links - 1 and chart.choice != made.choice
    assert "charts auto, all but q" in made.assumptions[-1]


def held(links: int) -> str:
    """A planar chain with a bar between its first and its last link."""
    return f"""
model: held
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {{l: 0.3 m, m: 1 kg}}
repeat: {{i: 1..{links - 1}}}
bodies:
  b0: {{mass: m, com: [l/2, 0], inertia: 0.008}}
  "b{{i}}": {{mass: m, com: [l/2, 0], inertia: 0.008}}
joints:
  j0: {{type: revolute, parent: ground, child: b0, coordinate: q0}}
  "j{{i}}": {{type: revolute, parent: "b{{i-1}}", child: "b{{i}}", at: [l, 0], coordinate: "q{{i}}"}}
constraints:
  h: {{type: distance, between: [b0, b{links - 1}], at: [[l, 0], [l, 0]], length: 1.2 m}}
initial: {{q0: 10 deg, "q{{i}}": 7 deg}}
"""


@pytest.mark.slow
def test_a_module_without_a_named_choice_goes_on_where_partitions_fail_together() -> None:
    """It stopped at 0.919 s between two partitions that are singular there together, where A has
    full rank."""
    made = equations(mechanics("rnd19"), charts=True, moving=True)
    start = initial_state(made.system)
    u, p = np.zeros(made.system.u.numel()), np.array(made.parameters)
    with temporary_module(made) as module:
        x, chart, p = charts.start(module, start, u, p)
        course = module.simulate(np.linspace(0.0, 3.0, 61), x, u, p, chart=chart)
        assert course.status.name == "OK" and course.t[-1] == 3.0
        assert 1 in course.chart and course.position_violation < 1e-10
