"""The gallery: thirty mechanisms, each a short file that is read, drawn, built and verified."""

import importlib
import re
from pathlib import Path

import pytest

import hamel
from derive.model import load
from tests.scenes import ROOT

GALLERY = sorted((ROOT / "models" / "gallery").glob("*.yaml"))
FIGURES = ROOT / "models" / "gallery" / "figures"
NAMED = """quadrotor_slung_load delta_robot stewart differential tracked_chain crane_over_boom muscle_elbow
ball_on_plate dc_motor rocket cam ballbot trailer forty_four_bars"""
LINES = {"forty_four_bars": 20, "stewart": 25}
SHORT = 32


def test_thirty_mechanisms_stand_there() -> None:
    names = {path.stem for path in GALLERY}
    assert len(names) >= 30
    assert set(NAMED.split()) <= names


def test_the_page_names_and_shows_each(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else: `make gallery`."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    page = (ROOT / "models" / "gallery" / "README.md").read_text("utf-8")
    assert importlib.import_module("gallery").page() == page
    assert {path.stem for path in GALLERY} == {path.stem for path in FIGURES.glob("*.svg")}


@pytest.mark.parametrize("path", GALLERY, ids=lambda path: path.stem)
def test_each_is_short_and_says_what_it_is(path: Path) -> None:
    lines = path.read_text("utf-8").splitlines()
    assert re.match(r"# Difficulty: .{10,}", lines[0])
    assert len(lines) <= LINES.get(path.stem, SHORT)
    assert load(path).name == path.stem


@pytest.mark.parametrize("path", GALLERY, ids=lambda path: path.stem)
def test_each_is_a_mechanical_system(path: Path) -> None:
    assert hamel.check(path).model == path.stem


@pytest.mark.parametrize("path", GALLERY, ids=lambda path: path.stem)
def test_each_figure_is_that_of_its_model(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else: `make gallery`."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    figure = importlib.import_module("gallery").drawn(path, tmp_path)
    assert figure.read_text("utf-8") == (FIGURES / figure.name).read_text("utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("path", GALLERY, ids=lambda path: path.stem)
def test_each_is_built_and_verified(path: Path, tmp_path: Path) -> None:
    """A build keeps nothing that its own verification does not pass."""
    built = hamel.build(path, out=tmp_path / path.stem)
    assert built.verified and built.compiled


@pytest.mark.parametrize(
    "path", [*GALLERY, *sorted((ROOT / "models").glob("*.yaml"))], ids=lambda path: path.stem
)
def test_each_model_is_described_in_one_to_three_sentences(path: Path) -> None:
    """What it is, where it is from, and what is interesting: more than a title, less than a page;
    initials of authors do not end a sentence."""
    text = load(path).description
    sentences = re.findall(r"[^.]{12,}\.(?= [A-Z]|$)", text.strip())
    assert 1 <= len(sentences) <= 3 and text.strip().endswith(".")
    assert 60 <= len(text) <= 420
