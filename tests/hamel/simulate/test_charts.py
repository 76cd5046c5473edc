"""A motion goes on in another choice of quasi-velocities, whatever keeps it on its constraints.

Of hamel.simulate: compiled.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hamel
from derive.formulations import charts, equations
from derive.model import load_text
from derive.states import system
from hamel.simulate import compiled
from tests.derive.formulations.test_covering_charts import held
from tests.scenes import ROOT

FINDING = ROOT / "tests" / "findings" / "rnd19.yaml"  # its first choice fails at 0.6 s


BEGUN = """
model: begun
plane: xy
gravity: [0, -9.81 m/s^2]
bodies:
  a: {mass: 1 kg, com: [0.1 m, 0], inertia: 0.01 kg*m^2}
  b: {mass: 1 kg, com: [0.1 m, 0], inertia: 0.01 kg*m^2}
joints:
  j: {type: revolute, parent: ground, child: a}
  k: {type: revolute, parent: a, child: b, at: [0.2 m, 0]}
quasi_velocities: {turned: [sin(j)*der(j), der(k)]}
"""


def test_a_choice_that_is_singular_at_the_start_is_told() -> None:
    """Not that of another start."""
    there, beside = (
        equations(system(load_text(f"{BEGUN}initial: {{j: {angle} rad}}"))) for angle in (0, 0.3)
    )
    assert any("'turned' does not tell the velocities" in x for x in there.assumptions)
    assert not any("does not tell" in x for x in beside.assumptions)


@pytest.mark.slow
def test_a_motion_begins_in_another_choice_without_constraints_too(tmp_path: Path) -> None:
    """It was refused, as if the position were singular."""
    path = tmp_path / "begun.yaml"
    path.write_text(BEGUN)
    found, usual = (
        hamel.simulate(path, choice=name, time=1.0, step=0.1, rtol=1e-10)
        for name in ("turned", "auto")
    )
    assert "orthonormal" in found.switches[0].entered
    ends = [[one.motion[name][-1] for name in ("j", "k")] for one in (found, usual)]
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("enforcement", ["feedback", "tangent"])
def test_choices_take_over_under_every_enforcement(enforcement):
    """Those on rates and stages ended where the first choice alone is singular."""
    found = hamel.simulate(FINDING, time=1.0, step=0.5, rtol=1e-9, enforcement=enforcement)
    usual = hamel.simulate(FINDING, time=1.0, step=0.5, rtol=1e-9)
    assert any("orthonormal" in switch.entered for switch in found.switches)
    names = [name for name in found.motion if name.startswith("q")]
    ends = [[one.motion[name][-1] for name in names] for one in (found, usual)]
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-7)


@pytest.mark.slow
def test_partitions_take_over_where_orthonormal_is_too_dense(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A rope of ten balls between two posts was not simulated within minutes."""
    path = tmp_path / "held.yaml"
    path.write_text(held(8))
    usual = hamel.simulate(path, time=1.0, step=0.01, rtol=1e-10)
    assert any("orthonormal" in switch.entered for switch in usual.switches)
    for module, name in ((charts, "DENSE"), (compiled, "TOO_DENSE")):
        monkeypatch.setattr(module, name, 4)
    found = hamel.simulate(path, time=1.0, step=0.01, rtol=1e-10)
    assert found.switches
    assert not any("orthonormal" in switch.entered for switch in found.switches)
    names = [name for name in found.motion if name.startswith("q")]
    ends = [[one.motion[name][-1] for name in names] for one in (found, usual)]
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-6)
