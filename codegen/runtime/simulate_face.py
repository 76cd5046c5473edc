"""The face of `simulate`: what its arguments mean for a model, and what is refused.

The same file in every generated folder. No claim of licence is made on it: 0BSD, see LICENSE.txt.
"""

import functools
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from .error import coarser, estimate, rows, until_events
from .events import Watch
from .inputs import Callback, Feed, Source, Table, check_cover, check_names, filled, source
from .many_motions import many
from .model_facts import Facts, Method
from .one_motion import Backend, Integration, controlled, follow
from .simulation import Simulation, Status, Stopped

TIMES = "simulate() needs finite times that do not decrease"
SERIES = "taylor"  # rounding of its high terms may make steps too small where others go on
BEYOND_END = 1e-6  # of the end: what output times may be beyond it, for they are rounded


@dataclass(frozen=True)
class Request:
    """The arguments of simulate() of the package, by their names."""

    t_span: Any
    x: Any
    u: Any
    p: Any
    rtol: float
    atol: float
    times: Any
    max_steps: int
    progress: Any
    integrator: str | None = None
    enforcement: str | None = None
    step_size: float | None = None
    sample: Any = None
    chart: int = 0
    threads: int = 1
    events: Any = None
    error: bool = False


def run(facts: Facts, backend: Backend, request: Request) -> Simulation:
    """The motion that was asked for, or many. Raises Stopped, ValueError, TypeError."""
    automatic = request.integrator == "auto"
    if automatic:
        request = replace(request, integrator=_automatic(facts, request))
    try:
        found, remarks = _found(facts, backend, request)
    except Stopped as stopped:
        short = stopped.partial.status == Status.STEP_TOO_SMALL
        if not (automatic and short and request.integrator == SERIES):
            raise
        request = replace(request, integrator=_explicit(facts, request))
        found, remarks = _found(facts, backend, request)
    for remark in remarks:  # for who called simulate() of the package
        warnings.warn(remark, RuntimeWarning, stacklevel=4)
    if not request.error:
        return found
    method = facts.methods[facts.integrators.index(found.integrator)]
    companion = _companion(facts, backend, request, found, method)
    equal = request.step_size is not None
    apart = estimate(found, companion, method.order, request.rtol, equal)
    if facts.frame:
        apart[..., facts.nq :] = np.nan  # w is along directions of each motion's own
    return replace(found, error=apart)


def _companion(
    facts: Facts, backend: Backend, request: Request, found: Simulation, method: Method
) -> Simulation:
    """A coarser motion, to be compared with the one that was found."""
    rtol, atol, step_size = coarser(request.rtol, request.atol, request.step_size, method.order)
    coarse = replace(request, rtol=rtol, atol=atol, step_size=step_size, events=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of motions that the caller does not see
        try:
            asked = replace(coarse, times=rows(until_events(found)), progress=None)
            return _found(facts, backend, asked)[0]
        except Stopped as stopped:
            return stopped.partial


def _automatic(facts: Facts, request: Request) -> str:
    """An integrator for that tolerance: for one motion its series where these are short, else an
    explicit method."""
    smooth = request.sample is not None or not callable(request.u)
    usual = request.step_size is None and request.enforcement not in facts.staged
    short = request.rtol <= facts.limits.series
    if smooth and usual and short and _is_one(request):
        return SERIES
    return _explicit(facts, request)


def _explicit(facts: Facts, request: Request) -> str:
    wanted = "verner9" if request.rtol <= facts.limits.tight else "dop853"
    return wanted if wanted in facts.integrators else facts.integrators[0]


def _is_one(request: Request) -> bool:
    """Is it one motion, as far as leading axes tell?"""
    for given in (request.t_span, request.times, request.x, request.u, request.p):
        mapping = isinstance(given, dict)  # of names to single values, no rows
        values = cast(dict[str, Any], given).values() if mapping else [given]
        numbers = [value for value in values if not isinstance(value, Table)]
        if any(np.ndim(value) > (0 if mapping else 1) for value in numbers):
            return False
    return True


def _number(kind: str, name: str | None, known: Sequence[str]) -> int:
    """The number of what is called so; the first where no name is given."""
    if name is not None and name not in known:
        raise ValueError(f"simulate() has no {kind} {name!r} here; it has {', '.join(known)}")
    return 0 if name is None else known.index(name)


def _explained(error: ValueError, given: Mapping[str, Any], t: np.ndarray) -> ValueError:
    """Which arguments do not go together, where that is what is wrong."""
    if "broadcast" not in str(error):
        return error
    axes = {name: np.shape(value)[:-1] for name, value in given.items()} | {"t": t.shape[:-1]}
    said = ", ".join(f"{name} {shape}" for name, shape in axes.items() if shape)
    return ValueError(f"simulate() needs leading axes that broadcast together, got {said}")


def _check_numbers(request: Request) -> None:
    """Raises TypeError of an argument that is to be a number and is none."""
    for name in ("rtol", "atol", "max_steps", "threads", "step_size"):
        value = getattr(request, name)
        whole = name in ("max_steps", "threads")
        fits = np.ndim(value) == 0 and np.asarray(value).dtype.kind in ("iu" if whole else "iuf")
        if not (fits or (value is None and name == "step_size")):
            kind = "whole number" if whole else "number"
            raise TypeError(f"simulate() needs a {kind} as {name}, got {value!r}")


def _found(facts: Facts, backend: Backend, request: Request) -> tuple[Simulation, list[str]]:
    """Motions, and what there is to say about them."""
    _check_numbers(request)
    if request.threads < 1:
        raise ValueError(f"simulate() needs one thread or more, got threads={request.threads}")
    start, t = _times(facts, request)
    method, how = _how(facts, request)
    inputs = _source(facts, request, method, start, t[..., -1])
    p = _parameters(facts, request.p)
    try:
        given, lead = facts.shared.prepare(
            "dynamics", start, request.x, inputs.constant, p, "simulate"
        )
        lead = np.broadcast_shapes(lead, t.shape[:-1], inputs.lead)
    except ValueError as error:
        raise _explained(error, {"x": request.x, "u": inputs.constant, "p": p}, t) from None
    by = Integration(
        facts,
        backend,
        how,
        (request.rtol, request.atol),
        request.max_steps,
        request.progress,
        _feed(facts, inputs, request.sample, lead),
        request.threads,
        _watch(facts, request.events),
    )
    asked = (inputs.function, request.sample)
    if lead:
        arrays = {"t0": given[0], "times": t, "x": given[1], "u": given[2], "p": given[3]}
        return many(by, arrays, lead, asked), by.remarks
    u, p = (np.ascontiguousarray(value) for value in given[2:])
    if request.sample is None:
        return follow(by, start, given[1], t, (u, p)), by.remarks
    return controlled(by, start, given[1], t, p, asked), by.remarks


def _times(facts: Facts, request: Request) -> tuple[np.ndarray, np.ndarray]:
    """Where motions start, and their output times."""
    span = facts.shared.real("simulate", "t_span", request.t_span)
    times = request.times
    t = np.ascontiguousarray(
        span if times is None else facts.shared.real("simulate", "times", times)
    )
    if not span.ndim or not span.shape[-1] or not t.ndim or not t.shape[-1]:
        raise ValueError(TIMES)
    start = span[..., 0]
    decreasing = (t[..., 1:] < t[..., :-1]).any() or (t[..., 0] < start).any()
    if decreasing or not (np.isfinite(t).all() and np.isfinite(start).all()):
        raise ValueError(TIMES)
    end, last = span[..., -1], t[..., -1]
    if (
        span.shape[-1] > 1
        and (last > end + BEYOND_END * np.maximum(np.abs(end), np.abs(last))).any()
    ):
        raise ValueError(
            f"simulate() needs times up to the end of t_span, {np.max(end)}, got {np.max(last)}"
        )
    return start, t


def _how(facts: Facts, request: Request) -> tuple[Method, Mapping[str, Any]]:
    """The integrator, and the entries of a simulation at its start."""
    step_size = request.step_size
    if not (request.rtol > 0 and request.atol > 0):
        raise ValueError("simulate() needs tolerances above zero")
    if step_size is not None and not 0 < step_size < np.inf:
        raise ValueError("simulate() needs a step_size above zero")
    number = _number("integrator", request.integrator, facts.integrators)
    enforcement = _number("enforcement", request.enforcement, facts.enforcements)
    method, name = facts.methods[number], facts.enforcements[enforcement]
    if step_size is None and method.stepped:
        raise ValueError(
            f"simulate() needs a step_size for {method.name}, which has no step control"
        )
    if method.exact and name in facts.staged:
        raise ValueError(
            f"simulate(): {method.name} does not fit the enforcement {name}, which acts at every "
            "stage"
        )
    how = {"integrator": number, "enforcement": enforcement, "step_size": step_size or 0.0}
    return method, {**how, "choice": request.chart} if facts.charts else how


def _source(facts: Facts, request: Request, method: Method, start: Any, end: Any) -> Source:
    """The inputs as they are asked for, if they can be."""
    inputs = source(request.u, facts.inputs, _reals(facts, "u"))
    check_cover(inputs.tables, facts.inputs, start, end)
    if request.sample is not None and inputs.function is None:
        raise ValueError(
            "simulate() has sample times, but no function as u that is to be asked then"
        )
    if inputs.function is not None and request.sample is None and method.exact:
        raise ValueError(
            f"simulate() needs sample times for a function as u with {method.name}, which needs "
            "the exact Jacobian or series"
        )
    return inputs


def _parameters(facts: Facts, p: Any) -> Any:
    """Of a mapping all parameters, those that it does not name at their defaults."""
    if not isinstance(p, Mapping):
        return facts.with_frame(p)
    given = cast(Mapping[str, Any], p)
    check_names("parameter", given, facts.parameters)
    return filled(facts.shared.DEFAULTS, given, facts.parameters, _reals(facts, "p"))


def _reals(facts: Facts, letter: str) -> Callable[[Any], np.ndarray]:
    """Arrays of the module's precision of what is given as that argument."""
    return functools.partial(facts.shared.real, "simulate", letter)


def _watch(facts: Facts, events: Any) -> Watch | None:
    """The events of the model and those that were asked for; None where there are none."""
    if events is False or not (facts.events or events):
        return None
    if not (events is None or isinstance(events, Mapping)):
        raise TypeError(
            f"simulate() needs functions f(t, x) by name as events, or False, got {events!r}"
        )
    given = cast(Mapping[str, Any] | None, events)
    watch = Watch(facts.events, given, facts.nx + facts.frame, facts.real)
    if watch.functions:
        watch.callback = Callback(watch.values, facts.nx, len(watch.functions), facts.real)
    return watch


def _feed(facts: Facts, inputs: Source, sample: Any, lead: tuple[int, ...]) -> Feed | None:
    """Inputs that change within a stretch of the motion; None where they are constant there."""
    if not inputs.changes or sample is not None:
        return None
    function, callback = inputs.function, None
    if function is not None:
        callback = Callback(function, facts.nx, len(facts.inputs), facts.real)
    feed = Feed(inputs, callback, facts.real)
    feed.spread(lead, np.broadcast_shapes(inputs.lead, inputs.constant.shape[:-1]))
    return feed
