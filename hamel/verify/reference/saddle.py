"""Saddle-point systems [K Gᵀ; G 0]: scaling, solution, rank and condition, all independent of the
units chosen."""

from __future__ import annotations

import numpy as np

from hamel.verify.reference.vectors import Array

SWEEPS = 20  # each halves the decades between them
RANK = 1e-9  # singular values below this times the largest (rows scaled to like size) count as zero

# of the longest row, or of what a row is the sum of: a shorter one is rounding
LEFT_OVER = 1e-14


def left_over(G: Array, summed: Array | None = None) -> Array:
    """Which rows are what rounding has left of zeros: no scaling may bring them up. They are short
    against the longest row, or against what they are the sum of where that is known."""
    lengths = np.linalg.norm(G, axis=1)
    sizes = lengths.max(initial=0.0) if summed is None else np.linalg.norm(summed, axis=1)
    return np.asarray(lengths <= LEFT_OVER * sizes)


def saddle(K: Array, G: Array) -> Array:
    """[K Gᵀ; G 0], nv + nc square; rows of G that rounding has left of zeros are zeros."""
    G = np.where(left_over(G)[:, None], 0.0, G)
    return np.block([[K, G.T], [G, np.zeros((len(G), len(G)))]])


def scales(matrix: Array) -> Array:
    """D with the rows of D X D of like size, for a symmetric X, so that units do not pass for
    ill-conditioning (D. Ruiz: A scaling algorithm to equilibrate both rows and columns norms in
    matrices, 2001)."""
    D, absolute = np.ones(len(matrix)), np.abs(matrix)
    for sweep in range(SWEEPS):
        size = D * (absolute * D).max(axis=1, initial=0.0)
        size = np.where(size > 0.0, size, 1.0)
        D /= np.sqrt(size)
        if sweep >= 3 and size.min(initial=1.0) > 0.5 and size.max(initial=1.0) < 2.0:
            break
    return D


def solved(matrix: Array, right: Array, redundant: bool) -> tuple[Array, float]:
    """Solution of the scaled system (of least norm when rows are redundant), refined once, and its
    relative residual."""
    D = scales(matrix)
    scaled, wanted = D[:, None] * matrix * D, D * right
    inverse = np.linalg.pinv(scaled, rcond=RANK) if redundant else np.linalg.inv(scaled)
    y = inverse @ wanted
    # one step of refinement takes back most of what the explicit inverse lost
    y += inverse @ (wanted - scaled @ y)
    residual = np.abs(scaled @ y - wanted).max(initial=0.0)
    return D * y, float(
        residual / max(1e-300, np.abs(wanted).max(initial=0.0), np.abs(y).max(initial=0.0))
    )


def least_eigenvalue(M: Array, least: Array) -> float:
    """Of a symmetric M, scaled to a unit diagonal; a diagonal entry below `least` is scaled by
    that, for what stands there is left over from sums that cancel."""
    size = np.sqrt(np.maximum(np.diag(M), least))
    size = np.where(size > 0.0, size, 1.0)
    return float(np.linalg.eigvalsh((M + M.T) / np.outer(size, size) / 2.0).min(initial=0.0))


def rank_of(A: Array) -> int:
    """Rank of A, its rows scaled to unit length but for those that rounding has left of zeros."""
    if not A.size:
        return 0
    lengths = np.where(left_over(A), 1.0, np.linalg.norm(A, axis=1))
    singular = np.linalg.svd(A / lengths[:, None], compute_uv=False)
    return int(np.sum(singular > RANK * singular[0]))


def condition_of(matrix: Array) -> float:
    """Ratio of the largest to the smallest nonzero singular value of the scaled symmetric matrix;
    infinite for zeros."""
    if not matrix.size:
        return 1.0
    D = scales(matrix)
    singular = np.sort(np.abs(np.linalg.eigvalsh(D[:, None] * matrix * D)))[::-1]
    nonzero = singular[singular > 1e-14 * singular[0]]
    return float(nonzero[0] / nonzero[-1]) if nonzero.size else np.inf


def row_condition(Y: Array) -> float:
    """Condition of a square matrix with its rows scaled to unit length; infinite when it is
    singular, or when its entries are no numbers."""
    if not Y.size:
        return 1.0
    if not np.isfinite(Y).all():
        return float("inf")
    lengths = np.linalg.norm(Y, axis=1, keepdims=True)
    singular = np.linalg.svd(Y / np.where(lengths > 0.0, lengths, 1.0), compute_uv=False)
    return float(singular[0] / singular[-1]) if singular[-1] > 0.0 else float("inf")
