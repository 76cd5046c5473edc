"""A motion goes on in another choice of quasi-velocities, whatever keeps it on its constraints.

Of hamel.simulate: compiled.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hamel
from derive.formulations import charts
from hamel.simulate import compiled
from tests.derive.formulations.test_covering_charts import held
from tests.scenes import ROOT

FINDING = ROOT / "tests" / "findings" / "rnd19.yaml"  # its first choice fails at 0.6 s


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
