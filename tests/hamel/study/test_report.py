"""hamel report: rows to believe, a page without network, nothing computed twice, and a wrong
reference that is noticed.

Of hamel.study: budget, comparison, libraries, limits, page, plan, plots, results, runs.
"""

from __future__ import annotations

import csv
import json
import os
import re
import time
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import hamel
from codegen import compiler
from derive.diagnostics import ModelError
from derive.formulations import equations
from hamel.build.module import temporary_module
from hamel.draw import Series, chart
from hamel.engines import engine
from hamel.records import Reported
from hamel.study import advice, comparison, front, judgement, modules, plan, runs, series, study
from hamel.study.budget import budget_of
from hamel.study.judgement import COLUMNS, Judge, Reference

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")

MODEL = """
model: swing
coordinates: {x: m, y: m}
parameters: {m: 1 kg, l: 1 m, g: 9.81 m/s^2}
kinetic: m/2*(der(x)**2 + der(y)**2)
potential: m*g*y
constraints:
  rod: {holonomic: (x**2 + y**2 - l**2)/2}
quasi_velocities:
  swing: {om: (x*der(y) - y*der(x))/l**2}
  side: [der(y)]
initial: {y: -0.5 m, guess: {x: -0.9 m}, der(y): 0 m/s}
"""
ASKED: dict[str, Any] = {
    "time": 1.0,
    "formulations": ("quasi_velocities", "augmented", "recursive"),
    "choices": ("swing", "side", "auto"),
    "enforcements": ("projection", "none", "baumgarte"),
    "integrators": ("dop853", "rk4", "libraries"),
    "tolerances": (1e-5, 1e-9),
    "compare": ("projection", "baumgarte"),
}


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    base = tmp_path_factory.mktemp("report")
    (base / "swing.yaml").write_text(MODEL, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        yield base


@pytest.fixture(scope="module")
def record(place: Path) -> Reported:
    return hamel.report([place / "swing.yaml"], out=place / "out", **ASKED)


def test_rows(record: Reported) -> None:
    assert record.passed and record.model == "swing"
    assert all(tuple(row) == COLUMNS for row in record.rows)
    families = front.families(
        front.good(record.rows), "formulation", "choice", "enforcement", "integrator"
    )
    for name, rows in families.items():
        if rows[0]["rtol"] and rows[0]["choice"] in ("swing", ""):
            assert [row["rtol"] for row in rows] == [1e-5, 1e-9], name
            assert rows[1]["error"] < 0.05 * rows[0]["error"], name
    assert {"dop853", "rk4", "cvodes", "idas"} <= {name[3] for name in families}
    held = [row for row in front.good(record.rows) if row["enforcement"] == "projection"]
    assert held and all(row["phi"] < 1e-13 for row in held)
    steps = [row["step"] for row in record.rows if row["integrator"] == "rk4"]
    assert min(steps) > 0


def test_estimates_stand_beside_the_errors(record: Reported) -> None:
    own = [row for row in front.good(record.rows) if row["estimate"] is not None]
    libraries = [row for row in record.rows if row["integrator"] in ("cvodes", "idas")]
    assert own and all(row["estimate"] is None for row in libraries)
    far = [row for row in own if row["error_of_q"] > 1e-12]
    assert sum(row["estimate"] >= row["error_of_q"] for row in far) >= 0.9 * len(far)
    assert "estimate of the error" in record.html.read_text("utf-8")


def test_what_breaks_and_what_does_not_fit_is_said(record: Reported) -> None:
    """der(y) fails at the bottom; the recursion is for trees; `auto` is one of the file's choices
    under another name."""
    side = [row for row in record.rows if row["choice"] == "side"]
    assert side and any("singular" in row["status"] for row in side)
    (model,) = record.models
    assert any("side" in line for line in model["advice"])
    reasons = {(each["formulation"], each["choice"]): each["reason"] for each in model["excluded"]}
    assert (
        "trees" in reasons["recursive", ""]
        and "the same quasi-velocities" in reasons["quasi_velocities", "auto"]
    )
    assert model["reference"]["bound"] < 1e-10 and len(set(model["reference"]["by"])) == 2


def test_files(record: Reported, place: Path) -> None:
    held = json.loads(record.json.read_text("utf-8"))
    assert held["model"] == "swing" and len(held["rows"]) == len(record.rows)
    rows = list(csv.DictReader(record.csv.read_text("utf-8").splitlines()))
    assert tuple(rows[0]) == COLUMNS and float(rows[0]["error"]) == record.rows[0]["error"]


class Page(HTMLParser):
    """Counts what it sees; `open` is empty at the end of a well-formed page."""

    VOID = ("meta", "rect", "line", "circle", "polyline", "path", "br")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []
        self.links: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append(tag)
        self.links += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in self.VOID:
            assert self.open.pop() == tag


def test_page(record: Reported) -> None:
    text = record.html.read_text("utf-8")
    page = Page()
    page.feed(text)
    for drawn in re.findall(r"<svg.*?</svg>", text, re.DOTALL):
        ElementTree.fromstring(drawn)
    assert not page.open and page.seen.count("svg") >= 5 and page.seen.count("table") >= 4
    assert all(link.startswith("#") for link in page.links)
    first = text.index('id="recommendation"')
    assert text.index("<h1>") < first < text.index("<svg")
    (model,) = record.models
    assert model["compared"] and all("projection" in line for line in model["compared"])
    assert model["compared"][0][:20] in text[first : text.index("</section>", first)]
    assert (
        "http" not in text.replace('xmlns="http://www.w3.org/2000/svg"', "") and "url(" not in text
    )


def test_nothing_is_computed_twice(
    record: Reported, place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started = []

    def refuse(*task: Any) -> None:
        started.append(task)
        raise OSError("no more workers")

    monkeypatch.setattr(series, "_begin", refuse)
    again = hamel.report([place / "swing.yaml"], out=place / "again", **ASKED)
    assert again.rows == record.rows and not started
    with engine("processes", 1) as workers, pytest.raises(OSError, match="no more"):
        next(series.outcomes(workers, [[series.Task(abs, {}, 1.0)]]))


@pytest.mark.slow
def test_libraries_share_the_seconds_of_all_runs(place: Path, tmp_path: Path) -> None:
    """With no time for anything the page says so of them, too."""
    asked = ASKED | {"tolerances": (1e-7,), "budget": 0.01}
    found = hamel.report([place / "swing.yaml"], out=tmp_path, **asked)
    assert not any(front.is_library(row) for row in found.rows)
    late = [x for x in found.models[0]["excluded"] if x["integrator"] == "cvodes"]
    assert late and all("1 run not done: the 0.01 s" in x["reason"] for x in late)


def test_no_outcome_is_later_than_the_budget() -> None:
    """What is under way then is ended; the time of earlier runs is gone."""
    with engine("processes", 2) as workers:
        left = budget_of(2.0)
        task = series.Task(asleep, {"seconds": 60.0}, 90.0)
        before = time.monotonic()
        assert [*left.ran(workers, [[task]] * 3, share=0.5)] == []
        assert time.monotonic() - before < 10.0 and left.runs <= 1.0 and left.modules == 2.0
        assert [*budget_of(-1.0).ran(workers, [[task]])] == []
        brief = series.Task(asleep, {"seconds": 0.0}, 90.0)
        assert len([*budget_of(-1.0).ran(workers, [[brief]], share=0.0)]) == 1


def asleep(seconds: float) -> dict[str, Any]:
    time.sleep(seconds)
    return {}


def test_a_file_that_was_edited_is_read_anew(tmp_path: Path) -> None:
    file = tmp_path / "swing.yaml"
    for value in (2.0, 3.0):
        file.write_text(MODEL.replace("m: 1 kg", f"m: {value} kg"), encoding="utf-8")
        start = modules.start_now(str(file), {})
        assert value in start.p
        assert modules.start(str(file), {}) is start  # which the runs of this study take


def test_a_wrong_reference_is_noticed(
    record: Reported, place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Planted twice: in one of the two runs, which then disagree, and in both."""
    agreed = judgement.agreed

    def off(by: float) -> Any:
        def planted(found: Any) -> Reference:
            made = agreed(found)
            assert made.end is not None
            moved = tuple(x + 0.01 for x in made.end)
            return replace(made, end=moved, other=tuple(x + by for x in made.other))

        return planted

    monkeypatch.setattr(study, "agreed", off(0.0))
    one = hamel.report([place / "swing.yaml"], out=place / "one", **ASKED)
    assert "differ" in one.models[0]["reference"]["doubt"] and all(
        row["error"] is None for row in one.rows
    )
    monkeypatch.setattr(study, "agreed", off(0.01))
    both = hamel.report([place / "swing.yaml"], out=place / "both", **ASKED)
    assert not both.passed and "agree with each other" in both.models[0]["advice"][0]


@pytest.mark.slow
def test_a_task_without_end_is_ended_and_the_work_goes_on() -> None:
    """Refused, too long, dead, done: the pool says which, and the rest of a series is left out
    only where that is asked for."""
    missing = {"path": "no.yaml", "values": {}, "unit": {}, "span": 1.0}
    missing |= {"folder": "", "integrators": []}
    with engine("processes", 1) as workers:
        tasks = [
            [series.Task(modules.module, missing, 60.0, "refused")],
            [series.Task(endless, {}, 1.0, "too long")],
            [series.Task(fatal, {}, 60.0, "died")],
        ]
        tasks[-1].append(series.Task(fine, {}, 60.0, "done"))
        found = [*series.outcomes(workers, tasks)]
        assert [each.status for each in found] == [each.task.subject for each in found]
        assert len(found) == 4 and found[-1].value == {"x": [1.0, None]}
        assert found[0].reason.startswith("cannot be read")
        assert (
            len([*series.outcomes(workers, [tasks[-1]], lambda each: each.status == "died")]) == 1
        )


def endless() -> None:
    time.sleep(600.0)


def fatal() -> None:
    os._exit(1)


def fine() -> dict[str, Any]:
    return {"x": (1.0, float("nan"))}


def test_the_front_is_what_none_beats() -> None:
    rows = [
        {"ms": ms, "error": error, "status": "ok"}
        for ms, error in [(3, 1e-9), (1, 1e-3), (2, 1e-2), (4, 1e-9), (2, 1e-4)]
    ]
    assert [row["ms"] for row in front.front(rows)] == [1, 2, 3]
    assert front.front([{"ms": 1, "error": 1, "status": "too long"}]) == []


@pytest.mark.slow
def test_extreme_cases_are_on_the_page(place: Path) -> None:
    path = Path(__file__).parents[3] / "models" / "extremes" / "mass_ratio.yaml"
    made = hamel.report([], extremes=[path], out=place / "extremes")
    assert made.passed and not made.rows and {row.outcome for row in made.extremes} == {"survived"}
    page = made.html.read_text("utf-8")
    assert (
        all(row.case in page for row in made.extremes)
        and "extreme cases: error and tolerance" in page
    )


def test_a_run_that_stops_says_why_and_when(tmp_path: Path) -> None:
    """Status and time are those of the message, which nobody reads."""
    path = tmp_path / "swing.yaml"
    path.write_text(MODEL)
    begin = modules.start(str(path), {})
    run = {"integrator": "dop853", "enforcement": "none", "rtol": 1e-8}
    with temporary_module(equations(begin.system, "side"), ("dop853",), ("none",)) as module:
        x = module.state(0.0, [*begin.initial.q, *begin.initial.v], begin.u, begin.p)
        with pytest.raises(FloatingPointError) as stop:
            module.simulate((0.0, 10.0), x, begin.u, begin.p, rtol=1e-8, atol=1e-10)
        with pytest.raises(runs.Unfinished) as caught:
            runs._simulated(module, begin, np.array([10.0]), run, 10.0, 60.0)
    end = caught.value
    assert str(stop.value).endswith(f"t = {end.reached!r}: {end.cause}")


def test_causes_lose_their_numbers() -> None:
    base = {"formulation": "maggi", "choice": "a", "enforcement": "none", "integrator": "rk4"}
    cause = "singular: |pivot of C| < 2e-10"
    rows = [{**base, "status": cause, "stopped": t} for t in (1, 2.5)] + [{**base, "status": "ok"}]
    assert advice.broken(rows) == ["Singular: |pivot of C| < 2e-10: 2 of 3 runs: maggi (a)."]
    rows.append({**base, "status": "ok", "enforcement": "projection"})
    assert advice.broken(rows) == [
        "Singular: |pivot of C| < 2e-10: 2 of 3 runs: maggi (a) with none."
    ]


def test_a_reason_is_one_line_whatever_its_numbers_and_methods() -> None:
    base = {"choice": "a", "enforcement": "none"}
    rows = [
        {**base, "formulation": "maggi", "status": "singular: |pivot of C| < 2e-10"},
        {**base, "formulation": "kane", "status": "singular: |pivot of C| < 3e-9"},
        {**base, "formulation": "kane", "status": "wrong"},
    ]
    lines = advice.broken(rows)
    assert len(lines) == 2 and lines[0].endswith("2 of 3 runs: maggi (a), kane (a).")


def test_two_methods_side_by_side() -> None:
    """The faster of the two at each error; one that does not reach it is said to; a name that is
    none is refused."""
    base = {"choice": "", "enforcement": "none", "integrator": "rk4", "rtol": 1e-8, "step": None}
    base |= {"status": "ok", "phi": 0.0, "velocity": 0.0, "operations": 10}
    rows = [
        {**base, "formulation": "maggi", "error": 1e-9, "ms": 2.0},
        {**base, "formulation": "augmented", "error": 1e-7, "ms": 6.0},
    ]
    lines = comparison.verdict(rows, ("augmented", "maggi"))
    assert len(lines) == 3  # nobody reaches 1e-10
    assert "take maggi, 3 times as fast as augmented" in lines[0] and "6 ms" in lines[0]
    assert "augmented did not reach it" in lines[2]
    assert comparison.verdict(rows[:0], ("a", "b")) == ["Neither a nor b reached a usable error."]


def test_what_the_default_choice_cannot_finish_its_charts_do(place: Path) -> None:
    """A swing through a position that is singular for the default choice alone is compared with
    charts, as `hamel simulate` goes on; and modules hold the integrators that are asked for."""
    file = place / "through.yaml"
    text = MODEL.replace("swing: {om: (x*der(y) - y*der(x))/l**2}", "auto: auto")
    text = text.replace("  side: [der(y)]\n", "").replace("y: -0.5 m", "y: 0.3 m")
    file.write_text(text.replace("model: swing", "model: through"), encoding="utf-8")
    asked: dict[str, Any] = {"integrators": ("verner9",), "tolerances": (1e-6,), "time": 3.0}
    found = hamel.report([file], out=place / "through", formulations=(plan.DEFAULT,), **asked)
    ends = {row["choice"]: row["status"] for row in found.rows if row["enforcement"] == "none"}
    assert ends["auto+orthonormal"] == "ok" == ends["orthonormal"]
    assert "singular" in ends["auto"]
    assert {row["integrator"] for row in found.rows} == {"verner9"}


def test_a_method_that_is_none_is_refused(place: Path) -> None:
    with pytest.raises(ModelError, match="augmented"):
        hamel.report([place / "swing.yaml"], out=place / "no", compare=("swing", "augmentd"))


def test_a_chart_is_drawn_with_both_axes_logarithmic() -> None:
    text = chart(
        "t",
        "x",
        "y",
        [
            Series("a & b", [(1e-3, 1e-9), (1e2, 1e-3), (float("nan"), 1.0)]),
            Series("f", [(1, 1)], "front"),
        ],
    )
    ElementTree.fromstring(text)
    assert (
        "a &amp; b" in text
        and "1e-9" in text
        and "1e2" in text
        and text.count("h0") == 2
        and "nan" not in text
    )


def test_what_stands_at_the_end_of_a_decade_is_off_the_frame() -> None:
    points = [(0.1, 1e-15), (0.1, 1e-3), (1e1, 1e-15)]
    text = chart("t", "x", "y", [Series("dots", points, "dots")])
    frame = re.search(r'<rect class="frame" x="(.+?)" y="(.+?)" width="(.+?)" height="(.+?)"', text)
    assert frame
    left, top, width, height = map(float, frame.groups())
    for x, y in re.findall(r"M([\d.]+),([\d.]+)h0", text):
        assert 5 < float(x) - left < width - 5 and 5 < float(y) - top < height - 5


def test_scales_are_those_of_the_motion(place: Path) -> None:
    system = modules.start(str(place / "swing.yaml"), {}).system
    reference = Reference(
        ("a", "b"),
        (1e-6, 0.0, 0.0, 2.0),
        (1e-6, 0.0, 0.0, 2.0),
        (1e-6, 2e-6, 1.0, 4.0),
        1.0,
        10,
        None,
    )
    judge = Judge(system, reference, 1.0)
    assert judge._distance((2e-6, 0.0, 0.0, 2.0), (1e-6, 0.0, 0.0, 2.0)) == pytest.approx(0.5)
    assert judge._distance((1e-6, 0.0, 0.0, 3.0), (1e-6, 0.0, 0.0, 2.0)) == pytest.approx(0.25)
