"""Critical values: where the kind of motion changes along one parameter, located as roots of smooth
functions.

`zero`: a real eigenvalue passes zero (det A = 0). `hopf`: a pair passes the imaginary axis (Re λ =
0), or two pairs meet on it and part ((λ₁ − λ₂)² = 0 of the two above the real axis). `double`: two
real eigenvalues meet and part as a pair ((λ₁ − λ₂)² = 0, which is smooth and as exact as A, though
each λ is only good to √ε there). `fold`: the branch of motions turns back, and a real eigenvalue is
zero; that is found along the branch (derive.linearize.fold).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from derive.linearize.limits import CRITICAL_NEAR, CRITICAL_STEPS, DEPTH, REAL
from derive.linearize.spectrum import eigenvalues, signature

Matrix = Callable[[float], np.ndarray]  # value → k × k


@dataclass(frozen=True)
class Critical:
    """`eigenvalue`: the one that changes its kind, at `value` of the parameter."""

    kind: str
    value: float
    eigenvalue: complex


def critical_values(matrix: Matrix, values: np.ndarray, found: np.ndarray) -> tuple[Critical, ...]:
    """All changes between neighbouring `values` of one branch, whose eigenvalues are the rows of
    `found`.

    An interval whose ends differ in kind is halved until one change is left in it, then the change
    is located as a root to the last digits. Two changes that cancel between neighbouring values are
    not seen: that is a matter of how finely is swept.
    """
    kinds = [signature(row) for row in found]
    changes = [k for k in range(len(values) - 1) if kinds[k] != kinds[k + 1]]
    return tuple(
        c
        for k in changes
        for c in _between(matrix, values[k], values[k + 1], kinds[k], kinds[k + 1], 0)
    )


Signature = tuple[int, int, int]


def _between(
    matrix: Matrix, a: float, b: float, at_a: Signature, at_b: Signature, depth: int
) -> Iterator[Critical]:
    """Halves the interval until one change of kind is left in it, or too little of it is."""
    if at_a == at_b:
        return
    kind = _kind(at_a, at_b)
    if (kind and depth >= CRITICAL_NEAR) or depth >= DEPTH:
        if kind:
            yield _located(matrix, kind, a, b)
        return
    middle = (a + b) / 2
    here = signature(eigenvalues(matrix(middle)[np.newaxis])[0])
    yield from _between(matrix, a, middle, at_a, here, depth + 1)
    yield from _between(matrix, middle, b, here, at_b, depth + 1)


def turning(value: float, spectrum: NDArray[np.complex128]) -> Critical:
    """The branch turns back at this value, where its eigenvalues are these."""
    return Critical("fold", value, _changing("zero", spectrum))


def _kind(a: Signature, b: Signature) -> str:
    """The one change that takes a to b, or "" where there are several."""
    real, grown, turned = (y - x for x, y in zip(a, b))
    if abs(real) == 2 and abs(grown + turned) <= 1:
        return "double"
    if real == 0 and abs(grown) == 1 and turned == 0:
        return "zero"
    return "hopf" if real == 0 and grown == 0 and abs(turned) == 2 else ""


def _located(matrix: Matrix, kind: str, a: float, b: float) -> Critical:
    def measure(value: float) -> float:
        """The measure of this kind of critical value at one value of the parameter: its sign
        changes where the value is critical."""
        return MEASURES[kind](matrix(value))

    if kind == "hopf" and _pairs_meet(matrix(a), matrix(b)):
        value = root(lambda x: _gap_above(matrix(x)), a, b)
        (values,) = _spectra(matrix(value))
        return Critical(kind, value, complex(np.mean(_nearest_above(values))))
    value = root(measure, a, b)
    return Critical(kind, value, _changing(kind, eigenvalues(matrix(value)[np.newaxis])[0]))


def _pairs_meet(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether pairs are on the imaginary axis at one end and off it at the other, as of systems
    that do not dissipate: Re λ is a square root there, and rounding on the axis."""
    on_axis = [
        abs(_oscillating(x).real) <= REAL * abs(_oscillating(x)) for x in _spectra(one, other)
    ]
    return any(on_axis) and _gap_above(one) * _gap_above(other) < 0


def _spectra(*matrices: np.ndarray) -> list[NDArray[np.complex128]]:
    return [eigenvalues(A[np.newaxis])[0] for A in matrices]


def _gap_above(A: np.ndarray) -> float:
    """(λ₁ − λ₂)² of the two nearest eigenvalues above the real axis: negative where both are on
    the imaginary axis, positive where they have parted; 0 where there are no two."""
    (values,) = _spectra(A)
    first, *others = _nearest_above(values)
    return float(((first - others[0]) ** 2).real) if others else 0.0


def _nearest_above(values: NDArray[np.complex128]) -> list[complex]:
    """The two above the real axis that are nearest to each other; the only one where there are no
    two."""
    above = values[values.imag > 0]
    if len(above) < 2:
        return [_oscillating(values)]
    return [complex(above[k]) for k in _closest(above)]


def _squared_gap(A: np.ndarray) -> float:
    """(λ₁ − λ₂)² of the two nearest eigenvalues: positive where both are real, negative for a
    pair."""
    values = eigenvalues(A[np.newaxis])[0]
    i, j = _closest(values)
    return float(((values[i] - values[j]) ** 2).real)


def _closest(values: np.ndarray) -> tuple[int, int]:
    gaps = np.abs(values[:, np.newaxis] - values[np.newaxis, :]) + np.diag(
        np.full(len(values), np.inf)
    )
    i, j = np.unravel_index(int(np.argmin(gaps)), gaps.shape)
    return int(i), int(j)


def _oscillating(values: NDArray[np.complex128]) -> complex:
    """The one above the real axis that is nearest to the imaginary axis."""
    upper = values[values.imag > 0]
    return complex(upper[np.argmin(np.abs(upper.real))]) if len(upper) else complex("nan")


def _real_part(A: np.ndarray) -> float:
    return _oscillating(eigenvalues(A[np.newaxis])[0]).real


MEASURES: dict[str, Callable[[np.ndarray], float]] = {
    "double": _squared_gap,
    "zero": lambda A: float(np.linalg.det(A)),
    "hopf": _real_part,
}


def _changing(kind: str, values: np.ndarray) -> complex:
    if kind == "double":
        i, j = _closest(values)
        return complex((values[i] + values[j]).real / 2)
    return (
        complex(values[np.argmin(np.abs(values))].real) if kind == "zero" else _oscillating(values)
    )


def root(measure: Callable[[float], float], a: float, b: float) -> float:
    """A zero of `measure` between a and b to the last digits, by false position (Illinois) with
    bisection when that is slow. Where the ends have the same sign, the end with the smaller
    measure. Source: Dowell, Jarratt, BIT 11 (1971)."""
    fa, fb = measure(a), measure(b)
    if not fa * fb < 0:
        return a if abs(fa) <= abs(fb) else b
    for step in range(CRITICAL_STEPS):
        if abs(b - a) <= 2 * np.finfo(float).eps * max(abs(a), abs(b)):
            break
        c = (a * fb - b * fa) / (fb - fa) if step % 8 != 7 else (a + b) / 2
        c = min(max(c, min(a, b)), max(a, b))
        fc = measure(c)
        if fc == 0 or c in (a, b):
            return c
        if fc * fb < 0:
            a, fa = b, fb
        else:
            fa /= 2
        b, fb = c, fc
    return b
