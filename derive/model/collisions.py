"""Two things with one name, or names that become one identifier in generated code."""

from __future__ import annotations

from derive.model.language.shape import Document
from derive.model.mechanism.frames import Names
from derive.model.names import identifier
from derive.model.reader import Reader
from derive.model.records import Span


def check_collisions(reader: Reader, document: Document, names: Names) -> None:
    """Two things with one name, or names that become one identifier in C."""
    places = [("parameter", p.name, p.span) for p in names.parameters]
    places += [("coordinate", c.name, c.span) for c in names.coordinates]
    places += [("input", u.name, u.span) for u in names.inputs]
    places += [("state", str(key), key.span) for key in document.states]
    places += [("definition", str(key), key.span) for key in document.where]
    places += [("delayed input", name, span) for x in names.delays for name, span in x.names]
    places += [("velocity", v.name, v.span) for v in names.velocities if not v.rate_of]
    _check_distinct(reader, places)
    _check_constants(reader, document.model.text, places)
    ties = [("joint", str(key), key.span) for key in document.joints]
    ties += [("closure", str(key), key.span) for key in document.closures]
    ties += [("constraint", str(key), key.span) for key in document.constraints]
    _check_distinct(reader, ties)


def _check_constants(reader: Reader, model: str, places: list[tuple[str, str, Span]]) -> None:
    """A parameter ARM_NX of a model `arm` would be the size that the header of arm defines."""
    prefix = f"{model.upper()}_"
    for kind, name, span in places:
        if name.startswith(prefix) and name.isupper():
            reader.report(
                span,
                f"the {kind} '{name}' is like the constants {prefix}… of the generated header",
                f"another name, such as {name.lower()}",
            )


def _check_distinct(reader: Reader, places: list[tuple[str, str, Span]]) -> None:
    seen: dict[str, tuple[str, str, Span]] = {}
    for kind, name, span in places:
        if not name.isascii():
            continue  # no name, which is said where it stands
        mapped = identifier(name)
        if mapped in seen:
            other, first, place = seen[mapped]
            same = (
                f"the name of a {other}"
                if first == name
                else f"like the {other} '{first}' in generated code"
            )
            reader.report(
                span,
                f"the {kind} '{name}' is {same}, line {place.line}, column {place.column}",
                "another name",
            )
        seen.setdefault(mapped, (kind, name, span))
