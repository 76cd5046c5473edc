"""Displacements over the generalized velocities per change of a coordinate."""

from __future__ import annotations

import casadi as ca
import numpy as np

from derive.mechanics.elimination.solve import scalars, small_inverse
from derive.mechanics.records import System


def displacements(system: System) -> ca.SX:
    """nv × nq: the displacement over v per change of a coordinate, N⁻¹ block by block. Turns do not
    feel the length of a quaternion, so of one it is 4 Nᵀ/|q|²."""
    N, q = system.N, system.q
    result = ca.SX(N.size2(), N.size1())
    turned: set[int] = set()
    for start in system.quaternions:
        rows = list(range(start, start + 4))
        columns = [j for j in range(N.size2()) if N[start : start + 4, j].nnz()]
        weight = 4.0 / ca.sumsqr(q[start : start + 4])
        result[columns, rows] = weight * N[rows, columns].T
        turned |= set(rows)
    for rows, columns in _blocks(N, turned):
        result[columns, rows] = _inverse(system, N[rows, columns])
    return ca.sparsify(result)


def _blocks(N: ca.SX, without: set[int]) -> list[tuple[list[int], list[int]]]:
    """Rows and columns that belong together."""
    groups: list[tuple[set[int], set[int]]] = []
    for row in (i for i in range(N.size1()) if i not in without):
        rows, columns = {row}, {j for j in range(N.size2()) if N[row, j].nnz()}
        for group in [g for g in groups if g[1] & columns]:
            groups.remove(group)
            rows, columns = rows | group[0], columns | group[1]
        groups.append((rows, columns))
    return [(sorted(rows), sorted(columns)) for rows, columns in groups]


def _inverse(system: System, block: ca.SX) -> ca.SX:
    """The transpose where the block is a rotation, as of positions that move in turned axes."""
    if _is_rotation(system, block):
        return block.T
    inverted, _ = small_inverse(scalars(block))
    return ca.vertcat(*(ca.horzcat(*row) for row in inverted))


def _is_rotation(system: System, block: ca.SX) -> bool:
    """Seen at random values: formulas are not simplified to find out."""
    symbols = ca.vertcat(system.t, system.q, system.p)
    at = ca.Function("block", [symbols], [ca.densify(block)])
    values = np.random.default_rng(0).uniform(0.5, 1.5, (symbols.numel(), 3))
    rotations = [np.array(at(column)) for column in values.T]
    return all(np.allclose(N @ N.T, np.eye(len(N)), atol=1e-12) for N in rotations)
