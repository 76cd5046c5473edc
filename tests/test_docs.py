"""The pages of docs/: their models load, and their links lead somewhere."""

import importlib
import json
import re
from pathlib import Path

import pytest

from derive.mechanics import system
from derive.mechanics.initial import initial_state
from derive.model import load_text

DOCS = Path(__file__).parent.parent / "docs"
PAGES = sorted(DOCS.glob("*.md"))


def models() -> list:
    """Every model on the pages."""
    found = []
    for page in PAGES:
        for text in re.findall(r"^```yaml\n(model: .*?)^```", page.read_text("utf-8"), re.DOTALL | re.MULTILINE):
            found.append(pytest.param(text, id=f"{page.stem}-{text.split()[1]}"))
    return found


@pytest.mark.parametrize("text", models())
def test_every_model_shown_has_a_consistent_initial_state(text):
    mechanics = system(load_text(text))
    assert initial_state(mechanics).q.size == len(mechanics.model.coordinates)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text("utf-8")):
        assert (page.parent / target).exists(), target


def test_figures_of_the_benchmark_are_those_of_its_rows(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS.parent / "benchmarks"))
    page = importlib.import_module("page")
    rows = json.loads((DOCS / "bench.json").read_text("utf-8"))
    assert page.page((DOCS / "bench.md").read_text("utf-8"), rows) == (DOCS / "bench.md").read_text("utf-8")
    for name, drawn in {"bench_chains.svg": page.chains, "bench_targets.svg": page.targets}.items():
        assert drawn(rows) == (DOCS / name).read_text("utf-8")
