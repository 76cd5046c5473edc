"""The pages of docs/: their models load, their figures and commands are true."""

import importlib
import json
import re
import shlex
import tomllib
from pathlib import Path

import pytest

from codegen import compiler
from derive.expressions.units import UNITS
from derive.model import load, load_text
from derive.states import system
from derive.states.initial import initial_state
from hamel.cli import main
from tests.scenes import ROOT

DOCS = Path(__file__).parent.parent / "docs"
PAGES = sorted([*DOCS.glob("*.md"), *DOCS.glob("tutorials/*.md")])


def models() -> list:
    """Every model on the pages."""
    found = []
    for page in PAGES:
        for text in re.findall(
            r"^```yaml\n(model: .*?)^```", page.read_text("utf-8"), re.DOTALL | re.MULTILINE
        ):
            found.append(pytest.param(text, id=f"{page.stem}-{text.split()[1]}"))
    return found


@pytest.mark.parametrize("text", models())
def test_every_model_shown_has_a_consistent_initial_state(text):
    mechanics = system(load_text(text))
    assert initial_state(mechanics).q.size == len(mechanics.model.coordinates)


def test_figures_of_the_benchmark_are_those_of_its_rows(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS.parent / "benchmarks"))
    page = importlib.import_module("page")
    rows = json.loads((DOCS / "bench.json").read_text("utf-8"))
    assert page.page((DOCS / "bench.md").read_text("utf-8"), rows) == (DOCS / "bench.md").read_text(
        "utf-8"
    )
    for name, drawn in {"bench_chains.svg": page.chains, "bench_targets.svg": page.targets}.items():
        assert drawn(rows) == (DOCS / name).read_text("utf-8")


def test_extreme_cases_of_the_page_are_those_of_the_models(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS.parent / "benchmarks"))
    page = importlib.import_module("report_page")
    paths = sorted((DOCS.parent / "models" / "extremes").glob("*.yaml"))
    known = [
        {"model": model.name, "case": case.name}
        for model in map(load, paths)
        for case in model.extremes
    ]
    shown = [
        row
        for names in page.EXTREMES.values()
        for name in names
        for row in page.chosen(known, [name]) or [name]
    ]
    assert not [name for name in shown if isinstance(name, str)]  # every name stands for a case
    ordinary = {
        "scale_metre",
        "four_bar_chain",
        "soft_pin",
    }  # the usual ones of these are there to compare with
    assert {row["model"] for row in known} - ordinary <= {row["model"] for row in shown}
    text = page.put("a\n<!-- x: benchmarks/report_page.py -->\nold\n<!-- so far -->\nb", "x", "new")
    assert text == "a\n<!-- x: benchmarks/report_page.py -->\n\nnew\n\n<!-- so far -->\nb"


def commands() -> list[str]:
    """What the page of methods says to type, paper by paper; a line that goes on from the one
    before stands for itself."""
    table = (DOCS / "methods.md").read_text("utf-8").split("## Paper by paper")[1]
    return re.findall(r"`hamel ([^`]+)`", table)


@pytest.mark.slow
@pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
@pytest.mark.parametrize("command", commands())
def test_the_commands_of_the_methods_run(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "models").symlink_to(ROOT / "models")  # what they write stays here
    monkeypatch.chdir(tmp_path)
    words = shlex.split(command)
    with pytest.raises(SystemExit) as ended:
        main([*words, *(["--time", "0.1"] if words[0] == "simulate" else [])])
    assert ended.value.code == 0


def test_the_tests_that_the_methods_name_are_there() -> None:
    table = (DOCS / "methods.md").read_text("utf-8").split("## Paper by paper")[1]
    tests = {path.name: path.read_text("utf-8") for path in (ROOT / "tests").rglob("test_*.py")}
    assert set(re.findall(r"`(test_\w+\.py)", table)) <= set(tests)
    for name in re.findall(r"::(\w+)`", table):
        assert any(f"def {name}(" in text for text in tests.values())


@pytest.fixture
def execution(monkeypatch: pytest.MonkeyPatch):
    """What runs the pages of the site when it is built."""
    monkeypatch.syspath_prepend(str(DOCS))
    return importlib.import_module("execution")


@pytest.mark.slow
@pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
@pytest.mark.parametrize("page", ["tutorials/sled.md", "tutorials/four_bar.md", "motions.md"])
def test_what_the_pages_of_the_site_show_is_so(execution, page: str, tmp_path: Path) -> None:
    assert page in execution.EXECUTED
    assert execution.failure(DOCS / page, tmp_path / "page") == ""


@pytest.mark.parametrize(
    ("block", "why"),
    [
        ("```sh\nfalse\n```\n", "'false' ends with code 1\n"),
        ("```console\n$ echo 1.25\n1.26\n```\n", "'echo 1.25' says\n1.25\nand the page"),
        ("```python\nraise SystemExit(3)\n```\n", "'its program' ends with code 3\n"),
        ("```console\n$ echo 1.25\n1.…\n```\n", ""),
        ("```yaml\nmodel: rod\n```\n```console\n$ cat rod.yaml\nmodel: rod\n```\n", ""),
    ],
)
def test_a_page_that_shows_something_else_is_seen(execution, block, why, tmp_path) -> None:
    page = tmp_path / "page.md"
    page.write_text(block, "utf-8")
    said = execution.failure(page, tmp_path / "folder")
    assert said.startswith(why) and bool(said) is bool(why)


def test_every_page_of_the_site_has_its_place() -> None:
    """In the table of contents: four parts, and what belongs to them."""
    index = (DOCS / "index.md").read_text("utf-8")
    parts = re.findall(r"^:caption: (.*)$", index, re.MULTILINE)
    assert parts[:1] + parts[1:2] == ["Tutorials", "How to"]
    assert {"Tutorials", "How to", "Reference", "Explanation"} <= set(parts)
    listed = set(re.findall(r"^[a-z][\w/-]*$", index, re.MULTILINE | re.IGNORECASE))
    globbed = {"targets": "[a-z]*.md", "decisions": "0*.md"}
    for page in DOCS.rglob("*.md"):
        name = page.relative_to(DOCS).with_suffix("").as_posix()
        wild = globbed.get(name.split("/")[0])
        assert name == "index" or name in listed or (wild and page.match(wild)), name


def test_what_builds_the_site_comes_with_what_its_commands_need() -> None:
    """Pages are run when the site is built, sweeps and other optional verbs among them."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert "hamel[cluster,data,identify]" in extras["optional-dependencies"]["docs"]


def test_no_command_that_is_run_with_the_site_asks_another_machine(execution) -> None:
    for page in execution.EXECUTED:
        blocks = execution.FENCE.findall(execution._whole(DOCS / page))
        assert not [text for language, text in blocks if language == "sh" and "://" in text], page


def test_every_unit_is_listed() -> None:
    page = (ROOT / "docs" / "models.md").read_text("utf-8")
    named = re.search("Units are `([^`]*)`, and with a prefix\n`([^`]*)`", page)
    assert named is not None
    assert f"{named[1]}, {named[2]}".split(", ") == list(UNITS)
