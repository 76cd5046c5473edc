"""Work done in a second process while the first goes on.

The model is read while the first process imports what derives, templates are prepared while it
derives, and the derivation is written while the module is compiled and verified.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, NoReturn, TypeVar

FORKS = (
    sys.platform == "linux"
)  # elsewhere forking a process that has loaded numerical libraries is not safe
T = TypeVar("T")


@contextmanager
def meanwhile(work: Callable[[], T], niceness: int = 1) -> Iterator[Callable[[], T]]:
    """Start `work` in a copy of this process, which sees everything computed so far; yields a
    function that waits for its result.

    What goes wrong in the copy is simply done again here, where it can be reported. `niceness`: of
    a result that is not waited for longest. Made of fork and a pipe, for the copy is needed before
    `multiprocessing` would be imported.
    """
    if (
        not FORKS or threading.active_count() > 1
    ):  # another thread may hold a lock, which the copy would wait for in vain
        yield work
        return
    receive, send = os.pipe()
    child = os.fork()
    if not child:
        _send(work, send, niceness)
    os.close(send)
    with os.fdopen(receive, "rb") as pipe:
        try:
            yield lambda: _received(pipe, work)
        finally:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)


def _send(work: Callable[[], Any], place: int, niceness: int) -> NoReturn:
    """Ends this process, whatever happens; what the first one had not written yet is not written
    twice."""
    with suppress(BaseException):
        signal.signal(
            signal.SIGINT, signal.SIG_IGN
        )  # the first process decides what an interrupt ends
        os.nice(niceness)
        with os.fdopen(place, "wb") as pipe:
            pickle.dump(work(), pipe)
    os._exit(0)


def _received(pipe: Any, work: Callable[[], T]) -> T:
    try:
        return pickle.load(pipe)
    except (EOFError, pickle.UnpicklingError):
        return work()
