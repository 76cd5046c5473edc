"""The derivation as data: sections of paragraphs, tables and displayed formulas. Both writers print
exactly this."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from derive.expressions.deferred import Term


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
    """A matrix equation; `residual` is its left side minus its right side. The page does not need
    it: of long mechanisms it is not formed."""

    name: str
    latex: str
    residual: Term[ca.SX] = Term()


@dataclass(frozen=True)
class Line:
    """left = right; a long right side comes in pieces, between which a line may end. `place` says
    which formula of `Document.printed` it shows and which entry of it, −1 for all; `where` lines
    explain symbols of the lines before them."""

    left: str
    right: tuple[str, ...]
    relation: str = "="
    place: tuple[int, int] | None = None
    where: bool = False


@dataclass(frozen=True)
class Paragraph:
    """Running text with formulas in it."""

    runs: Runs


@dataclass(frozen=True)
class Display:
    """Equations under one number; `boxed` ones are what a derivation ends in. `folded` ones
    are too long to be read with the text."""

    lines: tuple[Line, ...]
    number: int
    boxed: bool = False
    folded: bool = False


@dataclass(frozen=True)
class Pattern:
    """Which entries of a matrix are not zero: `marks` row by row, " " for zero, "1" for a number,
    "x" for anything else. `name` is LaTeX."""

    name: str
    marks: tuple[str, ...]


@dataclass(frozen=True)
class Table:
    head: tuple[str, ...]
    rows: tuple[tuple[Runs, ...], ...]


@dataclass(frozen=True)
class Items:
    items: tuple[Runs, ...]


Block = Paragraph | Display | Pattern | Table | Items


@dataclass(frozen=True)
class Section:
    """`column` is 1 or 2 where two sections stand side by side, else 0."""

    title: str
    anchor: str
    blocks: tuple[Block, ...]
    column: int = 0


@dataclass(frozen=True)
class Meaning:
    """A line of the table of symbols."""

    latex: str
    about: Runs
    unit: str


@dataclass(frozen=True, eq=False)
class Document:
    """A derivation from title to last section, independent of how it is written down."""

    title: str
    subtitle: str
    sections: tuple[Section, ...]
    printed: tuple[Printed, ...]
    laws: tuple[Law, ...]
    version: str
    state: str = ""  # in words, at which `numbers` holds
    numbers: tuple[tuple[float, ...], ...] = ()  # of every printed formula, row by row
