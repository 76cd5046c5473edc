"""Files with a slip in them: a line lost, words swapped, a number that is none. Every one loads or
is refused with its place."""

from __future__ import annotations

import functools
import random
import re
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest

from derive.diagnostics import HamelError, ModelError
from derive.formulations import equations
from derive.model import load_text
from derive.robots.reading import imported
from derive.states import system
from derive.states.initial import initial_state
from hamel.cli import main
from tests.scenes import MODELS

ROBOTS = sorted((Path(__file__).parent / "robots").glob("*.*"))
YAML = [
    path.read_text() for path in sorted(MODELS.glob("**/*.yaml")) if path.stat().st_size < 3_000
]
WORD = re.compile(r"[A-Za-z_][\w.]*|\d+\.?\d*(?:[eE][+-]?\d+)?|[^\sA-Za-z_0-9]")
STRANGE = (
    "null", "~", "[]", "{}", "[1,2]", "{a:1}", "nan", ".inf", "1e400", "-1e300", "1e-320", "0", "-1", "true", "''", "x", "ground",
    "t", "pi", "der(t)", "sqrt(-1)", "log(0)", "1/0", "0**-1", "2^10000", "λ", "*", "&a", "!!int", "%", "@", "|", "kg",
    "deg", "auto", "a.b.c", "__class__", "1_000", "0x10", "1:30", "<<", "?", "min(1)", "atan2(1)", "reaction.C", "free", "9" * 30,
)  # fmt: skip
NUMBERS = ("0", "1", "-1", "1e-9", "1e9", "1e-300", "1e300", "0.5", "1e-16", "1e150")
KINDS = (
    "revolute",
    "prismatic",
    "ball",
    "free",
    "planar",
    "cylindrical",
    "universal",
    "screw",
    "fixed",
)


def changed(text: str, rng: random.Random) -> str:
    """One slip of a hand that edits YAML."""
    lines = text.split("\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    words, others = list(WORD.finditer(lines[i])), list(WORD.finditer(lines[j]))
    one = rng.choice(words) if words else None
    match rng.randrange(8):
        case 0:
            del lines[i]
        case 1:
            lines.insert(i, lines[j])
        case 2:
            lines[i] = " " * rng.randrange(5) + lines[i].lstrip()
        case 3 if ":" in lines[i]:
            lines[i] = lines[i][: lines[i].index(":") + 1] + " " + rng.choice(STRANGE)
        case 4 if one and others:
            lines[i] = put(lines[i], one, rng.choice(others).group())
        case 5 if one:
            lines[i] = put(lines[i], one, "")
        case _ if one:
            lines[i] = put(lines[i], one, rng.choice(STRANGE))
    return "\n".join(lines)


def put(text: str, found: re.Match[str], new: str, group: int = 0) -> str:
    return text[: found.start(group)] + new + text[found.end(group) :]


def another_model(text: str, rng: random.Random) -> str:
    """Other numbers and other joints: what often still loads."""
    for _ in range(rng.choice((1, 1, 2, 3))):
        numbers, kinds = (
            list(re.finditer(r"(?<![\w.])\d[\d.]*", text)),
            list(re.finditer(rf"type: ({'|'.join(KINDS)})\b", text)),
        )
        if kinds and rng.random() < 0.4:
            text = put(text, rng.choice(kinds), rng.choice(KINDS), 1)
        elif numbers:
            text = put(text, rng.choice(numbers), rng.choice(NUMBERS))
    return text


def changed_xml(text: str, rng: random.Random) -> str:
    """A tag lost or doubled, an attribute lost, renamed, or with a value of another."""
    tags, attributes = (
        list(re.finditer(r"<[^>]*>", text)),
        list(re.finditer(r'(\w+)="([^"]*)"', text)),
    )
    tag, one, other = rng.choice(tags), rng.choice(attributes), rng.choice(attributes)
    match rng.randrange(6):
        case 0:
            return put(text, tag, "")
        case 1:
            return text[: tag.end()] + rng.choice(tags).group() + text[tag.end() :]
        case 2:
            return put(text, one, "")
        case 3:
            return put(text, one, other[1], 1)
        case 4:
            return put(text, one, other[2], 2)
    return put(
        text,
        one,
        rng.choice(
            ["", "nan", "inf", "1e400", "0 0", "0 0 0", "x", "-1", "0", "λ", "../..", "1,2"]
        ),
        2,
    )


def refused(attempt: Callable[[], object]) -> bool:
    """Whether it is refused; anything but a HamelError, and one without words or with a place that
    is none, is a failure."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            attempt()
        except HamelError as error:
            assert all(
                d.message and d.line >= 0 and d.column >= 0 and "\n" not in d.message
                for d in error.diagnostics
            )
            if isinstance(error, ModelError):
                assert all(d.file for d in error.diagnostics)
            return True
    return False


def test_a_slip_in_a_model_file() -> None:
    rng = random.Random(1)
    outcomes = [refused(lambda: load_text(changed(rng.choice(YAML), rng))) for _ in range(500)]
    assert 100 < sum(outcomes) < 480


def test_another_model_goes_through_or_is_refused() -> None:
    rng = random.Random(2)

    def derived() -> None:
        s = system(load_text(another_model(rng.choice(YAML), rng)))
        initial_state(s)
        equations(s)

    assert 1 < sum(refused(derived) for _ in range(15)) < 15


def test_a_slip_in_a_robot_file(tmp_path) -> None:
    rng = random.Random(3)
    texts = [(path.suffix, path.read_text()) for path in ROBOTS]
    outcomes = []
    for _ in range(150):
        suffix, text = rng.choice(texts)
        file = tmp_path / f"robot{suffix}"
        file.write_text(changed_xml(text, rng))
        outcomes.append(refused(functools.partial(imported, file)))
    assert 50 < sum(outcomes) < 150


def test_the_command_ends_with_a_documented_code_and_writes_nothing(tmp_path, capsys) -> None:
    rng, file = random.Random(4), tmp_path / "m.yaml"
    for k in range(40):
        text = changed(changed(rng.choice(YAML), rng), rng)
        if not refused(functools.partial(load_text, text)):
            continue
        file.write_text(text)
        with pytest.raises(SystemExit) as end:
            main(["build", str(file), "-o", str(tmp_path / "out")])
        said = capsys.readouterr()
        assert (
            end.value.code == 1
            and not said.out
            and "Traceback" not in said.err
            and said.err.startswith(f"{file}")
        ), k
        assert [path.name for path in tmp_path.iterdir()] == ["m.yaml"]


def test_a_list_of_a_million_entries_is_refused_soon() -> None:
    with pytest.raises(ModelError, match="more than 1000000 values"):
        load_text("model: m\ngravity: [" + "1, " * 1_000_000 + "1]\n")
