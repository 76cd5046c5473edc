"""Exact derivatives of a straight-line program by dual numbers: every operation passes on the
tangents of its operands, in NumPy and with derivatives from the table of `carried`.

Differences of a fast system lose digits that the derivative has; here only rounding is left.
Source: A. Griewank, A. Walther, Evaluating Derivatives, SIAM 2008, §3.1 (forward propagation).
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from hamel.verify.checks.carried import Changes, carried
from hamel.verify.reference.vectors import Array


def tangents(
    arguments: Sequence[ca.SX], value: ca.SX, place: Sequence[Array], directions: Array
) -> Array:
    """d value/dh at place + h · direction for each direction, entries of `value` × directions.

    `value` is an expression over the arguments, columns that together have as many entries as
    each row of `directions`; `place` holds their values.
    """
    given = np.concatenate([np.ravel(part) for part in place])
    changes = Changes(
        argument=lambda _: directions.T[:, :, np.newaxis],
        number=np.zeros_like,
        passed=lambda _, slope, change: slope * change,
        added=lambda *_: np.zeros(1),
    )
    column = ca.vec(value)
    return carried(arguments, column, given[np.newaxis], changes, len(directions))[:, 0].T
