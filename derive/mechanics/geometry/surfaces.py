"""Surfaces given by formulas of x, y, z: their value and slope, and whether they have one."""

from __future__ import annotations

import casadi as ca
import numpy as np

from derive.diagnostics import AssumptionError
from derive.expressions.evaluate import value
from derive.expressions.tree import Expression
from derive.mechanics.elimination.solve import scalars, small_inverse
from derive.mechanics.limits import FEET, FLAT_SURFACE, STEPS_TO_FOOT, STEPS_TO_SURFACE
from derive.mechanics.scene import IN_PLANE, Scene
from derive.model.records import Span


def surface_over(scene: Scene, surface: Expression, span: Span) -> tuple[ca.SX, ca.SX]:
    """The formula over a point of three symbols, and the point; the letters shadow the model's own
    names. Raises AssumptionError where the slope vanishes wherever the formula does."""
    s, point = scene.symbols, ca.SX.sym("point", 3)
    names = s.names | dict(zip("xyz", ca.vertsplit(point)))
    f = ca.SX(value(surface, names, s.rates, s.functions))
    _check_slope(scene, f, point, span)
    return f, point


def _check_slope(scene: Scene, f: ca.SX, point: ca.SX, span: Span) -> None:
    """From some points to the surface by Newton's steps along the slope: where every one of them
    loses its slope on the way, there is no normal."""
    s = scene.symbols
    arguments = [point, s.t, s.p]
    at = ca.Function("surface", arguments, [f, ca.gradient(f, point)])
    rng = np.random.default_rng(0)
    ratios = [_slope_left(at, scene, rng.normal(size=3)) for _ in range(FEET)]
    slopes = [ratio for ratio in ratios if ratio is not None]
    if slopes and max(slopes) < FLAT_SURFACE:
        raise AssumptionError(
            scene.model.diagnostic(
                span,
                "the slope of the surface vanishes wherever the surface is: it has no normal there",
                "a formula that changes its sign across the surface, such as z - x^2 and not its "
                "square",
            )
        )


def _slope_left(at: ca.Function, scene: Scene, start: np.ndarray) -> float | None:
    """|∇f| at the end over that at the start; None where no step leads to the surface."""
    axes = list(IN_PLANE[scene.model.plane])
    point, first, size, step = np.zeros(3), 0.0, 0.0, np.inf
    point[axes] = start[axes]
    for _ in range(STEPS_TO_SURFACE):
        height, slope = (np.array(x).ravel() for x in at(point, 0.0, scene.symbols.defaults))
        size = float(slope @ slope)
        first = first or size**0.5
        if not np.isfinite(size) or not np.isfinite(height[0]):
            return None
        if size == 0.0:
            return 0.0
        move = height[0] * slope / size
        point, step = point - move, float(np.linalg.norm(move))
    return size**0.5 / first if step < FLAT_SURFACE else None


def nearest_point(f: ca.SX, point: ca.SX, centre: ca.SX) -> ca.SX:
    """P of f(P) = 0, P + μ ∇f(P) = centre, by STEPS_TO_FOOT of Newton's steps from the centre: each
    doubles the digits while the centre is nearer than the surface curves."""
    mu, at = ca.SX.sym("mu"), ca.SX.sym("centre", 3)
    g, H = ca.gradient(f, point), ca.hessian(f, point)[0]
    inverse = ca.vertcat(
        *[ca.horzcat(*row) for row in small_inverse(scalars(ca.SX.eye(3) + mu * H))[0]]
    )
    left = point + mu * g - at
    change = (f - ca.dot(g, ca.mtimes(inverse, left))) / ca.dot(g, ca.mtimes(inverse, g))
    moved = point - ca.mtimes(inverse, left + g * change)
    others = [x for x in ca.symvar(f) if x.name() not in {y.name() for y in ca.symvar(point)}]
    parameters = ca.vertcat(ca.SX(0, 1), *others)
    step = ca.Function("step", [point, mu, at, parameters], [moved, mu + change])
    here, weight = centre, ca.SX(0)
    for _ in range(STEPS_TO_FOOT):
        here, weight = step(here, weight, centre, parameters)
    return here
