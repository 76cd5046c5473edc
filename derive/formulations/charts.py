"""Charts: several choices of quasi-velocities for one motion, of which one takes over where another
is nearly singular.

Every choice is a chart of the same motion, regular where its pivots are away from zero. From chart
a to chart b a state is carried exactly, x_b = (q, B_b v) with v = S_a w_a + R_a c: nothing is
projected or fitted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from derive.choices.named import carried_through
from derive.choices.records import Guard
from derive.choices.resolution import Resolved, Survey, ranked_partitions
from derive.diagnostics import AssumptionError, HamelError
from derive.formulations.records import Equations, Function

BETWEEN = "+"  # of the names of choices that are charts of one module
BY_ROWS = (
    "state",
    "pull",
    "guards",
)  # made of B, which differs between choices, though w does not occur
# of its largest value over the sampled states: a pivot that comes closer to zero at one of them
# makes a choice unsafe
SAFE = 0.03
ENOUGH = (
    0.2  # no further chart where some chart has all pivots above this part at every sampled state
)
WORTH = 2.0  # times as far from singular at the worst state: what a further chart has to bring
MOST = 4  # charts that are looked for
LOW = 0.2  # of the largest pivot seen when the equations were made: below this a chart is left ...
BETTER = 2.0  # ... for one that is so much better, so that no two charts take turns


def charted(found: Sequence[Equations], survey: Survey) -> Equations:
    """The first with the others as its charts. Raises AssumptionError where a choice is named
    twice."""
    names = [one.choice for one in found]
    for name in names:
        if names.count(name) > 1:
            raise AssumptionError(
                f"choice '{name}' is named twice among the charts {BETWEEN.join(names)}"
            )
    said = (
        f"charts {', '.join(names)}: where one comes near a singular position, another takes over"
    )
    first, *others = (replace(one, largest=_largest(_guards(one), survey)) for one in found)
    return replace(first, charts=tuple(others), assumptions=(*first.assumptions, said))


def together(equations: Equations) -> str:
    """The names of all charts, as `--choice` takes them."""
    return BETWEEN.join([equations.choice, *(chart.choice for chart in equations.charts)])


def covered(first: Equations, survey: Survey, made: Callable[[str], Equations]) -> Equations:
    """With further charts where neither this choice nor any other candidate is safe at all sampled
    states.

    Candidates are the partitions that `auto` ranks and the choices of the file; `made` gives the
    equations of one by name. The next chart is the one that takes the worst state farthest from
    singular. Where no few are safe together, there are none.
    """
    here = _margins(_guards(first), survey)
    if first.generalized_velocities or np.min(here, initial=np.inf) >= SAFE:
        return first
    others = {x.ranking.name: _margins(x.reduction.guards, survey) for x in _candidates(survey)}
    if any(np.min(margins) >= SAFE for margins in others.values()):
        return first
    names: list[str] = []
    while others and len(names) + 1 < MOST and np.min(here) < ENOUGH:
        best = max(others, key=lambda name: float(np.min(np.maximum(here, others[name]))))
        margins = np.maximum(here, others.pop(best))
        if np.min(margins) < WORTH * np.min(here):
            break
        here = margins
        names.append(best)
    return charted([first, *map(made, names)], survey) if np.min(here) >= SAFE else first


def _candidates(survey: Survey) -> list[Resolved]:
    found = ranked_partitions(survey)
    for choice in survey.system.model.choices:
        if choice.kind not in ("rows", "auto"):
            try:
                found.append(carried_through(survey, choice))
            except HamelError:
                continue  # `hamel choices` says why
    return found


def _guards(equations: Equations) -> tuple[Guard, ...]:
    return next(
        (function.guards for function in equations.functions if function.name == "dynamics"), ()
    )


def _sizes(guards: Sequence[Guard], survey: Survey) -> np.ndarray:
    """|value| / tolerance at the sampled states, states × guards."""
    s = survey.sampled
    values = ca.vertcat(*[guard.value / guard.tolerance for guard in guards])
    return np.abs(survey.solver.values(values, s.t, s.q, s.p))[:, :, 0]


def _largest(guards: Sequence[Guard], survey: Survey) -> tuple[float, ...]:
    """To three digits."""
    return (
        tuple(float(f"{x:.3g}") for x in np.max(_sizes(guards, survey), axis=0)) if guards else ()
    )


def _margins(guards: Sequence[Guard], survey: Survey) -> np.ndarray:
    """The smallest guard at each sampled state, relative to its largest value over all of them."""
    if not guards:
        return np.full(len(survey.sampled.t), np.inf)
    sizes = _sizes(guards, survey)
    return np.min(sizes / np.maximum(np.max(sizes, axis=0), 1e-300), axis=1)


def differs(equations: Equations, function: Function) -> bool:
    """Whether a function depends on the choice: it takes w, other than to hand it on, has guards,
    or is made of B."""
    x = equations.argument("x").symbols
    nq, value = equations.system.q.numel(), function.result.value
    w = x[nq:]
    if (
        function.iteration
        and value.numel() == x.numel()
        and all(ca.is_equal(value[nq + k], w[k]) for k in range(w.numel()))
    ):
        value = value[:nq]
    return bool(function.name in BY_ROWS or function.guards or ca.depends_on(value, w))
