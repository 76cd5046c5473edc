"""Series of tasks on an executor: one that takes too long ends with its process, and the work goes
on in another."""

from __future__ import annotations

import faulthandler
import math
import os
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from typing import Any, Literal

from derive.diagnostics import HamelError
from hamel.engines import Engine

Value = dict[str, Any]


@dataclass(frozen=True)
class Task:
    """A call of a function of a module. After `limit` seconds its process is ended; `subject` is
    for whoever gets the outcome."""

    function: Callable[..., Value]
    arguments: Mapping[str, Any]
    limit: float
    subject: Any = None


@dataclass(frozen=True)
class Outcome:
    """What a task returned, as JSON has it, or why it returned nothing."""

    task: Task
    status: Literal["done", "refused", "too long", "died"]
    value: Value
    reason: str = ""


@dataclass(frozen=True)
class _Run:
    """A task on its way since `begin`, and what follows it."""

    task: Task
    rest: deque[Task]
    begin: float


def outcomes(
    by: Engine,
    series: Iterable[Iterable[Task]],
    is_last: Callable[[Outcome], bool] = lambda outcome: False,
    until: Callable[[], float] = lambda: math.inf,
) -> Generator[Outcome, None, None]:
    """As they come. The tasks of a series run one after the other, several series side by side;
    after an outcome that `is_last` the rest of its series is left out. There are none later than
    `until`, in seconds of time.monotonic(), which is asked again and again.

    Whoever wants no more closes the iterator: what is under way ends then, as it does at the end
    of the time.
    """
    waiting = deque(deque(tasks) for tasks in series)
    running: dict[Future[Any], _Run] = {}
    try:
        while (waiting or running) and (left := until() - time.monotonic()) > 0.0:
            while waiting and len(running) < by.width():
                _begin(by, waiting.popleft(), running)
            timeout = left if left < math.inf else None
            for future in wait(running, timeout, FIRST_COMPLETED).done:
                run = running.pop(future)
                outcome = _outcome(by, run, future)
                if not is_last(outcome):
                    _begin(by, run.rest, running)
                yield outcome
    finally:
        for future in running:
            by.end(future)


def _begin(by: Engine, tasks: deque[Task], running: dict[Future[Any], _Run]) -> None:
    """The next task of a series, where there is one."""
    if tasks:
        task = tasks.popleft()
        future = by.executor.submit(answer, task.function, task.arguments, task.limit)
        running[future] = _Run(task, tasks, time.monotonic())


def _outcome(by: Engine, run: _Run, future: Future[Any]) -> Outcome:
    try:
        value, reason = future.result()
    except by.lost:
        if time.monotonic() - run.begin >= run.task.limit:
            return Outcome(run.task, "too long", {})
        return Outcome(run.task, "died", {}, "its process ended unexpectedly")
    return Outcome(run.task, "refused" if reason else "done", value, reason)


def answer(
    function: Callable[..., Value], arguments: Mapping[str, Any], limit: float
) -> tuple[Value, str]:
    """In a worker: the value, or the reason why there is none. A watchdog outside of Python ends
    the process after the limit, whatever it is at."""
    with open(os.devnull, "w") as nobody:
        faulthandler.dump_traceback_later(limit, exit=True, file=nobody)
        try:
            return _plain(function(**arguments)), ""
        except HamelError as error:
            return {}, error.diagnostics[0].message
        except Exception as error:
            return {}, f"internal error: {type(error).__name__}: {error}".splitlines()[0]
        finally:
            faulthandler.cancel_dump_traceback_later()


def _plain(value: Any) -> Any:
    """Infinite and undefined numbers as None, sequences as lists."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value
