"""Names of the reactions of closures and constraints."""

from __future__ import annotations

from derive.model.constraints.rolling import RollingEntry
from derive.model.language.shape import Document
from derive.model.reader import Reader
from derive.model.rows import closure_parts, named, rolling_parts
from derive.model.scope import REACTION, Symbol


def enter_reactions(reader: Reader, document: Document) -> None:
    """reaction.ROW is the multiplier of a row, with all nonideal forces left out: NAME where a
    constraint is one row, NAME.PART where it is several.
    """
    rows = [
        row
        for key, entry in document.closures.items()
        for row in named(key, closure_parts(entry.type.text, reader.space.plane))
    ]
    for key, entry in document.constraints.items():
        rows += (
            named(key, rolling_parts(reader.space.plane))
            if isinstance(entry, RollingEntry)
            else [str(key)]
        )
    for row in rows:
        reader.scope.add(f"reaction.{row}", Symbol(frozenset({REACTION}), None))
