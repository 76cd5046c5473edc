"""Charts: several choices of quasi-velocities for one motion, of which one takes over where another is nearly singular.

Every choice is a chart of the same motion, regular where its pivots are away from zero. From chart a to chart b a state is
carried exactly, x_b = (q, B_b v) with v = S_a w_a + R_a c: nothing is projected or fitted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from derive.diagnostics import AssumptionError
from derive.formulations.records import Equations, Function

BETWEEN = "+"  # of the names of choices that are charts of one module
BY_ROWS = ("state", "pull", "guards")  # made of B, which differs between choices, though w does not occur


def charted(found: Sequence[Equations]) -> Equations:
    """The first with the others as its charts. Raises AssumptionError where a choice is named twice."""
    names = [one.choice for one in found]
    for name in names:
        if names.count(name) > 1:
            raise AssumptionError(f"choice '{name}' is named twice among the charts {BETWEEN.join(names)}")
    return replace(found[0], charts=tuple(found[1:]))


def together(equations: Equations) -> str:
    """The names of all charts, as `--choice` takes them."""
    return BETWEEN.join([equations.choice, *(chart.choice for chart in equations.charts)])


def differs(equations: Equations, function: Function) -> bool:
    """Whether a function depends on the choice: it takes w, other than to hand it on, has guards, or is made of B."""
    x = next(argument.symbols for argument in equations.arguments if argument.name == "x")
    w = x[equations.system.q.numel() :]
    value, handed = function.result.value, equations.system.q.numel()
    if function.iteration and value.numel() == x.numel() and all(_same(value[handed + k], w[k]) for k in range(w.numel())):
        value = value[:handed]
    return bool(function.name in BY_ROWS or function.guards or ca.depends_on(value, w))


def _same(a: ca.SX, b: ca.SX) -> bool:
    return ca.is_equal(a, b)
