"""Tasks on a pool of processes: one that takes too long ends with its process, and the work goes on
in a new one."""

from __future__ import annotations

import math
import os
import sys
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, TimeoutError, wait
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.context import SpawnContext, SpawnProcess
from types import ModuleType
from typing import Any, Literal

from pebble import ProcessExpired, ProcessPool

from derive.diagnostics import HamelError

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


class _Process(SpawnProcess):
    """Without the caller's own script: no task needs it, and it may have no guard against being
    run a second time."""

    def start(self) -> None:
        """As the process starts the caller's script is out of sight: multiprocessing would import
        it again."""
        script = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            super().start()
        finally:
            sys.modules["__main__"] = script


class _Context(SpawnContext):
    Process = _Process


@dataclass(frozen=True)
class Workers:
    """As many processes as `size`."""

    size: int
    processes: ProcessPool


@contextmanager
def workers(size: int) -> Iterator[Workers]:
    """Processes that are started when there is something to do, and ended at the end."""
    processes = ProcessPool(size, initializer=_silence, context=_Context())
    try:
        yield Workers(size, processes)
    finally:
        processes.stop()
        processes.join()


def _silence() -> None:
    """Libraries print to standard output; nobody reads that of a worker."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)


def outcomes(
    by: Workers,
    series: Iterable[Iterable[Task]],
    is_last: Callable[[Outcome], bool] = lambda outcome: False,
) -> Generator[Outcome, None, None]:
    """As they come. The tasks of a series run one after the other, several series side by side;
    after an outcome that `is_last` the rest of its series is left out.

    Whoever wants no more closes the iterator: what is under way ends then.
    """
    waiting = deque(deque(tasks) for tasks in series)
    running: dict[Future[Any], tuple[Task, deque[Task]]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < by.size:
                _begin(by, waiting.popleft(), running)
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                task, rest = running.pop(future)
                outcome = _outcome(task, future)
                if not is_last(outcome):
                    _begin(by, rest, running)
                yield outcome
    finally:
        for future in running:
            future.cancel()


def _begin(
    by: Workers,
    tasks: deque[Task],
    running: dict[Future[Any], tuple[Task, deque[Task]]],
) -> None:
    """The next task of a series, where there is one."""
    if tasks:
        task = tasks.popleft()
        call = (task.function, task.arguments)
        future = by.processes.schedule(_answer, call, timeout=task.limit)
        running[future] = task, tasks


def _outcome(task: Task, future: Future[Any]) -> Outcome:
    try:
        value, reason = future.result()
    except TimeoutError:
        return Outcome(task, "too long", {})
    except (ProcessExpired, CancelledError):
        return Outcome(task, "died", {}, "its process ended unexpectedly")
    return Outcome(task, "refused" if reason else "done", value, reason)


def _answer(function: Callable[..., Value], arguments: Mapping[str, Any]) -> tuple[Value, str]:
    """In a worker: the value, or the reason why there is none."""
    try:
        return _plain(function(**arguments)), ""
    except HamelError as error:
        return {}, error.diagnostics[0].message
    except Exception as error:
        return {}, f"internal error: {type(error).__name__}: {error}".splitlines()[0]


def _plain(value: Any) -> Any:
    """Infinite and undefined numbers as None, sequences as lists."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value
