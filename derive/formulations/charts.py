"""Charts: several choices of quasi-velocities for one motion, of which one takes over where another
is nearly singular.

Every choice is a chart of the same motion, regular where its pivots are away from zero. From chart
a to chart b a state is carried exactly, x_b = (q, B_b v, z) with v = S_a w_a + R_a c: nothing is
projected or fitted, and first-order states z are the same in all.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from derive.choices.few_rows import has_few_rows
from derive.choices.locks import LOCK
from derive.choices.named import carried_through
from derive.choices.records import Guard
from derive.choices.resolution import Resolved, partition_for, ranked_partitions
from derive.choices.survey import Survey, speed_name
from derive.diagnostics import NAMES, HamelError, ModelError, listed
from derive.formulations.frames import in_numbers
from derive.formulations.limits import DENSE, ENOUGH, MOST, SAFE, WORTH
from derive.formulations.motion import with_frame
from derive.formulations.records import Equations, Function
from derive.numerics import NONZERO
from derive.states.sampling import States

BETWEEN = "+"  # of the names of choices that are charts of one module
BY_ROWS = (
    "state",
    "pull",
    "guards",
)  # made of B, which differs between choices, though w does not occur


def charted(found: Sequence[Equations], survey: Survey) -> Equations:
    """The first with the others as its charts, each with the largest values of its guards at the
    sampled states: what a margin is relative to. Raises ModelError where a choice is named
    twice."""
    names = [one.choice for one in found]
    for name in names:
        if names.count(name) > 1:
            raise ModelError(
                f"choice '{name}' is named twice among the charts {BETWEEN.join(names)}"
            )
    told = ", ".join(_told(name, survey) for name in names)
    said = f"charts {told}: where one comes near a singular position, another takes over"
    first, *others = (
        replace(one, largest=_largest(_at_frame(one, _guards(one)), survey))
        for one in _of_one_frame(found)
    )
    return replace(first, charts=tuple(others), assumptions=(*first.assumptions, said))


def _told(name: str, survey: Survey) -> str:
    """The name of a choice; that of a partition of many velocities by the few it leaves out."""
    words, system = set(name.split()), survey.system
    if len(words) <= NAMES:
        return name
    known = [speed_name(system, j) for j in range(system.v.numel())]
    return f"all but {listed(x for x in known if x not in words)}"


def _of_one_frame(found: Sequence[Equations]) -> list[Equations]:
    """All with the parameters of all: the frame of one of them belongs to every chart."""
    frames = [one.frame for one in found if one.frame is not None]
    if not frames:
        return list(found)
    frame, parameters = frames[0], found[0].system.own_parameters
    return [
        one
        if one.frame is not None
        else replace(
            one,
            frame=frame,
            arguments=tuple(
                with_frame(slot, frame) if slot.name == "p" else slot for slot in one.arguments
            ),
            parameters=(*parameters, *frame.values),
        )
        for one in found
    ]


def _at_frame(equations: Equations, guards: tuple[Guard, ...]) -> tuple[Guard, ...]:
    """The guards with the usual frame in numbers."""
    if equations.frame is None or not guards:
        return guards
    values = in_numbers([guard.value for guard in guards], equations.frame)
    return tuple(replace(guard, value=value) for guard, value in zip(guards, values))


def together(equations: Equations) -> str:
    """The names of all charts, as `--choice` takes them."""
    return BETWEEN.join([equations.choice, *(chart.choice for chart in equations.charts)])


def covered(first: Equations, survey: Survey, made: Callable[[str], Equations]) -> Equations:
    """With further charts where neither this choice nor any other candidate is safe at all sampled
    states.

    The margin of a chart at a state is the smallest |guard| there over the largest that the guard
    has at any sampled state: 1 is far from singular, 0 is a singular position. Candidates are the
    partitions that `auto` ranks and the choices of the file; `made` gives the equations of one by
    name. The next chart is the one that takes the worst state farthest from singular.

    Where the file leaves the choice open, a pivot that is of both signs over the states, and so
    vanishes between them, is a reason, too: then a choice that is safe alone is a chart, too. Where
    none is, and no few are far from singular together, the orthonormal choice is the other chart:
    it goes wherever A has full rank. With more than DENSE quasi-velocities that choice takes many
    times the operations, and partitions are the other charts all the same; of chains that few rows
    hold they are where they are far from singular together. Gimbal lock counts for
    nothing: it is one of the coordinates, in any choice.
    """
    guards = tuple(x for x in _at_frame(first, _guards(first)) if not x.name.startswith(LOCK))
    here = _margins(guards, survey)
    left_open = survey.system.model.choices[0].kind == "auto"
    turns = left_open and _changes_sign(guards, survey)
    if first.generalized_velocities or (np.min(here, initial=np.inf) >= SAFE and not turns):
        return first
    others = {x.ranking.name: _guards_of(x) for x in _candidates(survey)}
    alone = [
        name
        for name, them in others.items()
        if np.min(_margins(them, survey)) >= SAFE and not (turns and _changes_sign(them, survey))
    ]
    if alone:
        return charted([first, made(alone[0])], survey) if turns else first
    names = _together_safe(here, {k: _margins(x, survey) for k, x in others.items()})
    if turns and _least_between(guards, [others[name] for name in names], survey) < ENOUGH:
        dense, few = survey.freedom > DENSE, has_few_rows(survey)
        partitions, far = _partitions(guards, others, survey) if dense or few else ([], False)
        if dense and not far:
            found = charted([first, *map(made, partitions)], survey) if partitions else first
            return _noted(found)
        names = partitions if far else ["orthonormal"]
    return charted([first, *map(made, names)], survey) if names else first


def _partitions(
    guards: tuple[Guard, ...], others: dict[str, tuple[Guard, ...]], survey: Survey
) -> tuple[list[str], bool]:
    """The partitions that are farthest from singular together over many states, and whether that is
    far."""
    here = _margins(guards, survey, survey.many)
    margins = {name: _margins(them, survey, survey.many) for name, them in others.items()}
    names, together = _together(here, margins)
    for _ in range(MOST - 2):
        if np.min(together) >= SAFE:
            break
        further = partition_for(survey, int(np.argmin(together)))
        if further is None or further.ranking.name in margins:
            break
        margins[further.ranking.name] = _margins(_guards_of(further), survey, survey.many)
        names, together = _together(here, margins)
    return names, bool(np.min(together) >= SAFE)


def _noted(found: Equations) -> Equations:
    said = (
        "no few partitions are far from singular everywhere, and the choice orthonormal, which is, "
        f"takes many operations: where a pivot vanishes, {found.choice}{BETWEEN}orthonormal goes on"
    )
    return replace(found, assumptions=(*found.assumptions, said))


def _together_safe(here: np.ndarray, others: dict[str, np.ndarray]) -> list[str]:
    """Which charts to add so that every state is safe in one; none where no few do it."""
    names, margins = _together(here, others)
    return names if np.min(margins) >= SAFE else []


def _together(here: np.ndarray, others: dict[str, np.ndarray]) -> tuple[list[str], np.ndarray]:
    """Which charts to add, as long as each brings much, and the margins of all together."""
    names, others = list[str](), dict(others)
    while others and len(names) + 1 < MOST and np.min(here) < ENOUGH:
        best = max(others, key=lambda name: float(np.min(np.maximum(here, others[name]))))
        margins = np.maximum(here, others.pop(best))
        if np.min(margins) < WORTH * np.min(here):
            break
        here = margins
        names.append(best)
    return names, here


def _least_between(
    guards: tuple[Guard, ...], others: Sequence[tuple[Guard, ...]], survey: Survey
) -> float:
    """The least margin of all charts together over many states. Pivots that change sign in every
    one of them may vanish together between these states, on a set that a motion can come near: far
    from singular at all states is what says that they do not."""
    best = [_margins(them, survey, survey.many) for them in (guards, *others)]
    return float(np.min(np.max(best, axis=0), initial=np.inf))


def _changes_sign(guards: Sequence[Guard], survey: Survey) -> bool:
    if not guards:
        return False
    values = _values(guards, survey, survey.many)
    return bool(np.any(np.min(values, axis=0) * np.max(values, axis=0) < 0.0))


def _candidates(survey: Survey) -> list[Resolved]:
    partitions = ranked_partitions(survey)
    for choice in survey.system.model.choices:
        if choice.kind not in ("rows", "auto"):
            try:
                partitions.append(carried_through(survey, choice))
            except HamelError:
                continue  # `hamel choices` says why
    return partitions


def _guards_of(found: Resolved) -> tuple[Guard, ...]:
    reduction = found.reduction
    return tuple(replace(x, value=reduction.at_frame(x.value)) for x in reduction.guards)


def _guards(equations: Equations) -> tuple[Guard, ...]:
    return equations.function("dynamics").guards if equations.has("dynamics") else ()


def _values(guards: Sequence[Guard], survey: Survey, s: States) -> np.ndarray:
    """value / tolerance at states, states × guards."""
    values = ca.vertcat(*[guard.value / guard.tolerance for guard in guards])
    return survey.solver.values(values, s.t, s.q, s.p)[:, :, 0]


def _largest(guards: Sequence[Guard], survey: Survey) -> tuple[float, ...]:
    """To three digits."""
    if not guards:
        return ()
    sizes = np.abs(_values(guards, survey, survey.sampled))
    return tuple(float(f"{x:.3g}") for x in np.max(sizes, axis=0))


def _margins(guards: Sequence[Guard], survey: Survey, at: States | None = None) -> np.ndarray:
    """The smallest guard at each sampled state, or at others, relative to its largest value over
    all sampled ones."""
    sampled = survey.sampled
    here = sampled if at is None else at
    if not guards:
        return np.full(len(here.t), np.inf)
    largest = np.max(np.abs(_values(guards, survey, sampled)), axis=0)
    sizes = np.abs(_values(guards, survey, here))
    return np.min(sizes / np.maximum(largest, NONZERO), axis=1)


def differs(equations: Equations, function: Function) -> bool:
    """Whether a function depends on the choice: it takes w, other than to hand it on, has guards,
    or is made of B. What does not differ is written once for all charts of a module."""
    x = equations.argument("x").symbols
    nq, value = equations.system.q.numel(), function.result.value
    w = x[equations.speeds, 0]
    if (
        function.iteration
        and value.numel() == x.numel()
        and all(ca.is_equal(value[i], x[i]) for i in range(nq, x.numel()))
    ):
        value = value[:nq, 0]
    return bool(function.name in BY_ROWS or function.guards or ca.depends_on(value, w))
