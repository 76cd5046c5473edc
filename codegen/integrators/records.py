"""The Tableau record: an explicit Runge–Kutta pair with step control."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction


@dataclass(frozen=True)
class Tableau:
    """kᵢ = f(t + cᵢ h, x + h Σ aᵢⱼ kⱼ); the last row of `a` is the step itself, so its stage is the first of the next step.

    `error` are the weights of the error estimate, `order` its order, `damping` the exponent of the previous error in the
    proportional–integral step control.
    """

    name: str
    source: str
    order: int
    c: tuple[Fraction, ...]
    a: tuple[tuple[Fraction, ...], ...]
    error: tuple[Fraction, ...]
    damping: Fraction


def row(text: str) -> tuple[Fraction, ...]:
    """Fractions separated by blanks."""
    return tuple(Fraction(item) for item in text.split())
