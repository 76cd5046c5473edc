"""The measurement of pages: what is clipped and what overlaps is counted, seen on planted faults."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

import pytest

from tests.scenes import MODELS

SOUND = """<!DOCTYPE html><html><body style="margin:0"><p>short</p>
<svg width="200" height="40"><text x="0" y="20">left</text><text x="120" y="20">right</text></svg>
%s</body></html>"""
WIDE = '<table style="width:600px"><tr><td>wider than a telephone</td></tr></table>'
COVERED = (
    '<svg width="200" height="40"><text x="0" y="20">one</text><text x="5" y="22">two</text></svg>'
)


@pytest.fixture
def pages(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(MODELS.parent / "benchmarks"))
    return importlib.import_module("pages")


def test_planted_faults_are_counted(
    pages: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A table beyond a narrow screen is clipped there and not on a wide one; labels that cover each
    other are told at both widths; a sound page has neither."""
    browser = pages.browser_of()
    if browser is None:
        pytest.skip("no Chromium")
    monkeypatch.setattr(pages, "PAGES", tmp_path)
    files = []
    for name, fault in (("sound", ""), ("clipped", WIDE), ("covered", COVERED)):
        files.append(tmp_path / f"{name}.html")
        files[-1].write_text(SOUND % fault, encoding="utf-8")
    rows = {(row["page"], row["width"]): row for row in pages.measured(browser, files)}
    counts = {key: (row["clipped"], row["overlaps"]) for key, row in rows.items()}
    assert counts["sound.html", 1400] == counts["sound.html", 390] == (0, 0)
    assert counts["clipped.html", 1400] == (0, 0) and counts["clipped.html", 390][0] > 0
    assert counts["covered.html", 1400] == counts["covered.html", 390] == (0, 1)


def test_slow_and_large_live_pages_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """A row within all limits misses nothing; each limit is seen by itself."""
    monkeypatch.syspath_prepend(str(MODELS.parent / "benchmarks"))
    live = importlib.import_module("live")
    sound = live.LIMITS | {"per_second": 60.0}
    assert live.misses(sound) == []
    for name in live.LIMITS:
        assert len(live.misses(sound | {name: 1.01 * sound[name]})) == 1
    assert live.misses(sound | {"per_second": 30.0})


def test_rows_of_other_models_stay(
    pages: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Models can be measured one at a time: pages.json holds the latest rows of each."""
    monkeypatch.setattr(pages, "HOME", tmp_path)
    (tmp_path / "build").mkdir()
    row = {"width": 390, "clipped": 1, "overlaps": 0}
    pages._store("b", [{"page": "b/motion.html", **row}])
    pages._store("a", [{"page": "a/motion.html", **row}])
    pages._store("b", [{"page": "b/motion.html", **row, "clipped": 0}])
    text = (tmp_path / "build" / "pages.json").read_text(encoding="utf-8")
    assert [line.count('"clipped": 1') for line in text.splitlines()] == [0, 1, 0, 0]
