"""What a column of a sweep is called, and which numbers stand in it: no name stands for two things,
and what is cut stays within its cuts.

Of hamel.sweep: kept, plan, quantiles.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import truncnorm

import hamel
from derive.diagnostics import ModelError
from hamel.sweep.quantiles import QUANTILES

ROD = """
model: rod
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {m: 2 kg, l: 0.5 m, motion: 1 kg, sample: 1 kg, status: 1 kg, row: 1 kg}
bodies: {rod: {mass: m + motion + sample + status + row, com: [0, -l/2], inertia: m*l^2/12}}
joints: {hinge: {type: revolute, parent: ground, child: rod, coordinate: q}}
initial: {q: 60 deg}
"""
DRAWN = {"q": "normal(1, 0.1)"}


@pytest.fixture
def rod(tmp_path: Path) -> Path:
    (tmp_path / "rod.yaml").write_text(ROD)
    return tmp_path / "rod.yaml"


@pytest.mark.parametrize("name", ["motion", "status"])
def test_a_coordinate_called_like_a_column_of_every_sweep(name: str, tmp_path: Path) -> None:
    """It gave the number of the motion, or how it ended."""
    text = ROD.replace("coordinate: q", f"coordinate: {name}").replace("{q: 60", f"{{{name}: 60")
    text = text.replace(f"{name}: 1 kg, ", "").replace(f"{name} + ", "")
    (tmp_path / "odd.yaml").write_text(text)
    found = hamel.sweep(
        tmp_path / "odd.yaml", vary={"m": [1.0, 2.0]}, time=0.01, out=tmp_path / "out"
    )
    assert found.kept[0].name == f"final({name})"
    rows = found.to_xarray()
    assert rows[f"final({name})"].values == pytest.approx(np.radians(60.0), abs=0.01)
    assert (rows["status"].values == 0).all()


@pytest.mark.parametrize(
    ("keep", "more"),
    [
        ("motion = q", {}),
        ("status = q", {}),
        ("m = highest(q)", {}),
        ("m = highest(m)", {}),
        ("sample = q", {"vary": DRAWN, "samples": 3}),
        ("row = q", {"vary": {}, "files": ["runs.csv"]}),
        ("integrator = q", {"vary": {"integrator": "dop853,rk4", "step_size": [0.01]}}),
    ],
)
def test_a_given_name_that_another_column_has_is_refused(
    keep: str, more: dict[str, Any], rod: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(rod.parent)
    Path("runs.csv").write_text("m\n1\n2\n")
    given = {"vary": {"m": [1.0, 2.0]}, "time": 0.01, **more}
    with pytest.raises(ModelError, match="but another column has that name"):
        hamel.sweep(rod, keep=[keep], out="out", **given)
    assert not Path("out").exists()


@pytest.mark.parametrize(
    "vary",
    [
        {"motion": "1,2"},
        {"motion": "1,2", **DRAWN},
        {"status": "normal(1, 0.1)"},
        {"sample": "1,2", **DRAWN},
    ],
)
def test_what_varies_has_no_name_of_a_column(vary: dict[str, str], rod: Path) -> None:
    with pytest.raises(ModelError, match="but a column or an axis of every such sweep"):
        hamel.sweep(rod, vary=vary, keep=["q"], time=0.01, out=rod.parent / "out")


def test_a_name_that_is_an_axis_of_other_sweeps_is_free(rod: Path) -> None:
    """Nothing is drawn and no file has rows here."""
    vary, out = {"sample": "1,2", "row": "1,2,3"}, rod.parent / "out"
    rows = hamel.sweep(rod, vary=vary, keep=["q"], time=0.01, out=out).to_xarray()
    assert rows["q"].sizes == {"sample": 2, "row": 3}


def test_two_names_that_become_one_are_told(rod: Path) -> None:
    with pytest.raises(ModelError, match=r"'final\(m\)' is kept twice"):
        hamel.sweep(rod, vary={"m": "1,2"}, keep=["m", "final(m)"], time=0.01, out=rod.parent / "o")


@pytest.mark.parametrize(
    ("keep", "message"),
    [
        ("highest(q", "a closing bracket is missing"),
        ("at(q, 0.1", "a closing bracket is missing"),
        ("highest(q) + 1", r"highest\(formula\) stands alone"),
    ],
)
def test_what_is_of_a_whole_motion_is_no_function(keep: str, message: str, rod: Path) -> None:
    with pytest.raises(ModelError, match=message):
        hamel.sweep(rod, vary={"m": "1,2"}, keep=[keep], time=0.01, out=rod.parent / "out")


@pytest.mark.parametrize("chunk", [0, -1, 2.5])
def test_chunks_have_motions(chunk: Any, rod: Path) -> None:
    with pytest.raises(ModelError, match=f"chunks of {chunk} motions"):
        hamel.sweep(rod, vary={"m": "1,2"}, time=0.01, out=rod.parent / "out", chunk=chunk)
    assert not (rod.parent / "out").exists()


@pytest.mark.parametrize(
    ("low", "high"),
    [(-1.0, 1.0), (0.5, 9.0), (8.0, 9.0), (8.5, 9.0), (30.0, 31.0), (-9.0, -8.5), (-40.0, 50.0)],
)
def test_a_cut_normal_distribution_is_that_of_scipy(low: float, high: float) -> None:
    u = np.random.default_rng(0).random(10_000)
    drawn = QUANTILES["normal"](u, 3.0, 2.0, 3.0 + 2.0 * low, 3.0 + 2.0 * high)
    wanted = 3.0 + 2.0 * truncnorm.ppf(u, low, high)
    assert np.abs(drawn - wanted).max() < 1e-9
    assert len(np.unique(drawn)) > 9_990


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("far", [50.0, 1e3, 1e8])
def test_a_cut_far_out_is_kept(far: float, sign: float) -> None:
    """There the density falls as an exponential function with the rate `far`."""
    u = np.concatenate([[0.0, 1 - 2.0**-53], np.random.default_rng(0).random(10_000)])
    ends = sorted((sign * far, sign * (far + 1.0)))
    drawn = QUANTILES["normal"](u, 0.0, 1.0, *ends)
    assert drawn.min() >= ends[0] and drawn.max() <= ends[1]
    if far < 1e8:  # where digits are left for it
        assert np.mean(np.abs(drawn[2:]) - far) == pytest.approx(1 / far, rel=0.05)
