"""What an integrator is, as data: explicit Runge–Kutta methods, Rosenbrock methods, collocation,
the implicit midpoint rule, and Taylor series.

All advance x' = f(t, x). `order` is the order of the step (0 where it varies) and `estimate` the
power of h in its error estimate; `damping` the exponent of the previous error in the
proportional–integral step control; `safety` the part of the allowed step that is taken: a step of
many stages that fails costs more than a few shorter ones. `needs`: the functions of the module
beyond `dynamics`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import comb

Row = tuple[Fraction, ...]
SAFETY = Fraction(9, 10)


@dataclass(frozen=True)
class Dense:
    """Continuous output of a step, of an order of its own: further stages kᵢ behind those of the
    tableau, then y(t + θ h) = y + h Σₙ θⁿ Σᵢ wₙᵢ kᵢ with the rows w₁, w₂ … of `powers`."""

    order: int
    c: Row
    a: tuple[Row, ...]
    powers: tuple[Row, ...]


@dataclass(frozen=True)
class Tableau:
    """kᵢ = f(t + cᵢ h, x + h Σ aᵢⱼ kⱼ); the last row of `a` is the step itself, so its stage is the
    first of the next step.

    `errors` are the weights of the error estimate: none (fixed steps only), one, or two that are
    put together as in DOP853, |e₁|²/√(|e₁|² + |e₂|²/100). Without `dense` the continuous output is
    the cubic through both ends with their slopes.
    """

    name: str
    about: str
    source: str
    order: int
    c: Row
    a: tuple[Row, ...]
    errors: tuple[Row, ...]
    damping: Fraction
    safety: Fraction = SAFETY
    dense: Dense | None = None
    needs: tuple[str, ...] = ()
    exact: bool = False  # needs the exact Jacobian of what is integrated

    @property
    def adaptive(self) -> bool:
        """Without weights of an error estimate there are fixed steps only."""
        return bool(self.errors)

    @property
    def estimate(self) -> int:
        """The power of h in the difference from the embedded solution: h^p at order p."""
        return self.order


@dataclass(frozen=True)
class Rosenbrock:
    """(1/(γ h) − J) Uᵢ = f(t + αᵢ h, x + Σ aᵢⱼ Uⱼ) + Σ cᵢⱼ Uⱼ/h + γᵢ h ∂f/∂t with J = ∂f/∂x, every
    sum over j < i.

    The last row of `a` plus the last U is the step; the last U alone is the error estimate (stiffly
    accurate methods). With the rows d₁, d₂ of `dense` the continuous output is
    (1 − θ) x + θ (x₁ + (1 − θ) (Σ d₁ⱼ Uⱼ + θ Σ d₂ⱼ Uⱼ)).
    """

    name: str
    about: str
    source: str
    order: int
    gamma: Fraction
    alpha: Row
    gammas: Row
    a: tuple[Row, ...]
    c: tuple[Row, ...]
    dense: tuple[Row, Row]
    damping: Fraction = Fraction(0)
    safety: Fraction = SAFETY
    needs: tuple[str, ...] = ("jacobian", "jacobian_t")
    exact: bool = True
    adaptive: bool = True

    @property
    def estimate(self) -> int:
        """The power of h in the last U, the difference from the embedded solution: h^p."""
        return self.order


@dataclass(frozen=True)
class Collocation:
    """zᵢ = h Σ aᵢⱼ f(t + cⱼ h, x + zⱼ); the last z is the step. By Newton's method with the
    Jacobian J at its start.

    T splits A⁻¹ = T Λ T⁻¹ into a real eigenvalue λ and pairs α ± iβ, blocks [[α, β], [−β, α]] of Λ:
    one linear system of the size of x and one of twice that per pair instead of a single one of all
    stages. b is the last row of A, `inverse` T⁻¹. The error estimate is (λ/h − J)⁻¹ (f(t, x) + Σ eᵢ
    zᵢ/h).
    """

    name: str
    about: str
    source: str
    order: int
    c: Row
    b: Row
    real: Fraction
    pairs: tuple[Row, ...]
    T: tuple[Row, ...]
    inverse: tuple[Row, ...]
    error: Row
    damping: Fraction = Fraction(0)
    safety: Fraction = SAFETY
    needs: tuple[str, ...] = ("jacobian",)
    exact: bool = False
    adaptive: bool = True

    @property
    def estimate(self) -> int:
        """h^(s + 1) with s stages, below the order of the step itself (Hairer, Wanner, 1996,
        IV.8)."""
        return len(self.c) + 1


@dataclass(frozen=True)
class Midpoint:
    """k = f(t + h/2, x + h k/2), solved by Newton's method with the Jacobian at the start of the
    step; fixed steps only."""

    name: str
    about: str
    source: str
    order: int = 2
    estimate: int = 2
    damping: Fraction = Fraction(0)
    safety: Fraction = SAFETY
    needs: tuple[str, ...] = ("jacobian",)
    exact: bool = False
    adaptive: bool = False


@dataclass(frozen=True)
class Taylor:
    """x(t + s) = Σ xₙ sⁿ, with coefficients by recurrences over the program of `dynamics`. The
    order is what the tolerance asks for, so there is no number for it; the last terms of a step
    are a small part of the tolerance.

    The error estimate is h (ẋ − P'(h)), the step's end beside its polynomial P, and only where a
    function has pieces: their ends do not show in a series.
    """

    name: str
    about: str
    source: str
    order: int = 0
    estimate: int = 2
    damping: Fraction = Fraction(0)
    safety: Fraction = SAFETY
    needs: tuple[str, ...] = ()
    exact: bool = True  # what an enforcement does at every stage is not in the program
    adaptive: bool = True


Integrator = Tableau | Rosenbrock | Collocation | Midpoint | Taylor


def row(text: str) -> Row:
    """Fractions or decimals separated by blanks."""
    return tuple(Fraction(item) for item in text.split())


def less(weights: Row, other: Mapping[int, str]) -> Row:
    """Weights minus others given by index."""
    return tuple(weight - Fraction(other.get(i, "0")) for i, weight in enumerate(weights))


def centred(powers: Sequence[Row]) -> tuple[Row, ...]:
    """Coefficients of 1, θ, θ² … as those of 1, σ, σ² … with σ = 2 θ − 1, where rounding does not
    grow on the way from 0 to 1."""
    rows: list[Row] = []
    for k in range(len(powers)):
        parts = [Fraction(comb(n, k), 2**n) for n in range(len(powers))]
        columns = zip(*powers)
        rows.append(tuple(sum((p * w for p, w in zip(parts, c)), Fraction(0)) for c in columns))
    return tuple(rows)


def collocated(c: Row) -> tuple[Row, ...]:
    """The polynomial that is 0 at 0 and zᵢ at cᵢ: rows of weights of the zᵢ, of 1, θ, θ² … By
    Lagrange's formula, in exact fractions."""
    columns: list[list[Fraction]] = []
    for i, own in enumerate(c):
        roots = [Fraction(0), *(x for k, x in enumerate(c) if k != i)]
        polynomial = [Fraction(1)]
        for root in roots:
            polynomial = _product(polynomial, [-root / (own - root), 1 / (own - root)])
        columns.append(polynomial)
    return tuple(zip(*columns))


def nested(order: int, c: Row, a: tuple[Row, ...], step: Row, d: tuple[Row, ...]) -> Dense:
    """Of y + θ (F₀ + (1 − θ) (F₁ + θ (F₂ + (1 − θ) (F₃ + …)))), F₀ = x₁ − x, F₁ = h k − F₀, F₂ =
    2 F₀ − h (k + k₁), k and k₁ the slopes at both ends, and Fₙ₊₃ = h Σ dₙᵢ kᵢ."""
    wide = len(d[0])
    F0 = (*step, *[Fraction(0)] * (wide - len(step)))
    first = tuple(Fraction(int(i == 0)) for i in range(wide))
    last = tuple(Fraction(int(i == len(step))) for i in range(wide))
    F1 = tuple(k - f for k, f in zip(first, F0))
    F2 = tuple(2 * f - k - k1 for f, k, k1 in zip(F0, first, last))
    powers = [[Fraction(0)] * wide for _ in range(len(d) + 4)]
    basis = [Fraction(0), Fraction(1)]
    for n, F in enumerate((F0, F1, F2, *d)):
        for k, weight in enumerate(basis):
            powers[k] = [w + weight * f for w, f in zip(powers[k], F)]
        factor = [Fraction(0), Fraction(1)] if n % 2 else [Fraction(1), Fraction(-1)]
        basis = _product(basis, factor)
    return Dense(order, c, a, tuple(map(tuple, powers[1:])))


def _product(first: Sequence[Fraction], second: Sequence[Fraction]) -> list[Fraction]:
    """Of two polynomials, lowest power first."""
    result = [Fraction(0)] * (len(first) + len(second) - 1)
    for i, x in enumerate(first):
        for k, y in enumerate(second):
            result[i + k] += x * y
    return result
