"""SymPy expressions as LaTeX, in the order a person writes: number, parameters, positions,
velocities, sums, functions."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy
from sympy import Expr
from sympy.core.function import AppliedUndef
from sympy.core.relational import Relational
from sympy.functions.elementary.piecewise import ExprCondPair

from derive.textbook.formulas.measure import letters

LINE = 62  # visible characters in one line of a sum
PIECE = 20  # of a part that is not broken
ALONE = 4  # of a factor that no line ends after
OPENING = r"\Bigl("
CALLED = {
    "sin": r"\sin",
    "cos": r"\cos",
    "tan": r"\tan",
    "sinh": r"\sinh",
    "cosh": r"\cosh",
    "tanh": r"\tanh",
    "log": r"\ln",
    "exp": r"\exp",
    "asin": r"\arcsin",
    "acos": r"\arccos",
    "atan": r"\arctan",
    "Min": r"\min",
    "Max": r"\max",
    "atan2": r"\mathrm{atan2}",
    "sign": r"\mathrm{sign}",
}
EULER = frozenset(("e", r"\mathrm{e}"))  # names that would look like Euler's number
RELATIONS = {"<": "<", "<=": r"\le", ">": ">", ">=": r"\ge", "==": "=", "!=": r"\ne"}
NOTHING_ELSE = ExprCondPair(0, True)
_WORD = re.compile(r"\\(sin|cos|tan|arcsin|arccos|arctan|ln|min|max)(?![A-Za-z])")
_UPRIGHT = re.compile(r"(\\(d?dot|hat|bar|tilde)\{)*\\mathrm\{[^{}]{2,}")  # a name that is a word
SIDE, SIGN = r" \, ", r" \cdot "  # between factors
_ENTRY = re.compile(r"[A-Z]\w*\[\d+,\d+\]")  # of a matrix
_COMMAND = re.compile(
    r"\\(frac|left|right|mathrm|mathbf|boldsymbol|begin\{bmatrix\}|end\{bmatrix\}"
    r"|dot|ddot|bar|Bigl|Bigr)(?![A-Za-z])|\\,"
)
_MARKS = re.compile(r"[{}^_\s]")  # after commands: they end names


@dataclass(frozen=True)
class _Spelling:
    """The last word in an order: an expression as SymPy writes it, which takes long and is asked
    for only where everything before it is equal."""

    expression: Expr

    def __lt__(self, other: _Spelling) -> bool:
        return str(self.expression) < str(other.expression)


class Typesetter:
    """`names` gives the LaTeX of every symbol, in the order in which symbols stand in a product or
    sum, parameters first."""

    def __init__(self, names: Mapping[Expr, str], parameters: int = 0) -> None:
        self.names, self.parameters = names, parameters
        self._order: dict[sympy.Basic, int] = {}
        # what comes again and again, such as the lengths of springs in a row of them; names are
        # only ever added, so that nothing here becomes wrong
        self._written: dict[Expr, str] = {}
        self._ranked: dict[Expr, tuple[tuple[bool, int], ...]] = {}
        self._places: dict[sympy.Basic, tuple[bool, int]] = {}

    def latex(self, x: Expr) -> str:
        """An expression as LaTeX."""
        if x not in self._written:
            self._written[x] = self._sum(x) if x.is_Add else self._product(x)
        return self._written[x]

    def pieces(self, x: Expr, line: int = PIECE) -> tuple[str, ...]:
        """The formula in pieces between which a line may end, broken between the terms of sums and
        between factors."""
        return tuple(self._breakable(x, line))

    def _breakable(self, x: Expr, line: int) -> list[str]:
        """Parts between which a line may end; they give the formula when put together."""
        if x.is_Add:
            parts = [self._breakable(term, line) for term in sorted(x.args, key=self._place_in_sum)]
            return [
                *parts[0],
                *[piece for part in parts[1:] for piece in (_signed(part[0]), *part[1:])],
            ]
        whole = self.latex(x)
        factor, inside = _bracket(x)
        if width(whole) <= line:
            return [whole]
        if inside is None:
            return self._factors(x, whole)
        sign = SIGN if self._ends_in_word(factor) else " "
        opening = f"{self._before(factor)}{sign}{OPENING}"
        return _opened(opening, self._breakable(inside, line), line)

    def _factors(self, x: Expr, whole: str) -> list[str]:
        """A product factor by factor; over a divisor stand numbers and symbols alone,
        where there are sums."""
        negative, product = _is_negative(x), -x if _is_negative(x) else x
        over, under = _split(product)
        before = [f for f in over if f.is_Number or f.is_Symbol] if under else []
        after = [f for f in over if f not in before]
        sums = [f for f in after if f.is_Add]
        if not sums if under else len(after) < 2:
            return [whole]
        pieces: list[str] = []
        if under:
            pieces = [rf"\frac{{{self._juxtaposed(before)}}}{{{self._juxtaposed(under)}}}"]
        before_it: Expr | None = None
        for f in sorted(after, key=self._place_in_product):
            own = self._factor_pieces(f)
            own[0] = f"{self._between(before_it, f).lstrip()}{own[0]}" if pieces else own[0]
            before_it = f
            if pieces and width(pieces[-1]) <= ALONE:  # a short factor stays with the next
                own[0] = pieces.pop() + own[0]
            pieces += own
        return [("-" if negative else "") + pieces[0], *pieces[1:]]

    def _factor_pieces(self, f: Expr) -> list[str]:
        """A factor; a long sum in brackets is broken between its terms."""
        whole = self._factor(f)
        if not f.is_Add or width(whole) <= PIECE:
            return [whole]
        return _opened(OPENING, self._breakable(f, PIECE), PIECE)

    def matrix(self, rows: Sequence[Sequence[Expr]]) -> str:
        """Rows of expressions as a bracketed matrix."""
        cells = [" & ".join(self.latex(x) for x in row) for row in rows]
        return r"\begin{bmatrix} " + r" \\ ".join(cells) + r" \end{bmatrix}"

    def _sum(self, x: Expr) -> str:
        first, *rest = [self._product(term) for term in sorted(x.args, key=self._place_in_sum)]
        return "".join([first, *map(_signed, rest)])

    def _before(self, factor: Expr) -> str:
        """What stands before a bracket."""
        return "" if factor == 1 else "-" if factor == -1 else self.latex(factor)

    def _place_in_sum(self, term: Expr) -> tuple[object, ...]:
        """Positive terms first, then by the symbols in the order of `names`; plain numbers last."""
        return term.could_extract_minus_sign(), term.is_Number, self._ranks(term), _Spelling(term)

    def _ranks(self, x: Expr) -> tuple[tuple[bool, int], ...]:
        if x not in self._ranked:
            self._ranked[x] = tuple(sorted(self._rank(s) for s in x.free_symbols))
        return self._ranked[x]

    def _rank(self, s: sympy.Basic) -> tuple[bool, int]:
        """Parameters, entries of matrices, then everything else as it was declared."""
        if s not in self._places:
            place = self._place(s)
            early = place < self.parameters or _ENTRY.fullmatch(str(s)) is not None
            self._places[s] = (not early, place)
        return self._places[s]

    def _place(self, s: sympy.Basic) -> int:
        """Where its name was declared."""
        if s not in self._order:  # more and more are named as the page grows
            for later in [*self.names][len(self._order) :]:
                self._order[later] = len(self._order)
        return self._order[s]

    def _product(self, x: Expr) -> str:
        """Sign, then numerator over denominator."""
        sign, x = ("-", -x) if _is_negative(x) else ("", x)
        over, under = _split(x)
        if not under:
            return sign + self._juxtaposed(over)
        return f"{sign}\\frac{{{self._juxtaposed(over)}}}{{{self._juxtaposed(under)}}}"

    def _juxtaposed(self, factors: list[Expr]) -> str:
        """Factors side by side with a thin space; a sum stands in brackets unless it stands
        alone."""
        if not factors:
            return "1"
        if len(factors) == 1:
            return self._sum(factors[0]) if factors[0].is_Add else self._factor(factors[0])
        first, *rest = sorted(factors, key=self._place_in_product)
        product = self._factor(first)
        for before, factor in zip([first, *rest], rest):
            product += self._between(before, factor) + self._factor(factor)
        return product

    def _between(self, before: Expr | None, factor: Expr) -> str:
        """Words need a sign: with a space alone they would read as part of the name beside them."""
        words = self._is_word(factor) or (before is not None and self._is_word(before))
        return SIGN if words else SIDE

    def _is_word(self, factor: Expr) -> bool:
        """Whether it is a name in upright letters, or a power of one."""
        is_root = factor.is_Pow and factor.exp == sympy.Rational(1, 2)
        base = factor.base if factor.is_Pow and not is_root else factor
        return bool(base.is_Symbol and _UPRIGHT.match(self.names[base]))

    def _ends_in_word(self, product: Expr) -> bool:
        over, under = _split(product)
        last = max(over, key=self._place_in_product, default=None)
        return last is not None and not under and self._is_word(last)

    def _place_in_product(self, factor: Expr) -> tuple[object, ...]:
        base = factor.base if factor.is_Pow else factor
        kind = 0 if base.is_Number else 1 if base.is_Symbol else 2 if base.is_Add else 3
        return kind, self._ranks(factor), _Spelling(factor)

    def _factor(self, x: Expr) -> str:
        if x.is_Symbol:
            return self.names[x]
        if x.is_Number:
            return _number(x)
        if x.is_Pow:
            return self._power(x)
        if x.is_Add or x.is_Mul:
            return self._bracketed(x)
        return self._call(x)

    def _bracketed(self, x: Expr) -> str:
        return rf"\left({self.latex(x)}\right)"

    def _power(self, x: Expr) -> str:
        if x.exp == sympy.Rational(1, 2):
            return rf"\sqrt{{{self.latex(x.base)}}}"
        exponent = self.latex(x.exp)
        if (
            x.base.is_Function
            and x.exp.is_Integer
            and x.exp > 0
            and str(x.base.func) in ("sin", "cos", "tan")
        ):
            return self._call(x.base, exponent)
        if x.base.is_Symbol:
            return f"{_raisable(self.names[x.base])}^{{{exponent}}}"
        if x.base.is_Number and not x.base.is_negative and not x.base.is_Rational:
            return f"{_number(x.base)}^{{{exponent}}}"
        return f"{self._bracketed(x.base)}^{{{exponent}}}"

    def _call(self, x: sympy.Basic, power: str = "") -> str:
        name = str(x.func)
        arguments = ", ".join(self.latex(a) for a in x.args)
        if isinstance(x, sympy.Abs):
            return rf"\left|{arguments}\right|"
        if isinstance(x, sympy.exp) and EULER.isdisjoint(self.names.values()):
            return f"e^{{{arguments}}}"
        if isinstance(x, sympy.Piecewise | AppliedUndef) or name not in CALLED:
            return self._otherwise(x)
        raised = f"^{{{power}}}" if power else ""
        simple = len(x.args) == 1 and x.args[0].is_Symbol
        return f"{CALLED[name]}{raised}" + (
            f" {arguments}" if simple else rf"\left({arguments}\right)"
        )

    def _otherwise(self, x: sympy.Basic) -> str:
        if isinstance(x, sympy.Piecewise) and x.args[1:] == (NOTHING_ELSE,):
            return self._where(*x.args[0].args)
        return sympy.latex(x, symbol_names=dict(self.names))

    def _where(self, value: Expr, condition: sympy.Basic) -> str:
        """value [condition], which is zero where the condition does not hold (Iverson)."""
        bracket = rf"\left[{self._condition(condition)}\right]"
        if value == 1:
            return bracket
        simple = not (value.is_Add or _is_negative(value))
        sign = SIGN if simple and self._ends_in_word(value) else SIDE
        return f"{self.latex(value) if simple else self._bracketed(value)}{sign}{bracket}"

    def _condition(self, x: sympy.Basic) -> str:
        if not isinstance(x, Relational):
            return sympy.latex(x, symbol_names=dict(self.names))
        return f"{self.latex(x.lhs)} {RELATIONS[x.rel_op]} {self.latex(x.rhs)}"


def merged(pieces: Sequence[str], line: float = LINE) -> tuple[str, ...]:
    """Pieces of a formula put together in lines of about so many letters."""
    lines: list[str] = []
    for piece in pieces:
        if lines and letters(lines[-1]) + letters(piece) <= line:
            lines[-1] += piece
        else:
            lines.append(piece)
    return tuple(lines)


def digits(x: Expr) -> str:
    """The significant digits of a number."""
    return f"{abs(float(x)):.14e}".partition("e")[0].replace(".", "").rstrip("0")


def _raisable(name: str) -> str:
    """A name that has an index above needs brackets before it is raised to a power."""
    return rf"\left({name}\right)" if "^" in name else name if name[-1] != "'" else f"{{{name}}}"


def _signed(term: str) -> str:
    """A later term of a sum, its sign in front."""
    return f" - {term[1:].lstrip()}" if term.startswith("-") else f" + {term}"


def _opened(before: str, terms: list[str], line: int) -> list[str]:
    """Terms between brackets; where the first is long, a line may end after the opening one."""
    closed = [*terms[:-1], terms[-1] + r"\Bigr)"]
    if width(before) + width(closed[0]) > line:
        return [before, *closed]
    return [before + closed[0], *closed[1:]]


def _bracket(x: Expr) -> tuple[Expr, Expr | None]:
    """factor, sum of factor · sum, where the sum can stand last: no function before it would seem
    to take it in."""
    if not x.is_Mul:
        return x, None
    sums = [f for f in x.args if f.is_Add]
    rest = sympy.Mul(*[f for f in x.args if not f.is_Add])
    clear = len(sums) == 1 and not any(f.has(sympy.Function) for f in _split(rest)[0])
    return (rest, sums[0]) if clear else (x, None)


def _is_negative(x: Expr) -> bool:
    return bool(
        (x.is_Number and x.is_negative)
        or (x.is_Mul and x.args[0].is_Number and x.args[0].is_negative)
    )


def _split(x: Expr) -> tuple[list[Expr], list[Expr]]:
    over: list[Expr] = []
    under: list[Expr] = []
    for f in x.args if x.is_Mul else (x,):
        if isinstance(f, sympy.Rational):
            over += [sympy.Integer(f.p)] if f.p != 1 else []
            under += [sympy.Integer(f.q)] if f.q != 1 else []
        elif f.is_Pow and f.exp.is_Number and f.exp.is_negative:
            under.append(f.base**-f.exp)
        else:
            over.append(f)
    return over, under


def _number(x: Expr) -> str:
    """Digits that read back as the same number."""
    if isinstance(x, sympy.Integer):
        return str(x)
    if isinstance(x, sympy.Rational):
        return rf"\frac{{{x.p}}}{{{x.q}}}"
    mantissa, _, exponent = f"{float(x):.15g}".partition("e")
    return rf"{mantissa} \cdot 10^{{{int(exponent)}}}" if exponent else mantissa


def width(latex: str) -> int:
    """About how many characters wide the formula is; four thin spaces count as one."""
    spaces = latex.count(r"\,") // 4
    commands = _COMMAND.sub("", _WORD.sub(r"\1", latex))
    return spaces + len(_MARKS.sub("", re.sub(r"\\[A-Za-z]+", "x", commands)))
