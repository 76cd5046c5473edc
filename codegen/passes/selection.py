"""Which functions a program holds: those that were asked for, and those that they, the integrators,
the enforcements and the charts need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from codegen.integrators import AUTO, AUTOMATIC, INTEGRATORS
from codegen.passes.folding.roll import NEVER, refusal
from codegen.program import CHART
from derive.diagnostics import AssumptionError, HamelError
from derive.enforcement import ENFORCEMENTS
from derive.formulations.charts import differs
from derive.formulations.records import Equations, Function, Request, Result
from derive.formulations.requests import request_of, unknown_function

MOST_ON_STACK = 60_000  # entries of a matrix that is factored while stepping
JACOBIAN = "jacobian"
MOST_ENTRIES = 10_000  # of a matrix that nobody asked for


@dataclass(frozen=True)
class Contents:
    """`emitted`: functions, each with the equations of its chart. `loops`: what was asked for and
    is a loop around others. `simulates`: there are equations of motion, and what steps need."""

    emitted: tuple[tuple[Equations, Function], ...]
    loops: tuple[Request, ...]
    simulates: bool
    enforcements: tuple[str, ...]


def contents(
    equations: Equations,
    names: Sequence[str] | None,
    integrators: Sequence[str],
    enforcements: Sequence[str] | None,
    roll: str,
) -> Contents:
    """What a program of these functions, integrators and enforcements holds. Raises HamelError for
    a name that the model does not know, AssumptionError where a Jacobian is too large."""
    chosen, loops = selection(equations, names, roll), loops_asked(equations, names)
    if equations.frame:  # what keeps the frame, and gives its numbers, comes with dynamics
        chosen = selection(equations, ["dynamics", *_names(chosen)], roll)
    simulates = any(function.name == "dynamics" for function in chosen)
    if simulates:
        enforcements = usual_enforcements(chosen) if enforcements is None else enforcements
        needs = [*integrator_needs(integrators), *enforcement_needs(equations, enforcements)]
        needs += watched_functions(equations)
        check_jacobian(equations, needs)
        chosen = selection(equations, [*_names(chosen), *needs])
        called = {*needs, *(name for loop in loops for name in loop.needs[1:])}
        check_size([function for function in chosen if function.name in called])
    if equations.charts or equations.frame:
        chosen = selection(equations, [*_names(chosen), *for_charts(equations)])
    emitted = [(equations, function) for function in chosen]
    for number, chart in enumerate(equations.charts, 1):
        emitted += [(chart, own) for own in in_chart(equations, chosen, chart, number)]
    kept = tuple(enforcements or ()) if simulates else ()
    return Contents(tuple(emitted), loops, simulates, kept)


def _names(functions: Sequence[Function]) -> list[str]:
    return [function.name for function in functions]


def spelled_out(integrators: Sequence[str]) -> tuple[str, ...]:
    """With what `auto` stands for."""
    names = [name for word in integrators for name in (AUTOMATIC if word == AUTO else (word,))]
    return tuple(dict.fromkeys(names))


def watched_functions(equations: Equations) -> list[str]:
    """Pivots that can vanish, and by what to tell whether the constraints or the choice fail
    then; kinks and events."""
    known = [request.name for request in equations.requests]
    guarded = any("guards" in _requested(chart) for chart in (equations, *equations.charts))
    events = [function.name for function in equations.functions if function.name == "events"]
    steps = [x for x in ("guards", "constraint_rows") if guarded and x in known]
    return [*steps, *(x for x in ("kinks",) if x in known), *events]


def _requested(equations: Equations) -> list[str]:
    return [request.name for request in equations.requests]


def chart_suffix(number: int) -> str:
    return f"{CHART}{number}" if number else ""


def for_charts(equations: Equations) -> list[str]:
    """What carries a state from one chart, or frame, to another, and tells how good it is where it
    has something to tell."""
    known = [request.name for request in equations.requests]
    return ["velocity", "state", *(name for name in ("guards",) if name in known)]


def in_chart(
    first: Equations, chosen: Sequence[Function], chart: Equations, number: int
) -> list[Function]:
    """The functions of a further chart: those of the first that depend on the chart, and its own
    guards."""
    known = {function.name for function in chart.functions}
    wanted = dict.fromkeys([*(function.name for function in chosen), *for_charts(chart)])
    varying = {function.name for function in chosen if differs(first, function)}
    own = selection(chart, [name for name in wanted if name in known or request_of(chart, name)])
    where = f"; chart {number}, {chart.choice}"
    return [
        replace(
            function, name=f"{function.name}{chart_suffix(number)}", about=function.about + where
        )
        for function in own
        if function.name in varying or differs(chart, function)
    ]


def integrator_needs(integrators: Sequence[str]) -> list[str]:
    """The functions that integrators call beside `dynamics`."""
    known = {integrator.name: integrator for integrator in INTEGRATORS}
    for name in integrators:
        if name not in known:
            raise HamelError(f"unknown integrator {name!r}; known: {', '.join(known)}")
    return list(dict.fromkeys(need for name in integrators for need in known[name].needs))


def check_jacobian(equations: Equations, needs: Sequence[str]) -> None:
    """Before it is derived, which takes minutes for what is too large."""
    states = len(equations.argument("x").labels)
    if JACOBIAN in needs:
        _refuse_large(JACOBIAN, states**2)


def check_size(chosen: Sequence[Function]) -> None:
    """Jacobians are worked on in place, on the stack: refuse those that would not fit there."""
    for function in chosen:
        _refuse_large(function.name, function.result.size)


def _refuse_large(name: str, entries: int) -> None:
    if entries > MOST_ON_STACK:
        raise AssumptionError(
            f"{name} has {entries} entries, too many to solve with on the stack",
            "an explicit integrator and the enforcement projection or none have no such limit, nor "
            "have scipy_radau and cvodes in `hamel simulate`",
        )


def enforcement_needs(equations: Equations, enforcements: Sequence[str]) -> list[str]:
    return [
        need
        for enforcement in ENFORCEMENTS
        if enforcement.name in enforcements
        for need in enforcement.needs(equations)
    ]


def usual_enforcements(chosen: Sequence[Function]) -> tuple[str, ...]:
    return (
        ("projection", "none")
        if any(function.name == "project" for function in chosen)
        else ("none",)
    )


def selection(
    equations: Equations, names: Sequence[str] | None, roll: str = NEVER
) -> list[Function]:
    """The functions asked for, and those that loops asked for call; those with an empty result have
    no code. What are default functions of a long mechanism depends on what is rolled."""
    default = {function.name: function for function in equations.functions}
    links = len(equations.system.links)
    usual = [name for name, function in default.items() if _is_usual(function, roll, links)]
    loops = {request.name: request.needs for request in equations.requests if request.needs}
    asked = names or ("default",)
    wanted = [n for name in asked for n in (usual if name == "default" else (name,))]
    needed = [n for name in wanted for n in loops.get(name, (name,))]
    chosen = [_function(equations, default, name) for name in dict.fromkeys(needed)]
    return [function for function in chosen if function.result.size]


def _is_usual(function: Function, roll: str, links: int) -> bool:
    """What grows with a long mechanism has to be asked for, unless it is a loop; so has a large
    matrix, whose entries grow with the square."""
    if _is_large_matrix(function.result):
        return False
    always = function.result.written or function.name == "dynamics"
    return always or refusal(function, roll, links) is None


def _is_large_matrix(result: Result) -> bool:
    return result.size > MOST_ENTRIES and result.written and result.value.size2() > 1


def _function(equations: Equations, default: dict[str, Function], name: str) -> Function:
    """The function of that name, made now where it stands among the requests."""
    if name in default:
        return default[name]
    request = request_of(equations, name)
    if request is None:
        raise unknown_function(equations, name)
    return request.function


def loops_asked(equations: Equations, names: Sequence[str] | None) -> tuple[Request, ...]:
    """What was asked for and is a loop around other functions."""
    return tuple(r for r in equations.requests if r.needs and r.name in (names or ()))
