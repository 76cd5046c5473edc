"""M_w ẇ = f_w − h_w solved on the page: symmetric elimination M_w = L D Lᵀ, the last quasi-velocity
first, in named steps."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import sympy

from derive.textbook.forces import column_bias, column_force
from derive.textbook.formulas.layout import Rows, sum_of
from derive.textbook.manuscript import Manuscript


class Elimination:
    """Every step is made twice: in symbols, for the page, and in CasADi terms, which the symbols
    are compared with."""

    def __init__(self, doc: Manuscript, M: Rows, f: Sequence[sympy.Expr]) -> None:
        n = len(f)
        M_w, f_w = doc.terms.named("M_w"), column_force(doc.terms) - column_bias(doc.terms)
        self.doc, self.n = doc, n
        self.M, self.f = [list(row) for row in M], list(f)
        self.M_terms = [[M_w[i, j] for j in range(n)] for i in range(n)]
        self.f_terms = [f_w[i] for i in range(n)]
        self.factors: dict[tuple[int, int], sympy.Expr] = {}
        self.steps: list[tuple[sympy.Symbol, sympy.Expr, ca.SX]] = []

    def accelerations(self) -> list[sympy.Expr]:
        """Prints the elimination; ẇ one after the other, each over the rates before it: ẇₖ = ηₖ/δₖ
        − Σ ℓᵢₖ ẇᵢ."""
        doc = self.doc
        doc.say(
            "They are solved by symmetric elimination, $!M_w=!L\\,!D\\,!L^T$, from the last "
            "quasi-velocity to the first, with pivots $\\delta_k$, factors $\\ell_{ik}$ and "
            "right-hand sides $\\eta_k$:"
        )
        for k in reversed(range(self.n)):
            self._pivot(k)
            for i in range(k):
                self._eliminate(i, k)
        self._show()
        doc.mean(
            r"\delta_{k},\; \ell_{ik},\; \eta_{k}",
            "pivots, factors and right-hand sides of the elimination of $!M_w$",
        )
        doc.say("The explicit equations of motion are, one after the other:")
        rates = [doc.notation.rate(symbol) for symbol in doc.w]
        return [self._acceleration(k, rates) for k in range(self.n)]

    def _pivot(self, k: int) -> None:
        """Row k gives the pivot δ and the right-hand side η."""
        index = k + 1
        self.M[k][k] = self._named(
            f"delta[{index}]", rf"\delta_{{{index}}}", self.M[k][k], self.M_terms[k][k]
        )
        self.f[k] = self._named(f"eta[{index}]", rf"\eta_{{{index}}}", self.f[k], self.f_terms[k])

    def _eliminate(self, i: int, k: int) -> None:
        """Row i less ℓ times row k."""
        factor = self.M[i][k] / self.M[k][k]
        exact = self.M_terms[i][k] / self.M_terms[k][k]
        name, latex = f"l[{i + 1},{k + 1}]", rf"\ell_{{{i + 1}{k + 1}}}"
        factor = self.factors[i, k] = self._named(name, latex, factor, exact)
        self.f[i] = self.f[i] - factor * self.f[k]
        self.f_terms[i] = self.f_terms[i] - exact * self.f_terms[k]
        for j in range(i, k):
            self.M[i][j] = self.M[j][i] = self.M[i][j] - factor * self.M[j][k]
            term = self.M_terms[i][j] - exact * self.M_terms[j][k]
            self.M_terms[i][j] = self.M_terms[j][i] = term

    def _named(self, name: str, latex: str, x: sympy.Expr, value: ca.SX) -> sympy.Expr:
        """A symbol for x, or x itself where it is a number or a symbol."""
        if x.is_Number or x.is_Symbol:
            return x
        symbol = self.doc.notation.fresh(name, latex)
        self.steps.append((symbol, x, value))
        return symbol

    def _show(self) -> None:
        if self.steps:
            symbols = [symbol for symbol, _, _ in self.steps]
            expressions = [expression for _, expression, _ in self.steps]
            values = ca.vertcat(*[value for _, _, value in self.steps])
            self.doc.lines("elimination", symbols, expressions, values)

    def _acceleration(self, k: int, rates: Sequence[sympy.Symbol]) -> sympy.Expr:
        factors = [self.factors[i, k] for i in range(k)]
        return self.f[k] / self.M[k][k] - sum_of(factors, rates[:k])
