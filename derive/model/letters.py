"""`symbol:` of parameters, coordinates, joints and bodies: how a name is typeset, as a little
LaTeX."""

from __future__ import annotations

import re
from collections.abc import Sequence

from derive.model.document import Items, Scalar
from derive.model.language.entries import CoordinateEntry, ParameterEntry
from derive.model.language.shape import Document
from derive.model.names import COMMANDS, cut
from derive.model.reader import Reader
from derive.model.records import Coordinate

MOST = 60  # characters
# letters, digits, indices and a few commands
ALLOWED = re.compile(rf"(\\(?:{COMMANDS.replace(' ', '|')})(?![A-Za-z])|[A-Za-z0-9',_^{{}}]| )+")
NO_INDEX = re.compile(r"[_^]\s*(?:[_^}]|$)")  # a sign with nothing after it


def letters(
    reader: Reader, document: Document, coordinates: Sequence[Coordinate]
) -> tuple[tuple[str, str], ...]:
    """Name → LaTeX of the parameters and coordinates that say so; a joint says it of its
    coordinates, from the first on."""
    given: list[tuple[str, Scalar | None]] = [
        (str(key), entry.symbol)
        for key, entry in (*document.parameters.items(), *document.coordinates.items())
        if isinstance(entry, ParameterEntry | CoordinateEntry)
    ]
    of_joints: dict[str, list[str]] = {}
    for coordinate in coordinates:
        of_joints.setdefault(coordinate.owner, []).append(coordinate.name)
    for key, entry in document.joints.items():
        own = of_joints.get(str(key), [])
        given += _of_joint(reader, f"the joint '{key}'", own, entry.symbol)
    return _read(reader, given)


def _of_joint(
    reader: Reader, joint: str, own: Sequence[str], symbol: Scalar | Items | None
) -> list[tuple[str, Scalar | None]]:
    """The joint's coordinates, each with what it is called."""
    called: list[Scalar | None] = (
        list(symbol) if isinstance(symbol, Items) else [symbol] if symbol else []
    )
    if symbol is not None and not own:
        reader.report(symbol.span, f"{joint} has no coordinate to be called so")
    elif symbol is not None and len(called) > len(own):
        reader.report(symbol.span, f"{joint} has {len(own)} coordinates, not {len(called)}")
    return list(zip(own, called))


def of_bodies(reader: Reader, document: Document) -> tuple[tuple[str, str], ...]:
    """The same of bodies."""
    return _read(reader, [(str(key), entry.symbol) for key, entry in document.bodies.items()])


def _read(
    reader: Reader, given: Sequence[tuple[str, Scalar | None]]
) -> tuple[tuple[str, str], ...]:
    shown = [(name, scalar) for name, scalar in given if scalar is not None]
    return tuple((name, scalar.text.strip()) for name, scalar in shown if _fits(reader, scalar))


def _fits(reader: Reader, scalar: Scalar) -> bool:
    text = scalar.text.strip()
    right = ALLOWED.fullmatch(text) and not NO_INDEX.search(text) and _balanced(text)
    if right and len(text) <= MOST:
        return True
    reader.report(
        scalar.span,
        f"'{cut(text)}' is not a symbol",
        r"a letter of LaTeX with its indices, such as \delta_{1} or \hat{x}",
    )
    return False


def _balanced(text: str) -> bool:
    """Braces in pairs, and one index below and one above at most, with none of its own."""
    indices = [0, 0]
    depth = 0
    for sign in text:
        depth += (sign == "{") - (sign == "}")
        if depth < 0:
            return False
        if sign in "_^":
            if depth:
                return False
            indices["_^".index(sign)] += 1
    return depth == 0 and max(indices) <= 1
