"""Base parameters: the fewest numbers that inverse dynamics depends on, as sums of standard ones.

First by the structure of the tree (derive.mechanics.regression.regrouping), then, where loops, the
direction of gravity or axes along each other leave less, by a rank-revealing QR decomposition of
the regressor at random admissible states (Gautier 1991, Numerical calculation of the base inertial
parameters).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import qr

from derive.formulations.evaluate import function_of
from derive.formulations.records import Equations
from derive.mechanics.regression.regressor import Parameter, parameters
from derive.mechanics.regression.regrouping import regrouping
from derive.states.sampling import states
from hamel.identify.limits import DEPENDS, ROUND, STATES, VANISHES

Array = np.ndarray


@dataclass(frozen=True)
class Base:
    """b = combination · π. `leading`: of each base parameter the standard one it is named after;
    `sums`: its closed expression."""

    standard: tuple[Parameter, ...]
    leading: tuple[int, ...]
    combination: Array  # nb × np
    basis: Array  # np × nb: Y basis are the columns of b
    sums: tuple[str, ...]
    without_effect: tuple[str, ...]
    by_structure: int  # how many the structure alone leaves
    kept: float  # the least of the columns that count, scaled to one
    dropped: float  # the largest of those that do not


def regressor_samples(equations: Equations, count: int, seed: int) -> Array:
    """Sᵀ Y at random admissible states and accelerations, one below the other, each state by the
    size of its largest entry."""
    system = equations.system
    samples = states(system, count, seed)
    function = function_of(equations, equations.request("regressor_w").function)
    to_state = function_of(equations, "state")
    rng = np.random.default_rng(seed)
    frame = () if equations.frame is None else equations.frame.values
    count_of_own = len(system.own_parameters)  # behind them p has the first-order states
    blocks: list[Array] = []
    for t, q, v, u, p in zip(samples.t, samples.q, samples.v, samples.u, samples.p):
        own = np.concatenate([p[:count_of_own], frame])
        qvz = np.concatenate([q, v, p[count_of_own:]])
        qw = to_state(t, qvz, u, own).full().ravel()[: len(q) + len(equations.w)]
        taken = np.concatenate([qw, rng.normal(size=len(equations.w))])
        block = function(t, taken, u, own).full()
        largest = np.abs(block).max(initial=0.0)
        if np.isfinite(largest) and largest > 0.0:
            blocks.append(block / largest)
    return np.vstack(blocks) if blocks else np.zeros((0, len(parameters(system))))


def base_parameters(equations: Equations, seed: int = 0) -> Base:
    """Those of the model of these equations, over its quasi-velocities."""
    system = equations.system
    known, shape = parameters(system), regrouping(system)
    wanted = max(STATES, 3 * len(known) // max(1, len(equations.w)) + 1)
    Y = regressor_samples(equations, wanted, seed)
    at = ca.Function("shape", [system.p], [ca.densify(shape.sums), ca.densify(shape.frames)])
    sums, frames = (x.full() for x in at(np.array(system.parameters)))
    Z = Y @ np.linalg.inv(frames)
    size = np.abs(sums).max(initial=1.0)
    felt = np.abs(Z).max(axis=0, initial=0.0) > VANISHES
    rows = np.flatnonzero((np.abs(sums).max(axis=1, initial=0.0) > VANISHES * size) & felt)
    columns = Z[:, rows]
    result, beta, least, most = independent(columns)
    combination = sums[rows][result] + beta @ np.delete(sums[rows], result, axis=0)
    combination[np.abs(combination) < ROUND * np.abs(combination).max(initial=1.0)] = 0.0
    text = _texts(shape.sums, rows[result], beta, combination, known)
    silent = np.flatnonzero(np.abs(combination).max(axis=0, initial=0.0) == 0.0)
    return Base(
        known,
        _leading(combination, rows[result]),
        combination,
        np.linalg.inv(frames)[:, rows[result]],
        text,
        tuple(known[k].name for k in silent),
        len(rows),
        least,
        most,
    )


def independent(columns: Array) -> tuple[Array, Array, float, float]:
    """Columns that the others are sums of: their places, β with others = kept β, the least part of
    a kept column that those before it do not have, and the largest of one that is dropped.

    The rank is told by QR with pivots; which columns stay, by the order they stand in.
    """
    lengths = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(lengths > 0.0, lengths, 1.0)
    if not scaled.size:
        return np.zeros(0, dtype=int), np.zeros((0, columns.shape[1])), 1.0, 0.0
    factors: Any = qr(scaled, mode="r", pivoting=True)
    R, pivots = factors
    left = np.abs(np.diag(R))
    rank = int(np.count_nonzero(left > DEPENDS))
    places = _in_order(scaled, rank)
    if len(places) != rank:
        places = np.sort(pivots[:rank])
    others = np.delete(np.arange(columns.shape[1]), places)
    beta = np.linalg.lstsq(scaled[:, places], scaled[:, others], rcond=None)[0]
    beta = beta / lengths[places][:, None] * lengths[others][None, :]
    beta[np.abs(beta) < ROUND] = 0.0
    return places, beta, float(left[:rank].min(initial=1.0)), float(left[rank:].max(initial=0.0))


def _in_order(scaled: Array, rank: int) -> Array:
    """Each column that is no sum of those before it."""
    basis = np.zeros((len(scaled), 0))
    places: list[int] = []
    for k, column in enumerate(scaled.T):
        rest = column - basis @ (basis.T @ column)
        rest = rest - basis @ (basis.T @ rest)
        size = float(np.linalg.norm(rest))
        if size > DEPENDS and len(places) < rank:
            places.append(k)
            basis = np.column_stack([basis, rest / size])
    return np.array(places, dtype=int)


def _leading(combination: Array, rows: Array) -> tuple[int, ...]:
    """The standard parameter of the same place, where it is in the sum; else the largest that no
    other one is named after."""
    leading = [int(r) if combination[k, r] else -1 for k, r in enumerate(rows)]
    for k in (k for k, r in enumerate(leading) if r < 0):
        order = np.argsort(-np.abs(combination[k]), kind="stable")
        inside = [int(j) for j in order if combination[k, j]]
        leading[k] = next((j for j in inside if j not in leading), inside[0])
    return tuple(leading)


def _texts(
    symbolic: ca.SX, rows: Array, beta: Array, combination: Array, known: tuple[Parameter, ...]
) -> tuple[str, ...]:
    """Closed expressions where the structure decides, numbers where the rank did."""
    texts: list[str] = []
    for k, row in enumerate(rows):
        by_rank = bool(np.any(beta[k])) if beta.size else False
        terms = [
            _term(_coefficient(symbolic[int(row), j], combination[k, j], by_rank), x.name)
            for j, x in enumerate(known)
            if combination[k, j]
        ]
        texts.append(" ".join(terms).removeprefix("+ "))
    return tuple(texts)


def _coefficient(symbolic: ca.SX, value: float, by_rank: bool) -> str:
    if by_rank or symbolic.is_constant():
        nearest = round(value)
        return f"{nearest}" if abs(value - nearest) < ROUND else f"{value:.6g}"
    return re.sub(r"sq\((\w+)\)", r"\1^2", str(symbolic))


def _term(coefficient: str, name: str) -> str:
    negative = coefficient.startswith("-") and " " not in coefficient
    size = coefficient.removeprefix("-") if negative else coefficient
    size = "" if size == "1" else f"({size}) " if " " in size else f"{size} "
    return f"{'-' if negative else '+'} {size}{name}"
