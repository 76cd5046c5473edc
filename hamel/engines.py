"""Where work runs: in this process, in processes of this machine, or by dask.distributed; each of
them an Executor of concurrent.futures.

No engine has a say in what is computed, only in where. A function that is submitted is named by its
module, and may end with the process that it runs in: the future then raises one of `lost`, and the
same work can be submitted again.
"""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ThreadPoolExecutor,
)
from dataclasses import dataclass
from typing import Any

from loky.process_executor import ProcessPoolExecutor

from derive.diagnostics import ModelError, ToolchainError

HERE, PROCESSES, LOCAL = "here", "processes", "local"
KNOWN = f"{HERE}, {PROCESSES}, {LOCAL}, or tcp://ADDRESS:PORT"
ANSWERS = 10.0  # s in which a scheduler has to answer
INSTALL = "pip install 'hamel[cluster]'"


@dataclass(frozen=True)
class Engine:
    """An executor, and what is known of it. `width` says how much can run at once, by now; `gone`
    whether nothing will ever be answered any more."""

    executor: Executor
    width: Callable[[], int]
    about: str
    shared: bool  # whether work runs in this very process
    lost: tuple[type[BaseException], ...] = (BrokenExecutor,)
    gone: Callable[[], bool] = lambda: False
    # ends what is under way for nobody, where the engine can
    end: Callable[[Future[Any]], object] = Future.cancel
    link: str = ""  # of a page that shows it at work


def check_engine(name: str | None, workers: int | None = None) -> None:
    """Raises ModelError for a name that is of no engine, and for less than one worker."""
    if workers is not None and workers < 1:
        raise ModelError(f"{workers} workers are asked for", "one or more")
    if not is_engine(name):
        raise ModelError(f"'{name}' is no engine", KNOWN)


def is_engine(name: str | None) -> bool:
    """Whether something may run by that name: one of ours, an address, or a scheduler's file."""
    return name in (None, HERE, PROCESSES, LOCAL) or ":" in str(name) or _is_file(str(name))


def _is_file(name: str) -> bool:
    """Whether a scheduler may have written its address there."""
    return name.endswith(".json")


@contextlib.contextmanager
def engine(name: str | None = None, workers: int | None = None) -> Iterator[Engine]:
    """The engine of that name: here (when None), processes, local, or the address of a scheduler.

    Raises ModelError for a name that is none, ToolchainError where the library is missing or the
    scheduler does not answer.
    """
    check_engine(name, workers)
    size = workers or os.cpu_count() or 1
    if name in (None, HERE):
        with ThreadPoolExecutor(size) as threads:
            yield Engine(threads, lambda: size, f"{size} threads of this process", True)
    elif name == PROCESSES:
        with _terminable(), Processes(size) as processes:
            about = f"{size} processes of this machine"
            yield Engine(processes, lambda: size, about, False, end=processes.end)
    else:
        with _dask(str(name), size) as result:
            yield result


# ---- processes


class Processes(Executor):
    """As many processes as `size`, each on its own: one that ends takes nothing but its own work
    with it, and another takes its place.

    The processes are loky's: they start afresh, and do not run the caller's script again.
    """

    def __init__(self, size: int) -> None:
        # that a process is started anew once it holds much memory is loky's own affair
        warnings.filterwarnings("ignore", category=UserWarning, module=r"loky\.process_executor")
        self.size = size
        self._places: list[ProcessPoolExecutor | None] = [None] * size
        self._load = [0] * size
        self._where: dict[Future[Any], int] = {}

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """To the process that has least to do."""
        place = self._load.index(min(self._load))
        with _uninterrupted():
            try:
                future = self._process(place).submit(fn, *args, **kwargs)
            except BrokenExecutor:  # it ended since its last answer
                self._drop(place)
                future = self._process(place).submit(fn, *args, **kwargs)
        self._load[place] += 1
        self._where[future] = place
        future.add_done_callback(lambda done: self._finished(place, done))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Ends all processes at once: who leaves early wants no more answers."""
        with _uninterrupted():
            for place in range(self.size):
                self._drop(place)

    def _process(self, place: int) -> ProcessPoolExecutor:
        process = self._places[place]
        if process is None:
            process = self._places[place] = ProcessPoolExecutor(1, initializer=_silence)
        return process

    def end(self, future: Future[Any]) -> None:
        """Ends the process that works on it."""
        place = self._where.get(future)
        if place is not None and not future.cancel():
            self._drop(place)

    def _finished(self, place: int, done: Future[Any]) -> None:
        self._load[place] -= 1
        self._where.pop(done, None)
        if not done.cancelled() and isinstance(done.exception(), BrokenExecutor):
            self._places[place] = None

    def _drop(self, place: int) -> None:
        process, self._places[place] = self._places[place], None
        if process is not None:
            process.shutdown(wait=True, kill_workers=True)


@contextlib.contextmanager
def _terminable() -> Iterator[None]:
    """Whoever ends this process by SIGTERM finds the processes ended and what they shared put away,
    as after Ctrl-C. A caller that has plans of its own for the signal keeps them."""
    if not _is_main() or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return

    def leave(number: int, _: Any) -> None:
        sys.exit(128 + number)

    signal.signal(signal.SIGTERM, leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _is_main() -> bool:
    """Whether signals are for this thread."""
    return threading.current_thread() is threading.main_thread()


@contextlib.contextmanager
def _uninterrupted() -> Iterator[None]:
    """Processes that start here inherit that no Ctrl-C and no SIGTERM of their group reaches them:
    this one ends them, and puts away what they share with it. What ends this one waits until they
    have started, or ended."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    late: list[int] = []
    ends = (signal.SIGINT, signal.SIGTERM) if _is_main() else ()
    before = {each: signal.signal(each, lambda number, _: late.append(number)) for each in ends}
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for each, handler in before.items():
            signal.signal(each, handler)
    for number in late[:1]:
        signal.raise_signal(number)


def _silence() -> None:
    """Libraries print to standard output; nobody reads that of a worker."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)


# ---- dask


@contextlib.contextmanager
def _dask(name: str, size: int) -> Iterator[Engine]:
    try:
        import distributed  # a boundary: nobody else pays for what this takes to import
    except ImportError:
        raise ToolchainError(f"the engine '{name}' needs dask.distributed", INSTALL) from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with contextlib.ExitStack() as stack:
        if name == LOCAL:
            cluster = stack.enter_context(_local(distributed, size))
            client = stack.enter_context(distributed.Client(cluster, set_as_default=False))
        else:
            client = stack.enter_context(_connected(distributed, name))
        lost = (BrokenExecutor, distributed.KilledWorker, CancelledError)
        address = client.scheduler.address if client.scheduler else name
        yield Engine(
            client.get_executor(pure=False),
            lambda: _cores(client),
            f"dask at {address}",
            False,
            lost,
            lambda: client.status != "running",
            link=str(client.dashboard_link or ""),
        )


def _cores(client: Any) -> int:
    """Of all workers by now; one while there is none, so that work waits for the first."""
    return max(1, sum(client.ncores().values())) if client.status == "running" else 1


def _local(distributed: Any, size: int) -> Any:
    """Workers that nobody looks into: without dask's samples of their stacks, 100 a second."""
    from dask import config  # a boundary; it comes with distributed

    with config.set({"distributed.worker.profile.enabled": False}):
        return distributed.LocalCluster(
            n_workers=size,
            threads_per_worker=1,
            dashboard_address=None,
            silence_logs=logging.CRITICAL,
        )


@contextlib.contextmanager
def _connected(distributed: Any, name: str) -> Iterator[Any]:
    """A client of the scheduler at an address, or in a file that the scheduler wrote."""
    is_file = _is_file(name)
    if is_file and not os.path.isfile(name):  # it would be waited for, for ever
        raise ToolchainError(
            f"no scheduler has written {name}", f"`dask scheduler --scheduler-file {name}` does"
        )
    place: dict[str, Any] = {"scheduler_file": name} if is_file else {"address": name}
    try:
        client = distributed.Client(**place, timeout=ANSWERS, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        said = " ".join(str(error).split()) or type(error).__name__
        raise ToolchainError(
            f"no scheduler answers at {name}: {said}",
            "`dask scheduler` prints the address of one that runs",
        ) from None
    try:
        yield client
    finally:
        with contextlib.suppress(Exception):  # of a scheduler that is gone
            client.close(timeout=2)
