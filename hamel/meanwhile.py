"""Work done in a second process while the first goes on: the derivation is written while the module is compiled and verified."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

FORKS = sys.platform == "linux"  # elsewhere forking a process that has loaded numerical libraries is not safe


@contextmanager
def meanwhile(work: Callable[[], str]) -> Iterator[Callable[[], str]]:
    """Start `work` in a copy of this process, which sees everything computed so far; yields a function that waits for its text.

    What goes wrong in the copy is simply done again here, where it can be reported.
    """
    if not FORKS:
        yield work
        return
    from multiprocessing import get_context

    context = get_context("fork")
    receive, send = context.Pipe(duplex=False)
    child = context.Process(target=_send, args=(work, send), daemon=True)
    child.start()
    send.close()
    try:
        yield lambda: _received(receive) or work()
    finally:
        child.kill()
        child.join()


def _send(work: Callable[[], str], send: Any) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first process decides what an interrupt ends
    os.nice(5)  # the compiler is waited for longest
    try:
        send.send(work())
    except BaseException:
        os._exit(1)


def _received(receive: Any) -> str:
    try:
        return receive.recv()
    except EOFError:
        return ""
