"""The system's own terms solved as Udwadia and Kalaba, and Udwadia and Phohomsiri, do: by
pseudo-inverses, without multipliers.

Sources: F. E. Udwadia, R. E. Kalaba, Proc. R. Soc. A 439 (1992) 407–410; F. E. Udwadia, P.
Phohomsiri, Proc. R. Soc. A 462 (2006) 2097–2117.
"""

from __future__ import annotations

import numpy as np

from hamel.verify.checks.agreement import acceleration_error
from hamel.verify.checks.check import Check
from hamel.verify.checks.compare import worst
from hamel.verify.checks.evidence import Evidence
from hamel.verify.checks.samples import Terms
from hamel.verify.limits import SOLVED
from hamel.verify.reference.saddle import RANK, condition_of, left_over
from hamel.verify.reference.vectors import Array

REGULAR = 1e12  # condition of a mass matrix that has an inverse


def udwadia_kalaba(e: Evidence) -> float | None:
    """v̇ against a + M^{-½} (A M^{-½})⁺ (β − A a), a = M⁻¹ (Q − h), where M has an inverse."""
    growth = [condition_of(t.M) for t in e.terms]
    if max(growth) > REGULAR or any(
        np.linalg.matrix_rank(_scaled(t)[1]) < len(t.M) for t in e.terms
    ):
        return None
    try:
        wanted = [D * _udwadia_kalaba(*rest) for D, *rest in map(_scaled, e.terms)]
    except np.linalg.LinAlgError:  # M is not positive, and has no root
        return np.inf if e.possible else None
    return acceleration_error(e, wanted, np.maximum(growth, e.conditions))


def _udwadia_kalaba(M: Array, force: Array, A: Array, beta: Array) -> Array:
    """With M = L Lᵀ in place of M^½: roots of M differ by a rotation, which the pseudo-inverse
    passes on."""
    L = np.linalg.cholesky(M)
    a, G = np.linalg.solve(M, force), np.linalg.solve(L, A.T).T
    return a + np.linalg.solve(L.T, _pseudo_inverse(G) @ (beta - A @ a))


def udwadia_phohomsiri(e: Evidence) -> float:
    """v̇ against [(1 − A⁺A) M; A]⁺ [(1 − A⁺A) (Q − h); β], which needs no inverse of M. It is known
    to rounding of the largest √Mᵢᵢ v̇ᵢ: of what is light beside that, to fewer digits."""
    scaled = [_scaled(t) for t in e.terms]
    wanted = [D * _udwadia_phohomsiri(*rest) for D, *rest in scaled]
    pairs = zip(scaled, e.vdot, wanted, e.conditions)
    by_inertia = [worst((a - b) / D) / _largest(b / D) / c for (D, *_), a, b, c in pairs]
    return min(acceleration_error(e, wanted, e.conditions), worst(np.array(by_inertia)))


def _largest(x: Array) -> float:
    return float(np.max(np.abs(x), initial=0.0)) or 1.0


def _udwadia_phohomsiri(M: Array, force: Array, A: Array, beta: Array) -> Array:
    """v̇ from the part of M v̇ = Q − h that no constraint force reaches, and A v̇ = β."""
    free = np.eye(len(M)) - _pseudo_inverse(A) @ A
    return _pseudo_inverse(np.vstack([free @ M, A])) @ np.concatenate([free @ force, beta])


def _scaled(t: Terms) -> tuple[Array, Array, Array, Array, Array]:
    """D, D M D with ones on its diagonal, D (Q − h), and A D, β with rows of length one; v̇ is D
    times what solves these."""
    size = np.diag(t.M)
    D = 1.0 / np.sqrt(np.where(size > 0.0, size, 1.0))
    A = t.A * D
    zero = left_over(t.A)
    A, beta = np.where(zero[:, None], 0.0, A), np.where(zero, 0.0, t.beta)
    lengths = np.where(zero, 1.0, np.linalg.norm(A, axis=1))
    return D, D[:, None] * t.M * D, D * (t.Q - t.h), A / lengths[:, None], beta / lengths


def _pseudo_inverse(matrix: Array) -> Array:
    return np.linalg.pinv(matrix, rcond=RANK)


CHECKS = (
    Check(
        "v̇ Udwadia–Kalaba",
        SOLVED,
        "the same terms by a pseudo-inverse, per condition number, that of M or of all",
        udwadia_kalaba,
    ),
    Check(
        "v̇ Udwadia–Phohomsiri",
        SOLVED,
        "the same without an inverse of M, per condition number",
        udwadia_phohomsiri,
    ),
)
