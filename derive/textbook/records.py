"""The derivation as data: sections of paragraphs, tables and displayed formulas. Both writers print
exactly this."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca


@dataclass(frozen=True)
class Text:
    """Plain text, possibly the user's: each writer escapes it."""

    text: str


@dataclass(frozen=True)
class Math:
    """LaTeX of our own making: printed as it is."""

    latex: str


@dataclass(frozen=True)
class Ref:
    """A displayed equation that is referred to by its number."""

    number: int


Run = Text | Math | Ref
Runs = tuple[Run, ...]


@dataclass(frozen=True, eq=False)
class Printed:
    """One displayed formula, left = right.

    `right` is a SymPy matrix; `left` has its entries' symbols row by row, None where the entry has
    no symbol of its own. `value` is the CasADi term (same shape) that `right` must equal once the
    formulas before it have been evaluated.
    """

    name: str
    latex: str
    left: tuple[Any, ...]
    right: Any
    value: ca.SX

    @property
    def symbols(self) -> tuple[Any, ...]:
        """The symbols of the right side in the order of their names: SymPy's own order may differ
        from run to run."""
        return tuple(sorted(self.right.free_symbols, key=lambda s: s.name))


@dataclass(frozen=True, eq=False)
class Law:
    """A matrix equation; `residual` is its left side minus its right side."""

    name: str
    latex: str
    residual: ca.SX


@dataclass(frozen=True)
class Line:
    """left = right; a long right side comes in pieces, one per line."""

    left: str
    right: tuple[str, ...]
    relation: str = "="


@dataclass(frozen=True)
class Paragraph:
    """Running text with formulas in it."""

    runs: Runs


@dataclass(frozen=True)
class Display:
    """Equations under one number; `boxed` ones are what a derivation ends in. `formulas` are the
    places in `Document.printed` of what is in it, in order."""

    lines: tuple[Line, ...]
    number: int
    boxed: bool = False
    formulas: tuple[int, ...] = ()


@dataclass(frozen=True)
class Table:
    head: tuple[str, ...]
    rows: tuple[tuple[Runs, ...], ...]


@dataclass(frozen=True)
class Items:
    items: tuple[Runs, ...]


Block = Paragraph | Display | Table | Items


@dataclass(frozen=True)
class Section:
    """`column` is 1 or 2 where two sections stand side by side, else 0."""

    title: str
    anchor: str
    blocks: tuple[Block, ...]
    column: int = 0


@dataclass(frozen=True, eq=False)
class Document:
    """A derivation from title to last section, independent of how it is written down."""

    title: str
    subtitle: str
    sections: tuple[Section, ...]
    printed: tuple[Printed, ...]
    laws: tuple[Law, ...]
    version: str
