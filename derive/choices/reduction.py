"""A choice of quasi-velocities carried through: v = S w + v₀, v̇ = S ẇ + σ, with B v = w, pivots
and guards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod

import casadi as ca
import numpy as np

from derive.choices.elimination import (
    Beginning,
    Elimination,
    Speeds,
    beginning,
    elimination,
    transformation,
)
from derive.choices.limits import SHORT, SINGULAR
from derive.choices.records import Frame, Guard
from derive.choices.walk import Coefficients, Step
from derive.expressions.scalars import Matrix, Scalar
from derive.joints.rotations import rotated as turned_vector
from derive.joints.rotations import transpose
from derive.mechanics.limits import COFACTORS
from derive.mechanics.records import Carried, Numbers, RowForm, System
from derive.mechanics.recursions.forms import Form, rotated
from derive.states.sampling import States


@dataclass(frozen=True)
class Reduction:
    """`walked` is the elimination where there was one; without it the links' twists follow from v
    alone."""

    names: tuple[str, ...]
    w: ca.SX
    B: ca.SX
    S: ca.SX
    v: ca.SX
    sigma: ca.SX
    walked: Elimination | None
    guards: tuple[Guard, ...]
    pivots: tuple[str, ...]
    kept: tuple[int, ...]  # indices of the constraint rows that are independent
    constant_pivots: bool
    frame: Frame | None = None  # on whose symbols all of it depends

    @property
    def tree(self) -> Carried | None:
        """What was walked, where that is not the system itself."""
        walked = None if self.walked is None else self.walked.tree
        return walked if isinstance(walked, Carried) else None

    def at_frame(self, expression: ca.SX) -> ca.SX:
        """An expression with the usual numbers in the place of the frame."""
        if self.frame is None:
            return expression
        return ca.substitute(expression, self.frame.symbols, ca.DM(self.frame.values))


@dataclass(frozen=True)
class Task:
    """What is to be eliminated, however the rows are written: the speeds B v = w by their names,
    the constraint rows that are independent, and the states and magnitudes by which pivots are
    judged."""

    names: tuple[str, ...]
    B: ca.SX
    kept: tuple[int, ...]
    sampled: States
    sizes: Sequence[float]


@dataclass(frozen=True)
class Way:
    """Constraint rows and speed rows over the velocities of a tree; twists with at most `short`
    terms are written as their forms."""

    tree: System | Carried
    rows: Sequence[RowForm]
    speeds: Sequence[RowForm]
    short: int = SHORT


def by_elimination(task: Task, way: Way) -> Reduction:
    """The reduction with the rows written in one way. S is nv × nw, σ is nv × 1, guards are the
    pivots that vary. Raises Dependent and Undetermined as `elimination` does."""
    w, tree = symbols_for(task.names), way.tree
    speeds = Speeds(way.speeds, w)
    result = elimination(tree, way.rows, speeds, task.sampled, task.sizes, way.short)
    forms, v, sigma = _of_the_system(result)
    return Reduction(
        names=task.names,
        w=w,
        B=task.B,
        S=transformation(forms, len(task.names)),
        v=ca.vertcat(*v) if v else ca.SX(0, 1),
        sigma=ca.vertcat(*sigma) if sigma else ca.SX(0, 1),
        walked=result,
        guards=tuple(
            _guard(tree, result, step, task.sampled)
            for step in result.steps
            if step.block.grade == 2
        ),
        pivots=tuple(_in_words(tree, result, step) for step in result.steps),
        kept=task.kept,
        constant_pivots=all(step.block.grade < 2 for step in result.steps),
    )


def first_rows(task: Task, way: Way, most: int) -> Beginning:
    """The beginning of the same, up to the link where `most` rows are solved. Raises Dependent."""
    w = symbols_for(task.names)
    coefficients_at = Coefficients(way.tree, task.sampled, task.sizes)
    return beginning(way.tree, way.rows, Speeds(way.speeds, w), coefficients_at, way.short, most)


def _of_the_system(
    result: Elimination,
) -> tuple[Sequence[Form], list[Scalar], list[Scalar]]:
    """The forms of v, their values and σ: those of a further frame's velocities make place for the
    twist of the body in it."""
    tree = result.tree
    if isinstance(tree, System):
        return result.speeds, result.v, result.sigma
    first, body = tree.columns[0], tree.body
    last = first + len(tree.columns) + 1
    omega, velocity = (rotated(transpose(tree.turned), x) for x in result.twists[body])
    forms = [*result.speeds[:first], *velocity, *omega, *result.speeds[last:]]
    v = [*result.v[:first], *_six(tree.turned, result.numbers[body]), *result.v[last:]]
    sigma = [*result.sigma[:first], *_six(tree.turned, result.rates[body]), *result.sigma[last:]]
    return forms, v, sigma


def _six(turned: Matrix, twist: Numbers) -> list[Scalar]:
    """Linear velocity first, as the velocities of a free joint stand."""
    return [*turned_vector(turned, twist[1]), *turned_vector(turned, twist[0])]


def unreduced(system: System, names: tuple[str, ...]) -> Reduction:
    """The generalized velocities of a system without constraints are the quasi-velocities: v = w, S
    = B = 1, σ = 0, and nothing is divided by."""
    nv, w = system.v.numel(), symbols_for(names)
    one = ca.SX.eye(nv)
    return Reduction(names, w, one, one, w, ca.SX(nv, 1), None, (), (), (), True)


def symbols_for(names: Sequence[str]) -> ca.SX:
    """A column of SX symbols of these names; 0 × 1 where there are none, so that products with it
    keep their shape."""
    return ca.vertcat(*[ca.SX.sym(name) for name in names]) if names else ca.SX(0, 1)


def _guard(system: System | Carried, found: Elimination, step: Step, sampled: States) -> Guard:
    """|pivot| against SINGULAR of its largest value at the sampled states."""
    names = ", ".join(found.row_names[i] for i in step.rows)
    pivot = ca.SX(step.pivot)
    if len(step.rows) > COFACTORS:
        given = [sampled.t.reshape(1, -1), sampled.q.T, sampled.p.T]
        sizes = ca.Function("pivot", [system.t, system.q, system.p], [pivot]).call(given)[0]
        largest = float(np.max(np.abs(sizes.full())))
    else:
        # the block was judged with rows of length one, the pivot in the code is not
        largest = step.block.largest * prod(found.sizes[i] for i in step.rows)
    return Guard(f"pivot of {names}", pivot, SINGULAR * largest)


def _in_words(system: System | Carried, found: Elimination, step: Step) -> str:
    rows = " and ".join(found.row_names[i] for i in step.rows)
    unknowns = " and ".join(_unknown(system, key[1]) for key in step.keys)
    block = step.block
    kind = (
        "a number",
        "cannot vanish",
        f"varies, {block.least:.2g} … {block.largest:.2g} over the sampled states",
    )[block.grade]
    return f"{rows} {'give' if len(step.rows) > 1 else 'gives'} {unknowns} (pivot: {kind})"


def _unknown(system: System | Carried, j: int) -> str:
    link = next((x for x in system.links if j in x.columns), None)
    if link is not None and link.turns_about >= 0:
        return f"the angular velocity of {link.name}"
    return system.labels[j]
