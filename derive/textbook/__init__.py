"""The derivation to read: every formula on the page is converted from the CasADi term that is
compiled.

`html` and `latex` write one page; `printed` gives its formulas as SymPy expressions, each beside
the CasADi term it claims to equal, so that a test can evaluate both. `laws` gives its matrix
equations as residuals that must vanish.
"""

from __future__ import annotations

from derive.formulations.records import Equations
from derive.textbook.derivation import derivation
from derive.textbook.records import Law, Printed
from derive.textbook.write_html import page
from derive.textbook.write_latex import article

__all__ = ["html", "latex", "laws", "printed"]


def html(equations: Equations) -> str:
    """One self-contained page: MathML, no script, no network."""
    return page(derivation(equations))


def latex(equations: Equations) -> str:
    """A standalone article for pdfLaTeX (amsmath, graphicx)."""
    return article(derivation(equations))


def printed(equations: Equations) -> tuple[Printed, ...]:
    """Every displayed formula, in order: what is on the left, what is on the right, and the term
    that it must equal."""
    return derivation(equations).printed


def laws(equations: Equations) -> tuple[Law, ...]:
    """Every displayed matrix equation, as left side minus right side."""
    return derivation(equations).laws
