"""The derivation to read: every formula on the page is converted from the CasADi term that is
compiled.

`html` and `latex` write one page; `printed` gives its formulas as SymPy expressions, each beside
the CasADi term it claims to equal, so that a test can evaluate both. `laws` gives its matrix
equations as residuals that must vanish.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from derive.formulations.records import Equations
    from derive.textbook.records import Law, Printed

__all__ = ["html", "latex", "laws", "printed"]


def html(equations: Equations) -> str:
    """One self-contained page: MathML, no script, no network."""
    from derive.textbook.derivation import derivation
    from derive.textbook.write_html import page

    return page(derivation(equations))


def latex(equations: Equations) -> str:
    """A standalone article for pdfLaTeX (amsmath, graphicx)."""
    from derive.textbook.derivation import derivation
    from derive.textbook.write_latex import article

    return article(derivation(equations))


def printed(equations: Equations) -> tuple[Printed, ...]:
    """Every displayed formula, in order: what is on the left, what is on the right, and the term
    that it must equal."""
    from derive.textbook.derivation import derivation

    return derivation(equations).printed


def laws(equations: Equations) -> tuple[Law, ...]:
    """Every displayed matrix equation, as left side minus right side."""
    from derive.textbook.derivation import derivation

    return derivation(equations).laws
