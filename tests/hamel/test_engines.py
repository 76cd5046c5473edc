"""Where work runs makes no difference to what comes of it.

Of hamel: engines.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import BrokenExecutor
from pathlib import Path
from typing import Any

import pytest

from derive.diagnostics import ModelError, ToolchainError
from hamel.engines import Processes, _uninterrupted, engine
from tests.scenes import ROOT


def test_threads_are_of_this_process() -> None:
    with engine(None, 2) as found:
        assert found.shared and found.width() == 2
        assert found.executor.submit(os.getpid).result() == os.getpid()


def test_a_process_that_ends_takes_only_its_own_work_with_it() -> None:
    with Processes(2) as processes:
        fatal = processes.submit(os._exit, 1)
        others = [processes.submit(abs, -k) for k in range(1, 4, 2)]
        with pytest.raises(BrokenExecutor):
            fatal.result(60)
        assert processes.submit(abs, -5).result(60) == 5
        assert others[0].result(60) == 1


def test_a_script_without_a_guard_is_not_run_again(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "from hamel.engines import engine\n"
        "print('once')\n"
        "with engine('processes', 2) as found:\n"
        "    print(found.executor.submit(abs, -3).result())\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    made = subprocess.run(
        [sys.executable, script], env=environment, capture_output=True, text=True, check=True
    )
    assert made.stdout.split() == ["once", "3"]


@pytest.mark.parametrize("name", ["nowhere", ""])
def test_what_is_no_engine_is_told(name: str) -> None:
    pytest.importorskip("distributed")
    with pytest.raises(ModelError, match="is no engine"), engine(name or "x"):
        pass


def test_no_workers_are_refused() -> None:
    with pytest.raises(ModelError, match="0 workers"), engine("here", 0):
        pass


@pytest.mark.slow
def test_a_scheduler_that_does_not_answer_is_told() -> None:
    pytest.importorskip("distributed")
    with (
        pytest.raises(ToolchainError, match="no scheduler answers at"),
        engine("tcp://127.0.0.1:9"),
    ):
        pass


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="signals are not masked here")
def test_an_interrupt_of_the_terminal_is_for_this_process_alone() -> None:
    """It goes to all in the group: processes that ended by it left their semaphores behind."""
    before = signal.getsignal(signal.SIGINT)
    with engine("processes", 1) as workers:
        blocked = workers.executor.submit(signal.pthread_sigmask, signal.SIG_BLOCK, ())
        assert {signal.SIGINT, signal.SIGTERM} <= blocked.result()
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="signals are not masked here")
def test_an_interrupt_while_processes_start_is_not_lost() -> None:
    with pytest.raises(KeyboardInterrupt), _uninterrupted():
        signal.raise_signal(signal.SIGINT)
        started = True
    assert started


# Says when its worker has begun.
WAITING = """import time
from hamel.engines import engine
with engine("processes", 2) as workers:
    workers.executor.submit(time.monotonic).result()
    print("begun", flush=True)
    workers.executor.submit(time.sleep, 60.0).result()
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="a process is ended otherwise there")
@pytest.mark.parametrize("send", [os.kill, os.killpg], ids=["alone", "group"])
def test_who_ends_the_process_finds_nothing_left_of_its_workers(
    send: Callable[[int, int], None],
) -> None:
    """Semaphores of workers were left behind, and said to be on the terminal; where all of the group
    are ended, as `timeout` does, a traceback of what found its workers dead."""
    command = [sys.executable, "-c", WAITING]
    streams: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, cwd=ROOT, start_new_session=True, **streams) as process:
        assert process.stdout is not None and process.stdout.readline() == "begun\n"
        send(process.pid, signal.SIGTERM)
        _, said = process.communicate(timeout=30)
    assert process.returncode == 128 + signal.SIGTERM and said == ""


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="signals are not masked here")
def test_a_signal_that_the_caller_handles_is_left_to_it() -> None:
    """And one that he does not is as it was afterwards."""
    own = signal.signal(signal.SIGTERM, lambda *_: None)
    try:
        handler = signal.getsignal(signal.SIGTERM)
        with engine("processes", 1):
            assert signal.getsignal(signal.SIGTERM) is handler
    finally:
        signal.signal(signal.SIGTERM, own)
    before = signal.getsignal(signal.SIGTERM)
    with engine("processes", 1):
        assert signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL
    assert signal.getsignal(signal.SIGTERM) is before
