"""Least squares of Sᵀ Y π = B_w u − rest: ordinary, weighted by what each equation leaves, and
physically consistent.

Consistent means that some distribution of mass has these numbers: the pseudo-inertia

    P = [½ tr(I) 1 − I, mc; mcᵀ, m]  ⪰ 0

of every group (Wensing, Kim, Slotine 2018; Traversaro et al. 2016), and no negative friction or
rotor. That is a convex problem in the standard parameters (Sousa & Cortesão 2014), solved by
Clarabel, an interior-point method; of parameters that the motion does not tell, the nearest to the
file's are taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import sparse
from scipy.linalg import null_space

from derive.diagnostics import AssumptionError
from derive.formulations.evaluate import function_of
from derive.formulations.records import Equations
from derive.mechanics.regression.regressor import INERTIAL, Parameter
from hamel.identify.base import Base
from hamel.identify.limits import (
    EXACT,
    FEW_WEIGHTS,
    LEAST_WEIGHT,
    LIGHT,
    MARGIN,
    ROUNDS,
    SETTLED,
)
from hamel.identify.measured import Measured, at_rows, parameters_of

Array = np.ndarray


@dataclass(frozen=True)
class Rows:
    """A b = y, states × nw equations: `A` states × nw × nb, `y` states × nw. `correlation` of the
    noise of an equation between rows that are 0, 1, 2 … apart."""

    t: Array
    A: Array
    y: Array
    correlation: Array = field(default_factory=lambda: np.ones(1))


@dataclass(frozen=True)
class Estimate:
    """`values` and `deviations` of b; `spread`: the standard deviation of each equation's noise."""

    values: Array
    deviations: Array
    spread: Array
    condition: float


def rows_of(equations: Equations, base: Base, motion: Measured) -> Rows:
    """The equations at the rows of a motion, filtered as it was."""
    p = parameters_of(equations)
    x = np.hstack([motion.q, motion.w, motion.wdot])  # of regressors, which know no states
    state = np.hstack([motion.q, motion.w, motion.z])
    Y, rest, grip = (
        at_rows(
            function_of(equations, equations.request(name).function), motion.t, taken, motion.u, p
        )
        for name, taken in (("regressor_w", x), ("regressor_rest_w", x), ("input_map", state))
    )
    A = Y @ base.basis
    y = np.einsum("kij,kj->ki", grip, motion.u) - rest[:, :, 0]
    low = motion.filter
    if low is None:
        return Rows(motion.t, A, y)
    inside = slice(low.ends, len(y) - low.ends, low.every)
    return Rows(motion.t[inside], low(A)[inside], low(y)[inside], low.correlation)


def ordinary(rows: Rows) -> Estimate:
    """All equations alike. Raises AssumptionError where there are too few rows, or the motion does
    not tell the base parameters apart."""
    return _solved(rows, np.ones(rows.y.shape[1]))


def weighted(rows: Rows) -> Estimate:
    """Each equation by the standard deviation of what it leaves, until that settles."""
    estimate = ordinary(rows)
    for _ in range(ROUNDS):
        spread = np.maximum(estimate.spread, LEAST_WEIGHT * (estimate.spread.max() or 1.0))
        estimate = _solved(rows, 1.0 / spread)
        if np.allclose(estimate.spread, spread, rtol=SETTLED, atol=0.0):
            break
    return estimate


def _solved(rows: Rows, weights: Array) -> Estimate:
    count, nw, nb = rows.A.shape
    U, B, condition = _factors(rows, weights)
    b = B @ (U.T @ (rows.y * weights).ravel())
    left = rows.y - rows.A @ b
    # what each equation leaves, with its share of the noise that the fit takes taken off
    share = 1.0 - float(_variance(U.T.reshape(nb, count, nw), rows).sum()) / (count * nw)
    spread = np.sqrt(np.mean(left**2, axis=0) / share)
    # of each equation's own noise, whatever the weights: b = H y has the variance H C Hᵀ, where C
    # is spread² within a row, and what the filter leaves of it from row to row
    H = (B @ U.T).reshape(nb, count, nw) * (spread * weights)
    return Estimate(b, np.sqrt(_variance(H, rows)), spread, condition)


def _factors(rows: Rows, weights: Array) -> tuple[Array, Array, float]:
    """U and B with the weighted A B = U, UᵀU = 1, and the condition of A, columns scaled to one. So
    B Bᵀ is the covariance of b where the noise of the weighted equations is one."""
    count, nw, nb = rows.A.shape
    A = (rows.A * weights[:, None]).reshape(-1, nb)
    size = np.linalg.norm(A, axis=0)
    if count * nw <= nb or (size == 0.0).any():
        raise AssumptionError(
            f"{count} rows of {nw} equations do not tell {nb} parameters",
            "a longer motion that moves every joint; --excite finds one",
        )
    U, s, Vt = np.linalg.svd(A / size, full_matrices=False)
    if s[-1] <= 1e-12 * s[0]:
        raise AssumptionError(
            "the motion does not tell all base parameters apart",
            "a motion that moves every joint; --excite finds one",
        )
    return U, Vt.T / s / size[:, None], float(s[0] / s[-1])


def _variance(H: Array, rows: Rows) -> Array:
    """Of sums H y (n × states × nw) of noise with the variance one that is correlated from row to
    row."""
    variance = np.sum(H**2, axis=(1, 2))
    for lag, part in enumerate(rows.correlation[1 : H.shape[1]], 1):
        variance += 2.0 * part * np.sum(H[:, lag:] * H[:, :-lag], axis=(1, 2))
    return np.asarray(variance)


def consistent(rows: Rows, base: Base, spread: Array, own: Array, solver: Any) -> Array:
    """All standard parameters (np), physically consistent, with the least weighted residuals;
    `own` are the file's. `solver` is the module clarabel.

    They are sought from the weighted values and the file's: first along what the motion does not
    tell, so that weighted values that some body has stay as they are; then along all, counted in
    standard deviations, so that weights of any size leave a problem of even scale.
    """
    scale = scales(base.standard, own)
    C = base.combination * scale
    back, untold = np.linalg.pinv(C), _untold(C)
    for least in (LEAST_WEIGHT, *FEW_WEIGHTS):
        weights = 1.0 / np.maximum(spread, least * (spread.max() or 1.0))
        U, B, _ = _factors(rows, weights)
        b = B @ (U.T @ (rows.y * weights).ravel())
        centre = own / scale + back @ (b - base.combination @ own)
        told = back @ B / np.abs(back @ B).max()
        for directions in (untold, np.hstack([told, untold / LIGHT])):
            z = _nearest(base.standard, scale, centre, directions, solver)
            if z is not None:
                return z * scale
    raise AssumptionError("the consistent parameters were not found")


def _untold(C: Array) -> Array:
    """Directions that C leaves alone; one without length where there are none."""
    found = null_space(C)
    return found if found.size else np.zeros((C.shape[1], 1))


def _nearest(
    standard: Sequence[Parameter], scale: Array, centre: Array, directions: Array, solver: Any
) -> Array | None:
    """z = centre + directions x in the cones with the least |x|; None where the solver finds
    none."""
    rows, floor, cones = _cones(standard, scale, solver)
    count = directions.shape[1]
    squares, matrix = sparse.eye(count, format="csc"), sparse.csc_matrix(-rows @ directions)
    inside = rows @ centre - floor
    settings = solver.DefaultSettings()
    settings.verbose = False
    for tolerance in EXACT:  # beyond what rounding allows, iterates become worse again
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
        given = (squares, np.zeros(count), matrix, inside, cones, settings)
        found = solver.DefaultSolver(*given).solve()
        if str(found.status) == "Solved":
            return centre + directions @ np.array(found.x)
    return None


def scales(standard: Sequence[Parameter], own: Array) -> Array:
    """One of each parameter: of a group the sizes of its mass, first moment and inertia."""
    sizes: dict[tuple[str, str], float] = {}
    for x, value in zip(standard, own):
        key = (x.owner if x.kind in INERTIAL else x.name, x.unit)
        sizes[key] = max(sizes.get(key, 0.0), abs(float(value)))
    usual = {x.unit: max(sizes[k] for k in sizes if k[1] == x.unit) or 1.0 for x in standard}
    keys = [(x.owner if x.kind in INERTIAL else x.name, x.unit) for x in standard]
    return np.array([sizes[key] or usual[key[1]] for key in keys])


def _cones(
    standard: Sequence[Parameter], scale: Array, solver: Any
) -> tuple[Array, Array, list[Any]]:
    """Rows over z = π / scale that lie in the cones, above `floor`."""
    blocks: list[Array] = []
    floors: list[Array] = []
    cones: list[Any] = []
    for owner in dict.fromkeys(x.owner for x in standard if x.kind in INERTIAL):
        places = {x.kind: k for k, x in enumerate(standard) if x.owner == owner}
        block, size = _pseudo_inertia(places, scale)
        blocks.append(block)
        floors.append(MARGIN * np.array([float(i == j) for j in range(size) for i in range(j + 1)]))
        cones.append(solver.PSDTriangleConeT(size))
    others = [k for k, x in enumerate(standard) if x.kind not in INERTIAL]
    if others:
        blocks.append(np.eye(len(standard))[others])
        floors.append(np.zeros(len(others)))
        cones.append(solver.NonnegativeConeT(len(others)))
    return np.vstack(blocks), np.concatenate(floors), cones


def _pseudo_inertia(places: dict[str, int], scale: Array) -> tuple[Array, int]:
    """The upper triangle of P by columns, off-diagonal entries times √2, scaled on both sides so
    that a usual body has entries of about one; in a plane Izz m ≥ |mc|² as a matrix of three."""
    planar = len(places) < len(INERTIAL)
    mass = scale[places["m"]]
    kinds = [kind for kind in places if kind.startswith("I")]
    length = float(np.sqrt(max(scale[places[kind]] for kind in kinds) / mass))
    entries = _planar(places) if planar else _spatial()
    size = 3 if planar else 4
    rows: list[Array] = []
    for j in range(size):
        for i in range(j + 1):
            row = np.zeros(len(scale))
            for kind, factor in entries.get((i, j), ()):
                row[places[kind]] = factor * scale[places[kind]]
            units = mass * length ** ((i < size - 1) + (j < size - 1))
            rows.append(row * (1.0 if i == j else np.sqrt(2.0)) / units)
    return np.array(rows), size


Entries = dict[tuple[int, int], tuple[tuple[str, float], ...]]


def _spatial() -> Entries:
    half = {"xx": ("Iyy", "Izz", "Ixx"), "yy": ("Ixx", "Izz", "Iyy"), "zz": ("Ixx", "Iyy", "Izz")}
    diagonal = [((a, 0.5), (b, 0.5), (c, -0.5)) for a, b, c in half.values()]
    return {
        (0, 0): diagonal[0],
        (1, 1): diagonal[1],
        (2, 2): diagonal[2],
        (0, 1): (("Ixy", -1.0),),
        (0, 2): (("Ixz", -1.0),),
        (1, 2): (("Iyz", -1.0),),
        (0, 3): (("mx", 1.0),),
        (1, 3): (("my", 1.0),),
        (2, 3): (("mz", 1.0),),
        (3, 3): (("m", 1.0),),
    }


def _planar(places: dict[str, int]) -> Entries:
    about = next(kind for kind in places if kind.startswith("I"))
    first, second = (kind for kind in places if kind in ("mx", "my", "mz"))
    return {
        (0, 0): ((about, 1.0),),
        (1, 1): ((about, 1.0),),
        (0, 2): ((first, 1.0),),
        (1, 2): ((second, 1.0),),
        (2, 2): (("m", 1.0),),
    }
