"""Rows that hold identically: a closure that repeats what joints say already, or part of it.

Along the axes of a file such rows are zero. About oblique axes 0.6 · 0.8 − 0.8 · 0.6 and the like
leave 1e-17, which would count as a constraint: as one more row, a unit, or something to be met.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from derive.expressions.roundoff import vanishing
from derive.mechanics.limits import FAINT, PLACES
from derive.mechanics.records import RowForm
from derive.mechanics.scene import Block, Scene
from derive.mechanics.symbols import quaternions


def without_rounding(scene: Scene, A: ca.SX) -> ca.SX:
    """A without the entries that are zero but for rounding, at whatever configuration and with
    whatever parameters."""
    s = scene.symbols
    arguments, places = [s.t, s.q, s.p], _places(scene)
    entries = A.nz[:]
    if not entries.numel():
        return A
    values = ca.Function("A", arguments, [entries]).map(PLACES)
    found = np.abs(values(*(x.T for x in places)).full())
    faint = np.flatnonzero(np.all(found <= FAINT * max(1.0, np.max(found)), axis=1)).tolist()
    nothing = vanishing(entries[faint], arguments, places)
    zeros = [k for k, is_nothing in zip(faint, nothing) if is_nothing]
    if not zeros:
        return A
    result, (rows, columns) = ca.SX(A), A.sparsity().get_triplet()
    for k in zeros:
        result[rows[k], columns[k]] = 0
    return ca.sparsify(result)


def silenced(scene: Scene, found: Sequence[Block], A: ca.SX) -> list[Block]:
    """The blocks with nothing in the rows of which nothing is left in A, and whose positions are
    rounding, too."""
    empty, first, result = {*range(A.size1())} - {*A.sparsity().get_triplet()[0]}, 0, list[Block]()
    for block in found:
        own = {i - first for i in empty if 0 <= i - first < len(block.rows)}
        result.append(_silenced(scene, block, own) if own else block)
        first += len(block.rows)
    return result


def _silenced(scene: Scene, block: Block, rows: set[int]) -> Block:
    """Without those of these rows whose φ and value are rounding as well."""
    s, start = scene.symbols, min((r.position for r in block.rows if r.position >= 0), default=0)
    own = [i for i in sorted(rows) if block.rows[i].position >= 0]
    phi = [block.phi[block.rows[i].position - start] for i in own]
    values = [ca.SX(block.ways[0][i].value) for i in own]
    nothing = vanishing(ca.vertcat(*phi, *values), [s.t, s.q, s.p], _places(scene))
    silent = {i for k, i in enumerate(own) if nothing[k] and nothing[len(own) + k]}
    positions = {block.rows[i].position - start for i in silent}

    def still(entries: Sequence[ca.SX]) -> tuple[ca.SX, ...]:
        return tuple(ca.SX(0) if k in positions else x for k, x in enumerate(entries))

    ways = tuple(
        tuple(RowForm(row.name, ()) if i in silent else row for i, row in enumerate(way))
        for way in block.ways
    )
    return replace(
        block,
        phi=still(block.phi),
        ways=ways,
        assembly=still(block.assembly),
        whole=still(block.whole),
    )


def _places(scene: Scene) -> list[np.ndarray]:
    """t, q and p at random, quaternions of length one; parameters that are zero need not stay."""
    s, model, rng = scene.symbols, scene.model, np.random.default_rng(0)
    t = rng.uniform(0.0, 1.0, (PLACES, 1))
    q = rng.uniform(-1.0, 1.0, (PLACES, s.q.numel()))
    q *= [3.0 if c.unit == "rad" else 1.0 for c in model.coordinates] or 1.0
    for i in quaternions(model):
        q[:, i : i + 4] /= np.linalg.norm(q[:, i : i + 4], axis=1, keepdims=True)
    usual, change = np.array(s.defaults), rng.uniform(-0.2, 0.2, (PLACES, s.p.numel()))
    return [t, q, np.where(usual == 0.0, change, usual * (1.0 + change))]
