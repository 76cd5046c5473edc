"""Counts of operations."""

from __future__ import annotations

import casadi as ca

from derive.expressions.counting import alternatives


def test_each_result_is_counted_by_itself() -> None:
    """Equal sums are one, whichever way round; of no results there are no counts."""
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    assert alternatives([(a + b) * (b + a), a * b + 1.0, a]) == [2, 2, 0]
    assert alternatives([]) == []
