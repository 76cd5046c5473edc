"""Integrators as text: their coefficients as constants of C and of Python, and sums of slopes
written out for several motions side by side."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from codegen.integrators import (
    Collocation,
    Dense,
    Integrator,
    Midpoint,
    Rosenbrock,
    Tableau,
    Taylor,
)
from codegen.integrators.records import centred, collocated

KINDS: dict[type, str] = {
    Tableau: "explicit",
    Rosenbrock: "rosenbrock",
    Collocation: "collocation",
    Midpoint: "midpoint",
    Taylor: "taylor",
}


@dataclass(frozen=True)
class Scheme:
    """An integrator as text: the function of runtime_steps.h that steps, its coefficients as C, and
    its step control."""

    method: Integrator
    kind: str  # of the function KIND_step
    grow: str
    damp: str
    safety: str
    data: tuple[str, ...] = ()  # lines of C that define the coefficients
    coefficients: str = "NULL"  # their address


def scheme(method: Integrator, lanes: bool = False) -> Scheme:
    """The method as text, with what several motions side by side need of it where there are
    `lanes`."""
    grow, damp, safety = _control(method)
    kind, name = KINDS[type(method)], method.name
    if isinstance(method, Midpoint | Taylor):
        return Scheme(method, kind, grow, damp, safety)
    if isinstance(method, Tableau):
        data = [*(_sums(method) if lanes else []), *_tableau(method, lanes)]
    elif isinstance(method, Rosenbrock):
        data = _initialised("Rosenbrock", name, _rosenbrock(method))
    else:
        data = _initialised("Collocation", name, _collocation(method))
    return Scheme(method, kind, grow, damp, safety, tuple(data), f"&{name}")


def _initialised(kind: str, name: str, values: Sequence[str]) -> list[str]:
    return [f"static const {kind} {name} = {{", *(f"    {value}," for value in values), "};"]


Term = tuple[int, Fraction]  # a slope and its weight


def _terms(method: Tableau) -> list[list[Term]]:
    """Rows without their zeros: stages, estimates of the error, stages of the continuous output and
    its powers."""
    dense = method.dense or Dense(0, (), (), ())
    powers = (
        centred(((Fraction(0),) * len(dense.powers[0]), *dense.powers))
        if dense.c or dense.powers
        else ()
    )
    rows = [*method.a[1:], *method.errors, *dense.a, *powers]
    return [[(j, weight) for j, weight in enumerate(row) if weight] for row in rows]


def _sums(method: Tableau) -> list[str]:
    """A function with the sums of all rows written out, for several motions side by side."""
    terms = _terms(method)
    extra = len(method.dense.c) if method.dense else 0
    stages, errors = len(method.a) - 1, len(method.errors)
    powers = stages + errors + extra
    inside = {*range(stages - 1), *range(stages + errors, powers)}  # where nobody asks for the work
    macros = {n: "INSIDE" if n in inside else "MOVED" for n in (*inside, stages - 1, powers)}
    return [
        f"static void {method.name}_sums(int n, const double *restrict k, "
        "const double *restrict h, const double *restrict y, double *restrict z)",
        "{",
        "    int i;",
        "    switch (n) {",
        *(line for n, row in enumerate(terms) for line in _sum(n, row, macros.get(n, "CHANGE"))),
        "    }",
        "}",
    ]


def _sum(n: int, row: Sequence[Term], macro: str) -> list[str]:
    """Row n as a case of the function of sums. Compilers that contract take the first product into
    the first sum: with the second one there, roundings are those of the loop over the row."""
    turned = [*row[1:2], *row[:1], *row[2:]]
    products = [f"{number(weight)} * SLOPE({j})" for j, weight in turned] or ["0.0 * SLOPE(0)"]
    lines = textwrap.wrap(" + ".join(products), 120, break_long_words=False)
    last = len(lines) - 1
    return [
        f"    case {n}:",
        *(
            f"        {f'{macro}(' if i == 0 else '    '}{line}{')' if i == last else ''}"
            for i, line in enumerate(lines)
        ),
        "        break;",
    ]


def _tableau(method: Tableau, lanes: bool) -> list[str]:
    """Rows without their zeros, one after the other."""
    dense = method.dense or Dense(0, (), (), ())
    terms = _terms(method)
    starts = [sum(map(len, terms[:n])) for n in range(len(terms) + 1)]
    used = {j for row in (method.a[-1], *method.errors) for j, weight in enumerate(row) if weight}
    stages, name = len(method.c) - 1, method.name
    weighted = sum(1 << n for n in used | {stages})
    weights = [number(weight) for row in terms for _, weight in row]
    (a, b), rough = _insides(method) if method.dense else (0, 0), "NULL"
    through: list[str] = []
    if lanes and method.dense:
        rough = f"{name}_rough[0]"
        rows = (_list(row) for row in _rough(method.c[a], method.c[b]))
        through = [f"static const double {name}_rough[8][6] = {{{', '.join(rows)}}};"]
    return [
        *through,
        f"static const double {name}_c[] = {_list((*method.c[1:], *dense.c))};",
        f"static const int {name}_row[] = {_listed(starts)};",
        f"static const unsigned char {name}_at[] = {_listed(j for row in terms for j, _ in row)};",
        f"static const double {name}_weight[] = {_listed(weights)};",
        f"static const Tableau {name} = {{{stages}, {len(method.errors)}, {weighted}ul, "
        f"{name}_c, {name}_row, {name}_at, {name}_weight, {len(dense.c)}, {len(dense.powers)}"
        f"{f', {name}_sums, {int(_is_late(method))}, {{{a}, {b}}}, {rough}' if lanes else ''}}};",
    ]


def _insides(method: Tableau) -> tuple[int, int]:
    """The stages that the step is made of nearest to its first and to its third quarter."""
    used = [j for j, weight in enumerate(method.a[-1]) if weight and 0 < method.c[j] < 1]
    first, third = (min(used, key=lambda j: abs(method.c[j] - Fraction(k, 4))) for k in (1, 3))
    return first, third


def _rough(first: Fraction, third: Fraction) -> list[list[Fraction]]:
    """The polynomial of degree 5 through both ends of a step, with their slopes and those of two
    stages: its powers of sigma = 2 theta - 1 from y, z and h times the slopes, and its values after
    one and two thirds of the step."""
    places = [Fraction(-1), Fraction(1)]
    slopes = [*places, 2 * first - 1, 2 * third - 1]
    rows = [[place**n for n in range(6)] for place in places]
    rows += [[n * place ** (n - 1) if n else Fraction(0) for n in range(6)] for place in slopes]
    scales = [Fraction(1)] * 2 + [Fraction(1, 2)] * 4  # a slope by sigma is half of one by theta
    unit = [[scales[i] if i == k else Fraction(0) for k in range(6)] for i in range(6)]
    powers = _solved([row + right for row, right in zip(rows, unit)])
    thirds = [Fraction(-1, 3), Fraction(1, 3)]
    return [*powers, *([_polynomial(each, sigma) for each in zip(*powers)] for sigma in thirds)]


def _polynomial(coefficients: Sequence[Fraction], sigma: Fraction) -> Fraction:
    return sum((a * sigma**n for n, a in enumerate(coefficients)), Fraction(0))


def _solved(rows: list[list[Fraction]]) -> list[list[Fraction]]:
    """The right halves, by Gauss and Jordan."""
    count = len(rows)
    for i in range(count):
        pivot = next(k for k in range(i, count) if rows[k][i])
        rows[i], rows[pivot] = rows[pivot], rows[i]
        rows[i] = [value / rows[i][i] for value in rows[i]]
        for k in range(count):
            if k != i:
                rows[k] = [a - rows[k][i] * b for a, b in zip(rows[k], rows[i])]
    return [row[count:] for row in rows]


def _is_late(method: Tableau) -> bool:
    """Whether the last slope counts in no error, and the one before it is at the end, too."""
    return method.c[-2] == 1 and not any(row[-1] for row in method.errors)


def _rosenbrock(method: Rosenbrock) -> list[str]:
    width = len(method.alpha)
    return [
        number(method.gamma),
        _list(method.alpha),
        _list(method.gammas),
        _table(method.a, width),
        _table(method.c, width),
        _table(method.dense, width),
    ]


def _collocation(method: Collocation) -> list[str]:
    width = len(method.c)
    return [
        _list(method.c),
        _list(method.b),
        _table(method.T, width),
        _table(method.inverse, width),
        number(method.real),
        _table(method.pairs, 2),
        _list(method.error),
        _table(centred(collocated(method.c)), width),
    ]


def _control(method: Integrator) -> tuple[str, str, str]:
    """Exponents of the error and of the one before, and the safety."""
    grow = Fraction(1, method.estimate) - Fraction(3, 4) * method.damping
    return number(grow), number(method.damping), number(method.safety)


def python_numbers(tableau: Tableau) -> dict[str, object]:
    """A tableau as text of Python numbers."""

    def numbers(values: Sequence[Fraction]) -> str:
        return "[" + ", ".join(number(value) for value in values) + "]"

    return {
        **dict(zip(("grow", "damp", "safety"), _control(tableau))),
        "c": numbers(tableau.c),
        "a": [numbers(row) for row in tableau.a],
        "errors": [numbers(row) for row in tableau.errors],
        "dense": tableau.dense
        and {
            "c": numbers(tableau.dense.c),
            "a": [numbers(row) for row in tableau.dense.a],
            "powers": [numbers(row) for row in tableau.dense.powers],
        },
    }


def number(value: Fraction) -> str:
    """A constant expression: 3.0 / 40.0, or a decimal where the fraction is long."""
    if value.denominator == 1:
        return f"{value.numerator}.0"
    if max(abs(value.numerator), value.denominator) < 10**6:
        return f"{value.numerator}.0 / {value.denominator}.0"
    return repr(float(value))


def _list(values: Sequence[Fraction]) -> str:
    return "{" + ", ".join(number(value) for value in values) + "}"


def _table(rows: Sequence[Sequence[Fraction]], width: int) -> str:
    """Rows filled up with zeros."""
    return "{" + ", ".join(_list([*row, *[Fraction(0)] * (width - len(row))]) for row in rows) + "}"


def _listed(values: Iterable[object]) -> str:
    return "{" + ", ".join(map(str, values)) + "}"
