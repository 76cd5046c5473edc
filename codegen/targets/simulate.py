"""Simulation: an adaptive Runge–Kutta loop around `dynamics`, in C and, without a compiler, in NumPy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from codegen import text
from codegen.integrators import INTEGRATORS, Tableau
from codegen.program import Program
from codegen.targets.records import Target


@dataclass(frozen=True)
class Scheme:
    """A tableau as text of C and Python alike."""

    tableau: Tableau
    stages: tuple[tuple[str, str], ...]  # per stage after the first: c, and Σ a k with {0} for the stage's slope array
    error: str
    grow: str
    damp: str


def files(program: Program) -> dict[str, str]:
    """NAME_simulate.h, NAME_simulate.c and _simulate.py."""
    if not program.simulates:
        return {}
    names = [kernel.name for kernel in program.kernels]
    data = {
        "program": program,
        "prefix": program.name,
        "PREFIX": program.name.upper(),
        "has": {name: name in names for name in ("power", "project", "constraints")},
        "positions": program.positions,
        "size": len(program.argument("x").names) + 1,
    }
    scheme = INTEGRATORS[0]
    return {
        f"{program.name}_simulate.h": text.render("simulate.h.j2", scheme=_scheme(scheme, "k[{}][i]"), **data),
        f"{program.name}_simulate.c": text.render("simulate.c.j2", scheme=_scheme(scheme, "k[{}][i]"), **data),
        "_simulate.py": text.render("simulate.py.j2", scheme=_scheme(scheme, "k[{}]"), **data),
    }


def _scheme(tableau: Tableau, slope: str) -> Scheme:
    stages = zip(tableau.c[1:], tableau.a[1:])
    return Scheme(
        tableau=tableau,
        stages=tuple((_number(c), _combination(a, slope)) for c, a in stages),
        error=_combination(tableau.error, slope),
        grow=_number(Fraction(1, tableau.order) - Fraction(3, 4) * tableau.damping),
        damp=_number(tableau.damping),
    )


def _number(value: Fraction) -> str:
    """A constant expression: 3.0 / 40.0."""
    return f"{value.numerator}.0" if value.denominator == 1 else f"{value.numerator}.0 / {value.denominator}.0"


def _combination(weights: Sequence[Fraction], slope: str) -> str:
    terms = [(weight, slope.format(i)) for i, weight in enumerate(weights) if weight]
    first = f"{_number(terms[0][0])} * {terms[0][1]}"
    return first + "".join(f" {'-' if w < 0 else '+'} {_number(abs(w))} * {k}" for w, k in terms[1:])


SIMULATE = Target("simulate", "adaptive integration in C and NumPy", files)
