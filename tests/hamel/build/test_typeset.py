"""A derivation as a PDF, by a TeX that may be missing.

Of hamel.build: typeset.
"""

import shutil

import pytest

import hamel
from derive.diagnostics import ModelError, ToolchainError
from hamel.build.typeset import typeset
from tests.scenes import MODELS

SLED = MODELS / "chaplygin_sleigh.yaml"


def test_without_a_tex_it_is_said_what_to_do(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ToolchainError, match="pdflatex is not installed"):
        typeset("", tmp_path / "derivation.pdf")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="it takes a pdflatex")
def test_two_roads_are_typeset(tmp_path):
    record = hamel.derive(SLED, out=tmp_path, road=("kane", "boltzmann_hamel"), pdf=True)
    assert record.pdf is not None and record.pdf.read_bytes().startswith(b"%PDF")
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"derivation.html", "derivation.tex", "derivation.pdf"}


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="it takes a pdflatex")
def test_what_tex_stops_at_is_said_and_nothing_is_left(tmp_path):
    with pytest.raises(ToolchainError, match="Undefined control sequence"):
        typeset(r"\documentclass{article}\begin{document}\nonsense", tmp_path / "a.pdf")
    assert not list(tmp_path.iterdir())


def test_an_unknown_road_ends_with_one_and_writes_nothing(tmp_path):
    with pytest.raises(ModelError, match="did you mean"):
        hamel.derive(SLED, out=tmp_path, road=("kanes",))
    assert not list(tmp_path.iterdir())
