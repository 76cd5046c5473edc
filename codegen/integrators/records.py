"""What an integrator is, as data: explicit Runge–Kutta methods, Rosenbrock methods, collocation,
the implicit midpoint rule, and Taylor series.

All advance x' = f(t, x). `order` is the order of the step and `estimate` the power of h in its
error estimate; `damping` the exponent of the previous error in the proportional–integral step
control; `safety` the part of the allowed step that is taken: a step of many stages that fails costs
more than a few shorter ones. `needs`: the functions of the module beyond `dynamics`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

Row = tuple[Fraction, ...]
SAFETY = Fraction(9, 10)


@dataclass(frozen=True)
class Tableau:
    """kᵢ = f(t + cᵢ h, x + h Σ aᵢⱼ kⱼ); the last row of `a` is the step itself, so its stage is the
    first of the next step.

    `errors` are the weights of the error estimate: none (fixed steps only), one, or two that are
    put together as in DOP853, |e₁|²/√(|e₁|² + |e₂|²/100).
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
    needs: tuple[str, ...] = ()
    exact: bool = False  # needs the exact Jacobian of what is integrated

    @property
    def adaptive(self) -> bool:
        return bool(self.errors)

    @property
    def estimate(self) -> int:
        return self.order


@dataclass(frozen=True)
class Rosenbrock:
    """(1/(γ h) − J) Uᵢ = f(t + αᵢ h, x + Σ aᵢⱼ Uⱼ) + Σ cᵢⱼ Uⱼ/h + γᵢ h ∂f/∂t with J = ∂f/∂x, every
    sum over j < i.

    The last row of `a` plus the last U is the step; the last U alone is the error estimate (stiffly
    accurate methods).
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
    damping: Fraction = Fraction(0)
    safety: Fraction = SAFETY
    needs: tuple[str, ...] = ("jacobian", "jacobian_t")
    exact: bool = True
    adaptive: bool = True

    @property
    def estimate(self) -> int:
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
    """x(t + s) = Σ xₙ sⁿ up to the order p = ⌈1 − ln(rtol)/2⌉, with coefficients by recurrences over
    the program of `dynamics`; the last two terms of a step are a small part of the tolerance.

    `order` is the highest there is.
    """

    name: str
    about: str
    source: str
    order: int = 20
    damping: Fraction = Fraction(0)
    safety: Fraction = Fraction(1)
    needs: tuple[str, ...] = ()
    exact: bool = True  # what an enforcement does at every stage is not in the program
    adaptive: bool = True

    @property
    def estimate(self) -> int:
        return self.order


Integrator = Tableau | Rosenbrock | Collocation | Midpoint | Taylor


def row(text: str) -> Row:
    """Fractions or decimals separated by blanks."""
    return tuple(Fraction(item) for item in text.split())


def less(weights: Row, other: Mapping[int, str]) -> Row:
    """Weights minus others given by index."""
    return tuple(weight - Fraction(other.get(i, "0")) for i, weight in enumerate(weights))
