"""Work done in a second process while the first goes on.

The model is read while the first process imports what derives, templates are prepared while it derives, and the derivation is
written while the module is compiled and verified.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

FORKS = sys.platform == "linux"  # elsewhere forking a process that has loaded numerical libraries is not safe
T = TypeVar("T")


@contextmanager
def meanwhile(work: Callable[[], T], niceness: int = 2) -> Iterator[Callable[[], T]]:
    """Start `work` in a copy of this process, which sees everything computed so far; yields a function that waits for its result.

    What goes wrong in the copy is simply done again here, where it can be reported. `niceness`: of a result that is not waited
    for longest.
    """
    if not FORKS or threading.active_count() > 1:  # another thread may hold a lock, which the copy would wait for in vain
        yield work
        return
    from multiprocessing import get_context

    context = get_context("fork")
    receive, send = context.Pipe(duplex=False)
    child = context.Process(target=_send, args=(work, send, niceness), daemon=True)
    child.start()
    send.close()
    try:
        yield lambda: _received(receive, work)
    finally:
        child.kill()
        child.join()


def _send(work: Callable[[], Any], send: Any, niceness: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first process decides what an interrupt ends
    os.nice(niceness)
    try:
        send.send(work())
    except BaseException:
        os._exit(1)


def _received(receive: Any, work: Callable[[], T]) -> T:
    try:
        return receive.recv()
    except EOFError:
        return work()
