"""The reference of the language says what the language does: the committed page is that of the
classes, every key has an example that is a model, and its unit is the one that is demanded.

Of derive.model.language: keys, place_entries, reference, study_entries.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import hamel
from derive.diagnostics import Diagnostic, ModelError
from derive.model import load_text
from derive.model.composing.expansion import expanded
from derive.model.document import Scalar, Source, parsed
from derive.model.language import reference
from derive.model.language.keys import Entry
from derive.model.language.structure import structured
from derive.model.mechanism import placements
from tests.scenes import ROOT

PAGE = ROOT / "docs" / "reference" / "language.md"
EXAMPLES = reference.examples()
ANOTHER = "1 A"  # no key of the language has this unit


def test_the_committed_page_is_that_of_the_classes() -> None:
    """Else: `make reference`."""
    assert PAGE.read_text("utf-8") == f"{hamel.schema(page=True)}\n"


def test_every_key_has_an_example() -> None:
    assert reference.without_example(EXAMPLES) == []


def test_a_key_without_an_example_is_seen() -> None:
    rest = [path for path in EXAMPLES if path.stem != "soft"]
    assert "BushingEntry.torsion" in reference.without_example(rest)


def test_every_key_says_what_becomes_of_it() -> None:
    for section in reference.sections():
        for name, field in section.entry.model_fields.items():
            extra: Any = field.json_schema_extra or {}
            assert field.description, f"{section.entry.__name__}.{name}"
            assert extra.get("equations"), f"{section.entry.__name__}.{name}"


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_every_example_is_a_model_with_a_consistent_state(path: Path) -> None:
    assert hamel.check(path).model == path.stem


@pytest.mark.slow
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_every_example_is_built_and_verified(path: Path, tmp_path: Path) -> None:
    hamel.build(path, out=tmp_path / path.stem)
    assert hamel.verify(path).passed


def numbers(path: Path) -> Iterator[tuple[str, str, Scalar]]:
    """Keys with a unit, their unit, and a number of theirs in an example."""
    source = Source(path.read_text("utf-8"), str(path), path.parent)
    document = structured(expanded(parsed(source), source), source)
    for owner, name, value in reference._uses(document):
        extra: Any = owner.model_fields[name].json_schema_extra or {}
        inner = first(value)
        if "unit" in extra and inner is not None and not inner.span.file and measured(owner, name):
            yield f"{owner.__name__}.{name}", extra["unit"], inner


def measured(owner: type[Entry], name: str) -> bool:
    """Whether the key holds a number or a formula, in a plain list at most."""
    words = reference._spelled(reference._hints(owner)[name])
    return "list of lists" not in words and ("number" in words or "formula" in words)


def first(value: Any) -> Scalar | None:
    """The first number of a value; None in a mapping, whose keys have units of their own."""
    while isinstance(value, list) and value:
        value = value[0]
    return value if isinstance(value, Scalar) else None


def diagnosed(path: Path, scalar: Scalar, text: str) -> list[Diagnostic]:
    """What is said of the example's place where `text` stands there."""
    lines = path.read_text("utf-8").splitlines()
    line, at = lines[scalar.span.line - 1], scalar.span.column - 1
    lines[scalar.span.line - 1] = line[:at] + text + line[at + len(scalar.text) :]
    try:
        load_text("\n".join(lines), str(path), path.parent)
    except ModelError as error:
        return [x for x in error.diagnostics if x.line == scalar.span.line]
    return []


def units_refused(name: str, unit: str, scalar: Scalar, path: Path) -> bool:
    """Whether another unit is refused there and the right one is not."""
    wrong = diagnosed(path, scalar, ANOTHER)
    right = [diagnosed(path, scalar, f"1 {one}".replace(" 1", "")) for one in alternatives(unit)]
    spoken = [[x for x in found if "in " in x.message and x.expected] for found in right]
    return bool(wrong) and not all(spoken)


def alternatives(unit: str) -> list[str]:
    return [one.strip() for one in unit.split("|")]


PLACES = [(path, *place) for path in EXAMPLES for place in numbers(path)]


@pytest.mark.parametrize("name", sorted({place[1] for place in PLACES}))
def test_the_unit_of_a_key_is_the_one_that_is_demanded(name: str) -> None:
    path, _, unit, scalar = next(place for place in PLACES if place[1] == name)
    assert units_refused(name, unit, scalar, path), (unit, scalar)
    assert not units_refused(name, "kg*s", scalar, path) or unit == "1"


@pytest.mark.parametrize(
    ("axis", "second"),
    [
        ("x", (0.0, 1.0, 0.0)),
        ("y", (0.0, 0.0, 1.0)),
        ("z", (1.0, 0.0, 0.0)),
        ("[0.6, 0, 0.8]", (0.8, 0.0, -0.6)),
    ],
)
def test_a_second_axis_that_is_left_out_is_the_one_that_the_page_says(
    axis: str, second: tuple[float, ...]
) -> None:
    assert PAGE.read_text("utf-8").count("| y after x, z after y, x after z: by the largest") == 2
    model = load_text(
        "model: m\nbodies: {b: {mass: 1 kg, inertia: [1, 1, 1]}}\n"
        f"joints: {{J: {{type: universal, parent: ground, child: b, axis: {axis}}}}}\n"
    )
    found = model.joints[0].axis2
    assert found is not None and placements.numbers(found) == pytest.approx(second, abs=1e-15)
