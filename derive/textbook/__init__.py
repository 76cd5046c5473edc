"""The derivation to read: every formula on the page is converted from the CasADi term that is
compiled.

`html` and `latex` write one page; `printed` gives its formulas as SymPy expressions, each beside
the CasADi term it claims to equal, so that a test can evaluate both. `laws` gives its matrix
equations as residuals that must vanish.
"""

from __future__ import annotations

from collections.abc import Sequence

from derive.formulations.records import Equations
from derive.textbook.derivation import derivation
from derive.textbook.records import Law, Printed
from derive.textbook.roads import ROADS
from derive.textbook.writing.html import page
from derive.textbook.writing.latex import article

__all__ = ["ROADS", "html", "latex", "laws", "printed"]


BLOCKS = ("block_inversion",)


def html(equations: Equations, figure: str = "", roads: Sequence[str] = BLOCKS) -> str:
    """One self-contained page: MathML, no script, no network; it opens with a figure (SVG) where
    one is given. Of two roads the page puts one beside the other."""
    return page(derivation(equations, roads), figure)


def latex(equations: Equations, figure: str = "", roads: Sequence[str] = BLOCKS) -> str:
    """A standalone article for pdfLaTeX (amsmath, graphicx, and tikz where a picture of it is
    given)."""
    return article(derivation(equations, roads), figure)


def printed(equations: Equations, roads: Sequence[str] = BLOCKS) -> tuple[Printed, ...]:
    """Every displayed formula, in order: what is on the left, what is on the right, and the term
    that it must equal."""
    return derivation(equations, roads).printed


def laws(equations: Equations, roads: Sequence[str] = BLOCKS) -> tuple[Law, ...]:
    """Every displayed matrix equation, as left side minus right side."""
    return derivation(equations, roads).laws
