"""Linear equations along a motion that lies exactly where forces bend or jump.

There the slope of a term depends on which piece is taken, and terms that share a kink have to take
the same side: of −k ramp(x) + k ramp(−x) one side each would add up to 2k. So both sides are taken
for the whole model at once. Where they agree, as here, that is the slope; else it is their mean.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from derive.expressions.beside import with_pieces_beside
from derive.formulations.evaluate import function_of
from derive.formulations.records import Equations
from derive.linearize.limits import ASIDE, BENDS, JUMPS, ON_KINK
from derive.linearize.minimal import evaluator
from derive.linearize.records import Kink, Linear
from derive.states.scales import scales

Point = tuple[np.ndarray, np.ndarray, np.ndarray]  # x, u and p


@dataclass(frozen=True)
class Sides:
    """The linear equations on both sides, by the rates ẋ (nx) and slopes A (n × n) of each, in the
    model's own units."""

    rates: list[np.ndarray]
    slopes: list[np.ndarray]

    @property
    def kind(self) -> Kink:
        """What there is to tell."""
        largest = float(np.abs(self.slopes).max(initial=0.0))
        if _differ(self.rates, JUMPS * (1.0 + largest)):
            return Kink.JUMPS
        return Kink.BENDS if _differ(self.slopes, BENDS * largest) else Kink.NONE


def _differ(sides: list[np.ndarray], least: float) -> bool:
    first, second = sides
    return bool(np.abs(first - second).max(initial=0.0) > least)


def at_kink(form: Linear, at: Point) -> Linear:
    """The linear equations with the mean of both sides, where the motion `at` lies on kinks."""
    across = _across(form, at)
    if across is None:
        return form
    equations = form.equations
    x, one = equations.arguments[1].symbols, _one(equations)
    f, own = equations.function("dynamics").result.value, one[list(form.independent)]
    rates, slopes = (_on_sides(value, x, across, _valued(equations, at)) for value in (f, form.A))
    sides = Sides([r.ravel() / one for r in rates], [A * own / own[:, None] for A in slopes])
    A, B, C, D = (mean_of_sides(value, x, across) for value in (form.A, form.B, form.C, form.D))
    return replace(form, A=A, B=B, C=C, D=D, across=across, kink=sides.kind)


def mean_of_sides(value: ca.SX, at: ca.SX, across: np.ndarray) -> ca.SX:
    """`value` over the symbols `at`, half of it by the pieces on each side."""
    return sum((with_pieces_beside(value, at, way) for way in (across, -across)), ca.SX(0)) / 2


def _on_sides(
    value: ca.SX, at: ca.SX, across: np.ndarray, valued: Callable[[ca.SX], np.ndarray]
) -> list[np.ndarray]:
    return [valued(with_pieces_beside(value, at, way)) for way in (across, -across)]


def _valued(equations: Equations, at: Point) -> Callable[[ca.SX], np.ndarray]:
    x, u, p = (part[np.newaxis] for part in at)
    return lambda value: evaluator(equations, value)(x, u, p)[0]


def _one(equations: Equations) -> np.ndarray:
    return scales(equations.system.model).all_of(equations.arguments[1].units)


def _across(form: Linear, at: Point) -> np.ndarray | None:
    """A short way in x along the constraints, across every kink that the motion lies on; None where
    there is none. Kinks by other names for the same place are crossed in the same sense."""
    slopes = _kinks_here(form, at)
    if not len(slopes):
        return None
    weights = np.random.default_rng(0).uniform(1.0, 2.0, len(slopes))  # kinks do not cancel
    way = weights @ slopes
    way /= np.abs(slopes @ way).min()
    T = _valued(form.equations, at)(form.T)
    own = _one(form.equations)[list(form.independent)]
    return ASIDE * T @ (own * way)


def _kinks_here(form: Linear, at: Point) -> np.ndarray:
    """Of each function of `kinks` that is zero here its slopes by the minimal states, in the
    model's own units and of length one. |v| v has such a kink, too, though it is smooth there."""
    equations = form.equations
    own = _one(equations)[list(form.independent)]
    makes = [request.make for request in equations.requests if request.name == "kinks"]
    if not makes or makes[0] is None:
        return np.zeros((0, len(own)))
    function, (x, u, p) = function_of(equations, makes[0]()), at
    values = np.array(function(0.0, x, u, p)).ravel()
    slopes = np.array(function.jacobian()(0.0, x, u, p, values)[1])
    slopes = slopes @ _valued(equations, at)(form.T) * own
    lengths = np.linalg.norm(slopes, axis=1)
    here = (lengths > 0) & (np.abs(values) <= ON_KINK * lengths)
    return slopes[here] / lengths[here, np.newaxis]
