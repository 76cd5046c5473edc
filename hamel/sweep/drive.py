"""The chunks of a sweep through an executor, each written as soon as it is there, by threads of
their own: no worker waits for a disk."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from typing import Any

import hamel
from derive.diagnostics import AssumptionError, HamelError, ToolchainError, counted
from hamel.engines import Engine
from hamel.sweep.folder import Folder
from hamel.sweep.job import payload
from hamel.sweep.limits import AHEAD, GROUP, LOOK, TRIES, WAITING, WRITERS
from hamel.sweep.places import RESUME
from hamel.sweep.plan import Plan
from hamel.sweep.work import Answer, Task, remember, work


@dataclass
class Progress:
    """What is known so far. `done` and `failed` count motions, of earlier runs too where known."""

    size: int
    done: int = 0
    failed: int = 0
    chunks: int = 0  # made now
    motions: int = 0  # in them
    lost: int = 0  # workers that ended with a chunk
    bytes: int = 0
    seconds: float = 0.0  # in workers
    reasons: list[tuple[int, str]] = field(default_factory=list)
    notes: set[str] = field(default_factory=set)


@dataclass
class _Running:
    plan: Plan
    engine: Engine
    folder: Folder
    names: list[str]  # of the jobs
    data: list[bytes]
    bound: int  # failures that are one too many
    told: Callable[[Progress], None]
    progress: Progress
    tries: Counter[int] = field(default_factory=Counter)
    sent: Counter[int] = field(default_factory=Counter)
    again: list[int] = field(default_factory=list)  # chunks that lost their worker
    running: dict[Future[Any], int] = field(default_factory=dict)  # chunks in work
    writing: dict[Future[Any], tuple[int, Answer]] = field(default_factory=dict)
    gathering: set[Future[Any]] = field(default_factory=set)
    ended: SimpleQueue[Future[Any]] = field(default_factory=SimpleQueue)

    def follow(self, future: Future[Any]) -> Future[Any]:
        """It says by itself when it has ended: to look at those of a thousand workers in turn would
        take longer than their answers."""
        future.add_done_callback(self.ended.put)
        return future

    @property
    def has_room(self) -> bool:
        """Whether more may be handed out: what keeps all busy, and can be written meanwhile."""
        most = AHEAD * self.engine.width()
        return len(self.running) < most and len(self.writing) < max(most, WAITING)


def driven(
    plan: Plan,
    engine: Engine,
    folder: Folder,
    bound: int,
    told: Callable[[Progress], None] = lambda progress: None,
) -> Progress:
    """Make what is missing, and say after every chunk how far it is.

    Raises AssumptionError where more than `bound` motions failed, ToolchainError where the engine
    is gone or nothing can be written; what is finished stays in the folder.
    """
    done = folder.done(plan.chunks)
    packs = [payload(job) for job in plan.jobs]
    names, data = [name for name, _ in packs], [content for _, content in packs]
    known = sum(_count(plan, chunk) for chunk in done)
    here = _Running(
        plan, engine, folder, names, data, bound, told, Progress(plan.design.size, known)
    )
    if engine.shared:
        here.progress.notes |= {
            note for name, job in zip(names, plan.jobs) if (note := remember(name, job))
        }
    missing = (chunk for chunk in range(plan.chunks) if chunk not in done)
    waiting = Counter(chunk // GROUP for chunk in done)
    with ThreadPoolExecutor(WRITERS) as writers:
        _follow(here, missing, waiting, writers)
    if plan.asked.reduce:
        folder.gather_left(plan.chunks)
    return here.progress


def _count(plan: Plan, chunk: int) -> int:
    """Motions of a chunk."""
    first, last = plan.jobs[chunk // plan.per_job].span(chunk % plan.per_job)
    return last - first


def _follow(here: _Running, missing: Iterator[int], ready: Counter[int], writers: Executor) -> None:
    """Until nothing is missing, and all is written."""
    try:
        while True:
            _hand_out(here, missing)
            if not (here.running or here.writing or here.gathering):
                return
            for future in _ended(here):
                _went_on(here, future, ready, writers)
    finally:
        for future in here.running:
            future.cancel()


def _hand_out(here: _Running, missing: Iterator[int]) -> None:
    while here.has_room:
        chunk = here.again.pop() if here.again else next(missing, None)
        if chunk is None:
            return
        here.running[here.follow(_submitted(here, chunk))] = chunk


def _ended(here: _Running) -> list[Future[Any]]:
    """What has ended since the last look; none after a while in which nothing did."""
    try:
        ended = [here.ended.get(timeout=LOOK)]
    except Empty:
        if here.engine.gone():
            raise _gone(here) from None
        return []
    while not here.ended.empty():
        ended.append(here.ended.get())
    return ended


def _went_on(here: _Running, future: Future[Any], ready: Counter[int], writers: Executor) -> None:
    """Work is followed by writing, the last writing of a group by putting it together."""
    if future in here.running:
        chunk = here.running.pop(future)
        answer = _answer(here, chunk, future)
        if answer is None:
            here.again.append(chunk)
            return
        name = here.folder.chunk_name(chunk)
        written = writers.submit(here.folder.write, name, answer.content)
        here.writing[here.follow(written)] = chunk, answer
        return
    here.gathering.discard(future)
    future.result()
    if future in here.writing:
        chunk, answer = here.writing.pop(future)
        _count_in(here, answer)
        group = chunk // GROUP
        ready[group] += 1
        if here.plan.asked.reduce and ready[group] == _whole(here, group):
            gathered = writers.submit(here.folder.gather, group, here.plan.chunks)
            here.gathering.add(here.follow(gathered))


def _whole(here: _Running, group: int) -> int:
    """How many chunks it has."""
    return min(here.plan.chunks, (group + 1) * GROUP) - group * GROUP


def _submitted(here: _Running, chunk: int) -> Future[Answer]:
    """The job goes along with the first tasks, and wherever it was asked for."""
    job, number = divmod(chunk, here.plan.per_job)
    fresh = not here.engine.shared and here.sent[job] < here.engine.width()
    asked = here.tries[chunk] > 0
    here.sent[job] += 1
    data = here.data[job] if fresh or asked else None
    task = Task(hamel.__version__, here.names[job], number, data)
    try:
        return here.engine.executor.submit(work, task)
    except here.engine.lost:
        raise _gone(here) from None
    except RuntimeError as error:  # what an executor says that was shut down
        raise _gone(here) from error


def _answer(here: _Running, chunk: int, future: Future[Answer]) -> Answer | None:
    """None where the chunk has to be made again."""
    try:
        answer = future.result()
    except here.engine.lost as error:
        return _lost(here, chunk, error)
    except HamelError:
        raise
    except ModuleNotFoundError as error:
        raise ToolchainError(
            f"the workers cannot import what they need: {error}",
            "hamel[cluster] of the same version on all machines",
        ) from None
    except OSError as error:
        if here.engine.gone() or here.engine.shared is False:
            return _lost(here, chunk, error)
        raise
    if answer.missing:
        here.tries[chunk] += 1
        return None
    return answer


def _lost(here: _Running, chunk: int, error: BaseException) -> None:
    """Counts it. Raises ToolchainError where the engine is gone, or this happens too often."""
    if here.engine.gone():
        raise _gone(here) from None
    here.tries[chunk] += 1
    here.progress.lost += 1
    if here.tries[chunk] > TRIES:
        raise ToolchainError(
            f"chunk {chunk} lost its worker {TRIES} times: {type(error).__name__}",
            f"a smaller --chunk takes less memory; {RESUME}",
        )


def _count_in(here: _Running, answer: Answer) -> None:
    progress = here.progress
    progress.done += answer.count
    progress.failed += answer.failed
    progress.chunks += 1
    progress.motions += answer.count
    progress.bytes += len(answer.content)
    progress.seconds += answer.seconds
    if answer.note:
        progress.notes.add(answer.note)
    progress.reasons = sorted({*progress.reasons, *answer.reasons})[:3]
    here.told(progress)
    if progress.failed > here.bound:
        raise _failed(progress, here.bound)


def _failed(progress: Progress, bound: int) -> AssumptionError:
    """More motions than may."""
    reasons = "; ".join(f"motion {number}: {why}" for number, why in progress.reasons)
    so_far = "" if progress.done == progress.size else " so far"
    most = f"only {bound} of {progress.size}" if bound else "none"
    return AssumptionError(
        f"{progress.failed} of {counted(progress.done, 'motion')} failed{so_far}, and {most} may: "
        f"{reasons}",
        "other ranges, or a larger part of all with --failures",
    )


def _gone(here: _Running) -> ToolchainError:
    return ToolchainError(
        f"{here.engine.about} does not answer any more; {here.progress.done} of "
        f"{here.progress.size} motions are in {here.folder.place}",
        RESUME,
    )
