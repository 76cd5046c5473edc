"""Inputs for given forces: B u = r, piece by piece where B falls apart.

A square piece is solved; of a wide one, more inputs than forces, the solution with least u·u is
taken, u = Bᵀ (B Bᵀ)⁻¹ r, in the units of the inputs.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from derive.choices.limits import SINGULAR, SQUARED
from derive.choices.records import Guard
from derive.diagnostics import AssumptionError
from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.formulations.limits import SAMPLES
from derive.formulations.motion import Motion
from derive.joints.rotations import dot, is_zero, transpose
from derive.mechanics.elimination.solve import ldl_solution, scalars, small_inverse
from derive.mechanics.records import System
from derive.states.sampling import states


@dataclass(frozen=True)
class Distribution:
    """u (nu), and what has to be away from zero for it."""

    u: Vector
    guards: tuple[Guard, ...]


def check_reach(system: System, motion: Motion, B: ca.SX) -> None:
    """Raises AssumptionError where some force is out of reach of the inputs: with fewer inputs than
    degrees of freedom, or where B has not full rank at any of the sampled states."""
    pieces = _pieces(scalars(B))
    for rows, columns in pieces:
        if len(rows) > len(columns):
            raise AssumptionError(_out_of_reach(system, motion, rows, columns), _HINT)
    values = _at_samples(system, motion, B)
    for rows, columns in pieces:
        blocks = values[:, rows][:, :, columns]
        ranks = [int(np.linalg.matrix_rank(block)) for block in blocks]
        if ranks and max(ranks) < len(rows):
            raise AssumptionError(_act_alike(system, motion, rows, columns, max(ranks)), _HINT)


def distribution(system: System, motion: Motion, B: ca.SX, needed: Vector) -> Distribution:
    """u of B u = needed (nw), where `check_reach` has nothing to say."""
    table = scalars(B)
    pieces = _pieces(table)
    u: Vector = [0.0] * system.u.numel()
    guards: list[Guard] = []
    for rows, columns in pieces:
        block = [[table[i][j] for j in columns] for i in rows]
        part, pivots = _solution(block, [needed[i] for i in rows])
        for j, x in zip(columns, part):
            u[j] = x
        name = ", ".join(motion.names[i] for i in rows)
        squared = len(rows) < len(columns)
        guards += _guards(system, motion, f"inputs for {name}", pivots, squared)
    return Distribution(u, tuple(guards))


_HINT = "input_map tells which forces the inputs reach; mass_w and bias_w serve partial feedback"


def _out_of_reach(system: System, motion: Motion, rows: list[int], columns: list[int]) -> str:
    names = ", ".join(motion.names[i] for i in rows)
    inputs = ", ".join(system.model.inputs[j].name for j in columns)
    if not columns:
        return f"{system.model.name}: no input acts on {names}, so not every ẇ can be had"
    return (
        f"{system.model.name}: {inputs} cannot give every ẇ of {names}: {len(columns)} for "
        f"{len(rows)}"
    )


def _act_alike(
    system: System, motion: Motion, rows: list[int], columns: list[int], rank: int
) -> str:
    names = ", ".join(motion.names[i] for i in rows)
    inputs = ", ".join(system.model.inputs[j].name for j in columns)
    return (
        f"{system.model.name}: {inputs} cannot give every ẇ of {names}: their effects depend on "
        f"each other, {rank} for {len(rows)}"
    )


def _pieces(table: Matrix) -> list[tuple[list[int], list[int]]]:
    """Rows and columns of the blocks that have nothing to do with each other; inputs without any
    effect are in none."""
    groups: list[tuple[set[int], set[int]]] = []
    for i, row in enumerate(table):
        rows, columns = {i}, {j for j, x in enumerate(row) if not is_zero(x)}
        for group in [g for g in groups if g[1] & columns]:
            groups.remove(group)
            rows, columns = rows | group[0], columns | group[1]
        groups.append((rows, columns))
    return sorted((sorted(rows), sorted(columns)) for rows, columns in groups)


def _solution(block: Matrix, needed: Vector) -> tuple[Vector, Vector]:
    """u of a square or wide block, and what it was divided by."""
    if len(block) == len(block[0]):
        inverse, determinant = small_inverse(block)
        return [dot(row, needed) for row in inverse], [determinant]
    gram = [[dot(a, b) for b in block] for a in block]
    solution = ldl_solution(gram, [needed], range(len(block)))
    return [dot(column, solution.x[0]) for column in transpose(block)], solution.pivots


def _guards(
    system: System, motion: Motion, name: str, pivots: Vector, squared: bool
) -> list[Guard]:
    """Of the pivots that vary, against their largest values at sampled states."""
    varying = [ca.SX(x) for x in pivots if isinstance(x, ca.SX) and not x.is_constant()]
    part = SQUARED if squared else SINGULAR
    if not varying:
        return []
    return [
        Guard(name, x, part * largest, part)
        for x, largest in zip(varying, _largest(system, motion, ca.vertcat(*varying)))
    ]


def _largest(system: System, motion: Motion, values: ca.SX) -> list[float]:
    """The largest size of each at sampled states."""
    sizes = np.abs(_at_samples(system, motion, values))[:, :, 0]
    return [float(x) for x in np.max(sizes, axis=0)] if len(sizes) else [1.0] * values.numel()


def _at_samples(system: System, motion: Motion, values: ca.SX) -> NDArray[np.float64]:
    """A matrix over (t, q, p) at sampled states, k × rows × columns."""
    p: list[Scalar] = [system.p[i] for i in range(system.p.numel())]
    frame = motion.frame
    symbols = ca.vertcat(*p, *([frame.symbols] if frame else []))
    at = ca.Function("values", [system.t, system.q, symbols], [ca.densify(values)])
    s = states(system, SAMPLES)
    given = frame.values if frame else ()
    rows = [np.array(at(t, q, np.concatenate([p_, given]))) for t, q, p_ in zip(s.t, s.q, s.p)]
    return np.array(rows, dtype=float).reshape(-1, *values.shape)
