"""Enforcements in charts where the dependent velocities stop to follow from the independent ones:
other directions are chosen in time, or the motion ends.

Of derive.enforcement: charts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hamel
from codegen import compiler
from derive.diagnostics import AssumptionError
from derive.enforcement import ENFORCEMENTS, Options, kept_equations
from derive.model import load_text
from derive.states import system
from derive.states.initial import initial_state
from hamel.simulate.exact import state_of
from tests.points import quickly_built
from tests.scenes import RACER

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
END = 1.8141081480  # x after 3 s, by projection at rtol 1e-12


@pytest.fixture
def racer(tmp_path: Path) -> Path:
    path = tmp_path / "racer.yaml"
    path.write_text(RACER)
    return path


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-3, 1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("enforcement", ["partitioning", "tangent", "selective"])
def test_directions_that_have_worn_out_are_left_in_time(
    racer: Path, enforcement: str, rtol: float
) -> None:
    """A step that ended within 5e-4 of a = 0 met the tolerance and was 50 % off in the speed."""
    found = hamel.simulate(
        racer, formulation="augmented", enforcement=enforcement, rtol=rtol, time=3.0, step=3.0
    )
    # twenty steps, each with the error of the independent part, four times as large in what follows
    assert abs(found.final["x"] - END) < 100 * rtol


@pytest.mark.slow
@pytest.mark.parametrize("steps", [{"rtol": 1e-6}, {"integrator": "rk4", "step_size": 0.01}])
def test_directions_for_good_end_where_they_are_worn_out(
    racer: Path, steps: dict[str, float]
) -> None:
    """From a = 60 deg the forward speed is selected, which does not get beyond a = 0."""
    way = {"formulation": "augmented", "time": 3.0, "step": 3.0, "values": {"a": np.radians(60.0)}}
    with pytest.raises(AssumptionError, match="partitioning selects anew"):
        hamel.simulate(racer, enforcement="selective", **way, **steps)
    there = hamel.simulate(racer, enforcement="projection", **way, rtol=1e-9).final
    here = hamel.simulate(racer, enforcement="partitioning", **way, **steps).final
    assert here["x"] == pytest.approx(there["x"], abs=1e-4)


@pytest.mark.slow
def test_motions_side_by_side_leave_them_too(tmp_path: Path) -> None:
    mechanical = system(load_text(RACER))
    enforcement = next(x for x in ENFORCEMENTS if x.name == "partitioning")
    found = kept_equations(mechanical, None, "augmented", enforcement, Options())
    module = quickly_built(found, ["dynamics"], ("dop853",), ("partitioning",), tmp_path)
    p = np.array(mechanical.parameters)
    x = state_of(found, initial_state(mechanical, {}, p), p)
    rows = x * np.linspace(1.0, 1.3, 9)[:, None]
    options = {"enforcement": "partitioning", "rtol": 1e-6, "atol": 1e-8}
    many = module.simulate((0.0, 3.0), rows, [], p, **options)
    ones = [module.simulate((0.0, 3.0), row, [], p, **options) for row in rows]
    assert not many.status.any() and max(many.charts) > 2
    np.testing.assert_allclose(many.x[:, -1], [one.x[-1] for one in ones], atol=1e-7)
    assert abs(many.x[0, -1, 0] - END) < 1e-4
