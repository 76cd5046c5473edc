"""What the documents name is there: paths, commands, tables, tests, and every term in the
glossary."""

import re
from pathlib import Path

import pytest
import yaml

import hamel
from derive.model.records import CHOICE_KINDS
from hamel.cli import group
from tests.scenes import ROOT

DOCUMENTS = sorted(
    [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")],
)
GLOSSARY = (ROOT / "docs/glossary.md").read_text("utf-8")
METHODS = (ROOT / "docs/methods.md").read_text("utf-8")
FORMULATIONS = (ROOT / "docs/formulations.md").read_text("utf-8")
ROOMS = ("derive", "codegen", "hamel", "models", "generated", "tests", "docs", "benchmarks")
# by the commands of the README and of tutorials
MADE_BY_USERS = {"generated/sled", "generated/sled/sled.yaml", "generated/follow.py"}

every_document = pytest.mark.parametrize(
    "document", DOCUMENTS, ids=lambda path: path.relative_to(ROOT).as_posix()
)


def code_spans(document: Path) -> list[str]:
    """What stands between backticks, and the lines of code blocks in a shell's language."""
    text = document.read_text("utf-8")
    blocks = re.findall(r"^```(?:sh|console)\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    inline = re.findall(r"`([^`\n]+)`", re.sub(r"^```.*?^```", "", text, flags=re.S | re.M))
    return [*inline, *(line for block in blocks for line in block.splitlines())]


def paths_in(document: Path) -> list[str]:
    """Paths below a room of the house; NAME stands for any name, so its folder is meant."""
    found = []
    for span in code_spans(document):
        for word in re.findall(r"[\w./*-]+", span):
            word = word.split("::")[0].rstrip("./")
            if word.split("/")[0] in ROOMS and "/" in word and "*" not in word:
                found.append(word.rpartition("/")[0] if "NAME" in word else word)
    return [path for path in found if path not in MADE_BY_USERS]


@every_document
def test_paths_that_a_document_names_exist(document: Path) -> None:
    assert not [path for path in paths_in(document) if not (ROOT / path).exists()]


@every_document
def test_links_of_a_document_lead_somewhere(document: Path) -> None:
    for target in re.findall(r"\]\(([^)#:]+)\)", document.read_text("utf-8")):
        assert (document.parent / target).exists(), target


@every_document
def test_commands_that_a_document_names_are_commands(document: Path) -> None:
    makefile = (ROOT / "Makefile").read_text("utf-8")
    for span in code_spans(document):
        words = span.removeprefix("$ ").removeprefix(".venv/bin/").split()
        if len(words) > 1 and words[0] == "hamel" and words[1].isalpha():
            assert words[1] in group.commands, span
        elsewhere = "-C" in words  # by the Makefile of a folder that a build makes
        if len(words) > 1 and words[0] == "make" and not elsewhere:
            assert f"\n{words[1]}:" in makefile, span


def test_tables_stand_where_contributing_says() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    places = re.findall(r"`([A-Z]{4,})` in `([\w/.]+)`", text)
    assert len(places) >= 8
    for name, path in places:
        assert re.search(rf"^{name}\b", (ROOT / path).read_text("utf-8"), re.MULTILINE), (
            name,
            path,
        )


def test_every_room_is_in_the_architecture() -> None:
    text = (ROOT / "docs/architecture.md").read_text("utf-8")
    rooms = [
        folder.relative_to(ROOT).as_posix()
        for package in ("derive", "codegen", "hamel")
        for folder in (ROOT / package).iterdir()
        if folder.is_dir() and (folder / "__init__.py").exists()
    ]
    assert not [room for room in rooms if f"`{room}`" not in text]


def test_every_decision_is_listed() -> None:
    folder = ROOT / "docs/decisions"
    listed = set(re.findall(r"\]\((\d{4}-[\w-]+\.md)\)", (folder / "README.md").read_text("utf-8")))
    assert listed == {path.name for path in folder.glob("0*.md")}
    for name in listed:
        text = (folder / name).read_text("utf-8")
        assert text.startswith(f"# {name[:4]} ")
        assert all(f"**{part}.**" in text for part in ("Decided", "Why", "Rejected"))


def names(kind: str) -> list[str]:
    return [known.name for known in hamel.list().kinds[kind]]


def test_every_kind_of_thing_is_a_term_of_the_glossary() -> None:
    terms = " ".join(re.findall(r"^\| ([^|]+)", GLOSSARY, re.MULTILINE))
    for kind in hamel.list().kinds:
        singular = kind.removesuffix("s") if kind.endswith("s") else kind.replace("s ", " ", 1)
        assert re.search(rf"\b{singular}\b", terms), singular


def test_every_function_and_kind_of_choice_is_in_the_glossary() -> None:
    known = [*names("functions"), *names("functions on request"), *CHOICE_KINDS]
    assert not [name for name in known if f"`{name}`" not in GLOSSARY]


def test_every_method_is_in_the_table_of_its_page() -> None:
    methods = [*names("enforcements"), *names("integrators")]
    assert not [name for name in methods if f"`{name}`" not in METHODS]
    assert not [name for name in names("formulations") if f"| `{name}` |" not in FORMULATIONS]


def test_no_term_of_the_glossary_stands_twice() -> None:
    table = GLOSSARY.split("The functions of a module:")[0]
    terms = [
        term.strip()
        for cell in re.findall(r"^\| ([^|]+?) \|", table, re.MULTILINE)
        for term in cell.split(", ")
        if term not in ("term", "---") and term
    ]
    assert len(terms) > 50
    assert not [term for term in set(terms) if terms.count(term) > 1]


def test_templates_of_issues_and_hooks_are_readable() -> None:
    for path in (ROOT / ".github/ISSUE_TEMPLATE").glob("*.yml"):
        form = yaml.safe_load(path.read_text("utf-8"))
        assert path.stem == "config" or {"name", "description", "body"} <= form.keys()
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text("utf-8"))
    entries = {hook["entry"] for repo in hooks["repos"] for hook in repo["hooks"]}
    makefile = (ROOT / "Makefile").read_text("utf-8")
    linters = re.findall(
        r"\$\(BIN\)/(ruff check|ruff format --check|pyright|lint-imports)", makefile
    )
    assert {f".venv/bin/{linter}" for linter in linters} == entries
