"""The chunks of a sweep through an executor, each written as soon as it is there."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field

import hamel
from derive.diagnostics import AssumptionError, HamelError, ToolchainError
from hamel.engines import Engine
from hamel.sweep.folder import GROUP, RESUME, Folder
from hamel.sweep.job import payload
from hamel.sweep.limits import AHEAD, LOOK, TRIES
from hamel.sweep.plan import Plan
from hamel.sweep.work import Answer, Task, remember, work


@dataclass
class Progress:
    """What is known so far. `done` and `failed` count motions, of earlier runs too where known."""

    size: int
    done: int = 0
    failed: int = 0
    chunks: int = 0  # made now
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
    done = folder.done()
    packs = [payload(job) for job in plan.jobs]
    names, data = [name for name, _ in packs], [content for _, content in packs]
    known = sum(_count(plan, chunk) for chunk in done if chunk < plan.chunks)
    here = _Running(
        plan, engine, folder, names, data, bound, told, Progress(plan.design.size, known)
    )
    if engine.shared:
        here.progress.notes |= {
            note for name, job in zip(names, plan.jobs) if (note := remember(name, job))
        }
    missing = (chunk for chunk in range(plan.chunks) if chunk not in done)
    waiting = Counter(chunk // GROUP for chunk in done if chunk < plan.chunks)
    _follow(here, missing, waiting)
    if plan.asked.reduce:
        for group in range(-(-plan.chunks // GROUP)):
            folder.gather(group, plan.chunks)
    return here.progress


def _count(plan: Plan, chunk: int) -> int:
    """Motions of a chunk."""
    first, last = plan.jobs[chunk // plan.per_job].span(chunk % plan.per_job)
    return last - first


def _follow(here: _Running, missing: Iterator[int], ready: Counter[int]) -> None:
    """Until nothing is missing."""
    running: dict[Future[Answer], int] = {}
    again: list[int] = []
    try:
        while True:
            for chunk in itertools.chain(_taken(again), missing):
                future = _submitted(here, chunk)
                running[future] = chunk
                if len(running) >= AHEAD * here.engine.width():
                    break
            if not running:
                return
            finished = wait(running, timeout=LOOK, return_when=FIRST_COMPLETED).done
            if not finished and here.engine.gone():
                raise _gone(here)
            for future in finished:
                chunk = running.pop(future)
                if not _took(here, chunk, future):
                    again.append(chunk)
                    continue
                ready[chunk // GROUP] += 1
                _gather(here, chunk // GROUP, ready)
    finally:
        for future in running:
            future.cancel()


def _taken(again: list[int]) -> Iterator[int]:
    while again:
        yield again.pop()


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


def _took(here: _Running, chunk: int, future: Future[Answer]) -> bool:
    """The answer is written; False where the chunk has to be made again."""
    try:
        answer = future.result()
    except here.engine.lost as error:
        if here.engine.gone():
            raise _gone(here) from None
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
        return False
    here.folder.write(here.folder.chunk_name(chunk), answer.content)
    _count_in(here, answer)
    return True


def _lost(here: _Running, chunk: int, error: BaseException) -> bool:
    if here.engine.gone():
        raise _gone(here) from None
    here.tries[chunk] += 1
    here.progress.lost += 1
    if here.tries[chunk] > TRIES:
        raise ToolchainError(
            f"chunk {chunk} lost its worker {TRIES} times: {type(error).__name__}",
            f"a smaller --chunk takes less memory; {RESUME}",
        )
    return False


def _count_in(here: _Running, answer: Answer) -> None:
    progress = here.progress
    progress.done += answer.count
    progress.failed += answer.failed
    progress.chunks += 1
    progress.bytes += len(answer.content)
    progress.seconds += answer.seconds
    if answer.note:
        progress.notes.add(answer.note)
    progress.reasons = sorted({*progress.reasons, *answer.reasons})[:3]
    here.told(progress)
    if progress.failed > here.bound:
        reasons = "; ".join(f"motion {number}: {why}" for number, why in progress.reasons)
        raise AssumptionError(
            f"{progress.failed} of {progress.done} motions failed, more than the {here.bound} that "
            f"may: {reasons}",
            "other ranges, or --failures with a larger part",
        )


def _gather(here: _Running, group: int, ready: Counter[int]) -> None:
    """Without rows, a finished group becomes one file."""
    if not here.plan.asked.reduce:
        return
    if ready[group] == min(here.plan.chunks, (group + 1) * GROUP) - group * GROUP:
        here.folder.gather(group, here.plan.chunks)


def _gone(here: _Running) -> ToolchainError:
    return ToolchainError(
        f"{here.engine.about} does not answer any more; {here.progress.done} of "
        f"{here.progress.size} motions are in {here.folder.place}",
        RESUME,
    )
