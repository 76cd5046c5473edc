"""The language reference: every key of a model file as a page, from the classes that read it and
from example models in which each key stands.

Types, defaults, units and what becomes of a key are those of the classes; the examples are found by
reading the models, so a key without one is seen (`without_example`).
"""

from __future__ import annotations

import types
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Union, cast, get_args, get_origin, get_type_hints

from derive.expressions.functions import FUNCTIONS, KINEMATIC_FUNCTIONS, Function
from derive.expressions.units import UNITS, compound
from derive.joints import CLOSURES, JOINTS
from derive.model.composing.composition import Composition
from derive.model.composing.expansion import expanded
from derive.model.document import Entries, Items, Scalar, Source, parsed
from derive.model.language.keys import Entry, ListKind, Nested, ScalarKind
from derive.model.language.shape import SECTIONS, Document, about
from derive.model.language.structure import shaped, structured

COLUMNS = (
    "key",
    "what it holds",
    "unit",
    "when left out",
    "meaning",
    "in the equations",
    "example",
)
WIDEST = 44  # characters of an example; what is longer is shortened
NOTHING = "—"


EXAMPLES = Path(__file__).parents[1] / "examples"


@dataclass(frozen=True)
class Section:
    """One class of entries: its title on the page, and a word that links to it."""

    title: str
    entry: type[Entry]

    @property
    def anchor(self) -> str:
        """What a heading of this title is called in links."""
        return self.title.replace(" ", "-").replace("`", "").replace(":", "").lower()


Shown = Mapping[tuple[type[Entry], str], tuple[str, str]]  # key → its example, the file


def examples() -> list[Path]:
    """The model files of the examples."""
    return sorted(EXAMPLES.glob("*.yaml"))


def page() -> str:
    """The reference in Markdown."""
    shown = _shown(examples())
    parts = [_HEAD, *(_section(section, shown) for section in sections())]
    parts += [_joints(), _functions(), _units(), _examples()]
    return "\n".join(parts).rstrip("\n")


def without_example(paths: Iterable[Path]) -> list[str]:
    """Keys that stand in none of these files."""
    shown = _shown(paths)
    return [
        f"{section.entry.__name__}.{name}"
        for section in sections()
        for name in section.entry.model_fields
        if _owner(section.entry, name) not in shown
    ]


def sections() -> list[Section]:
    """All classes of entries, each once: the file, then what stands in it, as it comes."""
    found = [Section("The file", Document), Section("Composition", Composition)]
    for name, hint in _hints(Document).items():
        if name in SECTIONS:
            found += [Section(f"`{name}:` {kind.name}", kind.entry) for kind in SECTIONS[name]]
        found += [Section(f"`{name}:`", entry) for entry in _classes(hint) if name not in SECTIONS]
    found += [Section("`submodels:`", e) for e in _classes(_hints(Composition)["submodels"])]
    return list(_with_inner(found, set()))


def _with_inner(found: Iterable[Section], seen: set[type[Entry]]) -> Iterator[Section]:
    for section in found:
        if section.entry in seen:
            continue
        seen.add(section.entry)
        yield section
        if section.entry in (Document, Composition):
            continue
        inner = [
            Section(f"{section.title} {name}", entry)
            for name, hint in _hints(section.entry).items()
            for entry in _classes(hint)
        ]
        yield from _with_inner(inner, seen)


def _hints(entry: type[Entry]) -> dict[str, Any]:
    """The annotations of the keys of an entry, in the order of the class."""
    hints = get_type_hints(entry, include_extras=True)
    return {name: hints[name] for name in entry.model_fields}


def _classes(hint: Any) -> Iterator[type[Entry]]:
    """Classes of entries in an annotation."""
    if isinstance(hint, type) and issubclass(hint, Entry):
        yield hint
    for inner in get_args(hint):
        yield from _classes(inner)


def _section(section: Section, shown: Shown) -> str:
    entry = section.entry
    said = "" if entry.__doc__ == Entry.__doc__ else about(entry)
    rows = [_row(entry, name, hint, shown) for name, hint in _hints(entry).items()]
    return f"## {section.title}\n\n{said}\n\n{_table(COLUMNS, rows)}"


def _row(entry: type[Entry], name: str, hint: Any, shown: Shown) -> list[str]:
    field = entry.model_fields[name]
    extra: Any = field.json_schema_extra or {}
    example, file = shown.get(_owner(entry, name), ("", ""))
    return [
        f"`{name}`",
        _spelled(hint),
        " or ".join(f"`{unit.strip()}`" for unit in extra.get("unit", "").split("|") if unit)
        or NOTHING,
        "has to be there" if field.is_required() else _otherwise(field.default, extra),
        field.description or "",
        extra.get("equations", ""),
        f"`{example}` [{file}](#{file})" if example else "",
    ]


def _otherwise(default: Any, extra: Mapping[str, str]) -> str:
    return extra.get("otherwise", NOTHING if default in (None, {}) else str(default))


def _spelled(hint: Any) -> str:
    """What a key holds, in words."""
    if get_origin(hint) is Annotated:
        return _annotated(hint)
    if get_origin(hint) in (Union, types.UnionType):
        parts = [_spelled(part) for part in get_args(hint) if part is not types.NoneType]
        return " or ".join(dict.fromkeys(parts))
    if get_origin(hint) is Literal:
        return " or ".join(f"`{word}`" for word in get_args(hint))
    if get_origin(hint) is dict:
        return f"mapping of names to {_many(_spelled(get_args(hint)[1]))}"
    if get_origin(hint) is list:
        return f"list of {_many(_spelled(get_args(hint)[0]))}"
    return "mapping"


def _annotated(hint: Any) -> str:
    for mark in hint.__metadata__:
        if isinstance(mark, ScalarKind):
            return mark.word
        if isinstance(mark, ListKind):
            return f"list of {mark.word}s"
    if hint == Nested:
        return "list of lists"
    return _spelled(hint.__origin__)


def _many(words: str) -> str:
    """Several of them: "numbers", "lists of numbers", "(a number or a mapping)"."""
    if " or " in words:
        return f"({words})"
    first, of, rest = words.partition(" of ")
    return f"{first}s{of}{rest}"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    return "".join(map(_line, [head, ["---"] * len(head), *rows]))


def _line(cells: Sequence[str]) -> str:
    inner = " | ".join(cell.replace("|", "\\|") for cell in cells)
    return f"| {inner} |\n"


def _joints() -> str:
    rows = [
        [
            f"`{joint.name}`",
            joint.about,
            _slots([slot.unit or "1" for slot in joint.coordinates]),
            _slots([slot.suffix or "rate of the coordinate" for slot in joint.velocities]),
            "yes" if joint.planar else "no",
            "yes" if joint.name in CLOSURES else "no",
        ]
        for joint in JOINTS
    ]
    head = (
        "type",
        "motion",
        "coordinates",
        "generalized velocities",
        "in a plane",
        "closes a loop",
    )
    return f"## Types of joints\n\n{_table(head, rows)}"


def _slots(words: Sequence[str]) -> str:
    return ", ".join(words) or NOTHING


def _functions() -> str:
    known: list[Function] = [*FUNCTIONS.values(), *KINEMATIC_FUNCTIONS.values()]
    rows = [[f"`{x.name}`", _arity(x), x.about] for x in known]
    return f"## Functions in formulas\n\n{_table(('function', 'arguments', 'what it gives'), rows)}"


def _arity(function: Function) -> str:
    least, most = function.arity
    return str(least) if least == most else f"{least} to {most}"


def _units() -> str:
    rows = [[f"`{symbol}`", _size(symbol)] for symbol in UNITS]
    return f"## Units\n\n{_table(('unit', 'in SI'), rows)}"


def _size(symbol: str) -> str:
    unit = compound([(symbol, 1)])
    return f"{unit.factor:.12g} {unit.si}".strip()


def _examples() -> str:
    return "\n".join(["## Examples\n", *map(_example, examples())])


def _example(path: Path) -> str:
    return f"### {path.stem}\n\n```yaml\n{path.read_text('utf-8').strip()}\n```\n"


def _shown(paths: Iterable[Path]) -> Shown:
    """The first place where each key stands in the files."""
    found: dict[tuple[type[Entry], str], tuple[str, str]] = {}
    for path in paths:
        source = Source(path.read_text("utf-8"), str(path), path.parent)
        node = parsed(source)
        for entry in (_composition(node, source), structured(expanded(node, source), source)):
            for owner, name, value in _uses(entry):
                found.setdefault(_owner(owner, name), (_shortened(name, value), path.stem))
    return found


def _owner(entry: type[Entry], name: str) -> tuple[type[Entry], str]:
    """The class that says what a key is, of an entry or of what it stands for."""
    return next(c for c in entry.__mro__ if name in vars(c).get("__annotations__", {})), name


def _composition(node: Entries, source: Source) -> Composition:
    own = {key: value for key, value in node.items() if key in Composition.model_fields}
    return shaped(Composition, Entries(own, node.span), source)


def _uses(value: Any) -> Iterator[tuple[type[Entry], str, Any]]:
    """Keys that are given, in an entry and in all that it holds."""
    if isinstance(value, Entry):
        for name in _given(value):
            inner: Any = getattr(value, name)
            yield type(value), name, inner
            yield from _uses(inner)
    elif isinstance(value, dict):
        for inner in cast("dict[str, Any]", value).values():
            yield from _uses(inner)
    elif isinstance(value, list):
        for inner in cast("list[Any]", value):
            yield from _uses(inner)


def _given(entry: Entry) -> list[str]:
    """Keys that stand in the file, in the order of the class."""
    return [name for name in type(entry).model_fields if name in entry.model_fields_set]


def _shortened(name: str, value: Any) -> str:
    text = f"{name}: {_flow(value)}"
    if len(text) <= WIDEST:
        return text
    return f"{name}: {{…}}" if isinstance(value, dict | Entry) else f"{text[: WIDEST - 1]}…"


def _flow(value: Any) -> str:
    """A value as it could stand in one line of YAML."""
    if isinstance(value, Scalar):
        return value.text
    if isinstance(value, Items | list):
        return f"[{', '.join(map(_flow, cast('list[Any]', value)))}]"
    if isinstance(value, Entry):
        value = {name: getattr(value, name) for name in _given(value)}
    if isinstance(value, dict):
        entries = cast("dict[str, Any]", value)
        return f"{{{', '.join(f'{key}: {_flow(inner)}' for key, inner in entries.items())}}}"
    return str(value)


_HEAD = """# Reference of the model language

Every key of a model file. This page is written by `hamel schema --page` from the classes that
read model files; [models.md](../models.md) is the page to learn from. The examples stand in the
models at the end, which the tests read, build and verify.

* *number*: a formula of numbers and parameters, with its unit: `2*l`, `30 deg`, `9.81 m/s^2`.
* *formula*: one that may use what moves too: coordinates, rates, inputs, states and t, where the
  place allows them.
* *name*: of something in the file. *word*: one of a few. *text*: for readers, or a file.
* Units are those that a number must have; any of the same dimension is converted. Where several
  stand, they go with what the entry acts on: m or rad.
* In the equations: q coordinates, v generalized velocities, w quasi-velocities, z states, u inputs,
  p parameters, y outputs; q̇ = N v, M v̇ + h = Q + Aᵀλ, φ = 0, A v = c, T and V the energies.
"""
