"""What a sweep says of itself: counts that agree with their nouns, a rate that agrees with its time,
what may fail, and a page whose cells stand at their values.

Of hamel.sweep: chunk, drive, page.
Of hamel.verbs: sweep.
"""

from __future__ import annotations

import re
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

import hamel
from codegen.runtime.simulation import Status
from derive.diagnostics import AssumptionError, HamelError
from hamel.sweep.chunk import cause
from hamel.sweep.page import _Cells, _colours
from hamel.verbs.sweep import show

MODEL = """
model: rod
coordinates: {q: rad}
parameters: {m: 2 kg, l: 1 m, k: 3 N*m}
kinetic: m*l^2/2*der(q)^2
potential: k*q^2/(2*m*l)*(1 kg*m)
initial: {q: 0.1, der(q): 0 rad/s}
"""


@pytest.fixture
def rod(tmp_path: Path) -> Path:
    (tmp_path / "rod.yaml").write_text(MODEL)
    return tmp_path / "rod.yaml"


def printed(record: Any) -> str:
    console = Console(file=StringIO(), width=200)
    show(record, console)
    return console.file.getvalue()


def test_one_motion_is_one_and_its_rate_is_of_its_time(rod: Path) -> None:
    found = hamel.sweep(rod, vary={"k": [3.0]}, time=0.1, out=rod.parent / "one")
    text = printed(found)
    assert text.startswith("rod: 1 motion in ")
    said = re.search(r"; (\d+) made in ([\d.]+) s, ([\d.]+) a second", text)
    assert said and int(said[1]) == 1
    assert float(said[3]) == pytest.approx(1 / float(said[2]), rel=0.01)
    assert "rod: 1 motion<" in Path(found.page).read_text("utf-8")


def test_a_rate_is_of_the_motions_made_now(rod: Path) -> None:
    given: dict[str, Any] = {"vary": {"k": "1:3:10"}, "time": 0.1, "chunk": 4}
    hamel.sweep(rod, out=rod.parent / "ten", **given)
    (rod.parent / "ten" / "chunks" / "000000002.parquet").unlink()
    again = hamel.sweep(rod, out=rod.parent / "ten", **given)
    assert round(again.rate * again.running) == 2  # the last chunk is no whole one
    assert "; 2 made in" in printed(again)


def test_what_may_fail_is_said_plainly(rod: Path) -> None:
    with pytest.raises(AssumptionError, match=r"^error: 1 of 4 motions failed, and none may: "):
        hamel.sweep(rod, vary={"m": "0:3:4"}, time=0.1, out=rod.parent / "none")
    given: dict[str, Any] = {"vary": {"m": "0,0,0,1"}, "failures": 0.5}
    with pytest.raises(AssumptionError, match=r"3 of 4 motions failed, and only 2 of 4 may: "):
        hamel.sweep(rod, time=0.1, out=rod.parent / "two", **given)
    given = {"vary": {"m": "0,0,0,0"}, "failures": 0.25, "chunk": 2}
    with pytest.raises(AssumptionError, match=r"2 of 2 motions failed so far, and only 1 of 4 may"):
        hamel.sweep(rod, time=0.1, out=rod.parent / "far", **given)


@pytest.mark.parametrize("scheduler", ["nowhere", "tcp://127.0.0.1:1", "no.json"])
def test_an_engine_that_is_none_leaves_no_folder(
    scheduler: str, rod: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("hamel.engines.ANSWERS", 0.5)
    out = rod.parent / "refused"
    with pytest.raises(HamelError):
        hamel.sweep(rod, vary={"m": "1,2"}, time=0.1, out=out, scheduler=scheduler)
    with pytest.raises(HamelError, match="0 workers"):
        hamel.sweep(rod, vary={"m": "1,2"}, time=0.1, out=out, workers=0)
    assert not out.exists()


# ---- the page


def cells(page: str) -> list[tuple[float, float, float, float]]:
    found = re.findall(
        r'<rect x="([\d.]+)" y="([\d.]+)" width="([\d.]+)" height="([\d.]+)" fill="#', page
    )
    return [(float(x), float(y), float(w), float(h)) for x, y, w, h in found]


def test_cells_of_a_map_are_centred_at_their_values(rod: Path) -> None:
    """Ticks stand in the middle of cells, edges halfway between them."""
    found = hamel.sweep(
        rod,
        vary={"m": "1:3:3", "k": "1:4:4", "q": "normal(0.1, 0.01)"},
        keep=["q"],
        samples=5,
        time=0.1,
        out=rod.parent / "map",
    )
    page = Path(found.page).read_text("utf-8")
    across = sorted({x + w / 2 for x, _, w, _ in cells(page) if w > 20})
    ticks = [
        float(x) for x in re.findall(r'<text x="([\d.]+)" y="\d+\.\d" text-anchor="middle">', page)
    ]
    assert len(across) == 4 and all(min(abs(t - x) for t in ticks) < 0.3 for x in across)
    assert "The mean of the 5 samples at each place of the grid." in page


def test_edges_of_cells_are_halfway_between_values() -> None:
    even = _Cells.of(np.array([3.0, 1.0, 2.0, 1.0]))
    assert even.edges == [0.5, 1.5, 2.5, 3.5] and even.places.tolist() == [1, 2, 0]
    uneven = _Cells.of(np.array([0.0, 1.0, 4.0]))
    assert uneven.edges == [-0.5, 0.5, 2.5, 5.5] and not uneven.axis.log
    by_factors = _Cells.of(np.geomspace(0.01, 100.0, 5))
    assert by_factors.edges == pytest.approx(10.0 ** np.arange(-2.5, 3.0), rel=1e-12)
    assert by_factors.axis.log and by_factors.axis.ticks[0][1] == "1e-2"
    assert _Cells.of(np.array([2.0, 2.0])).edges == [1.0, 3.0]
    assert _Cells.of(np.array([0.0])).edges == [-0.5, 0.5]


def test_colours_begin_at_the_lowest_of_few_cells() -> None:
    """One motion was said to have 0.212, and the key began at 0.231."""
    assert _colours(np.linspace(1.0, 2.0, 60)) == (1.0, 2.0)
    low, high = _colours(np.arange(1001.0))
    assert (low, high) == (10.0, 990.0)


def test_what_took_too_many_steps_is_told_with_friction_first() -> None:
    said = cause(int(Status.MORE))
    assert said.index("friction by sign") < said.index("stiff")
