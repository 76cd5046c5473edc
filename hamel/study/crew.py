"""Worker processes that can be killed: a run that takes too long ends with its process, and the
work goes on in a new one.

A task is a call of one of worker.CALLS; what it yields comes back message by message. Messages are
lines of JSON.
"""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any

ROOT = Path(__file__).resolve().parent.parent.parent
Message = dict[str, Any]


@dataclass(frozen=True)
class Task:
    """`patience`: seconds without a message after which the process is killed; `about` is for
    whoever gets the answers."""

    call: str
    arguments: Mapping[str, Any]
    patience: float
    about: Any = None


@dataclass
class Crew:
    """As many workers as `size`, started when there is something to do. Use it in a `with` block:
    it ends its processes."""

    size: int
    _processes: dict[int, subprocess.Popen[str]] = field(default_factory=dict)

    def __enter__(self) -> Crew:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for process in self._processes.values():
            process.kill()
        for process in self._processes.values():
            process.wait()
        self._processes.clear()

    def answers(self, tasks: Iterable[Task]) -> Iterator[tuple[Task, Message]]:
        """Every message with its task, as they come; a task's last is {"over": "done"}, {"over":
        "killed"} or {"error": …}."""
        waiting, found = deque(tasks), queue.Queue[tuple[Task, Message]]()
        seats = range(min(self.size, len(waiting)))
        stop, threads = threading.Event(), []
        try:
            for seat in seats:
                threads.append(
                    threading.Thread(
                        target=self._work, args=(seat, waiting, found, stop), daemon=True
                    )
                )
                threads[-1].start()
            while any(thread.is_alive() for thread in threads) or not found.empty():
                try:
                    yield found.get(timeout=0.2)
                except queue.Empty:
                    continue
        finally:
            stop.set()
            waiting.clear()
            if any(
                thread.is_alive() for thread in threads
            ):  # whoever asked wants no more: what is under way is in vain
                self.__exit__(None, None, None)

    def _work(
        self,
        seat: int,
        waiting: deque[Task],
        found: queue.Queue[tuple[Task, Message]],
        stop: threading.Event,
    ) -> None:
        while not stop.is_set():
            try:
                task = waiting.popleft()
            except IndexError:
                return
            try:
                for message in self._done(seat, task):
                    found.put((task, message))
            except OSError as error:  # no process can be started
                found.put((task, {"error": f"{type(error).__name__}: {error}", "exit_code": 3}))

    def _done(self, seat: int, task: Task) -> Iterator[Message]:
        process = self._process(seat)
        assert process.stdin is not None and process.stdout is not None
        try:
            process.stdin.write(json.dumps({"call": task.call, "arguments": task.arguments}) + "\n")
            process.stdin.flush()
        except OSError:
            yield {"over": "killed"}
            return
        while True:
            timer = threading.Timer(task.patience, process.kill)
            timer.start()
            line = process.stdout.readline()
            timer.cancel()
            if not line:
                yield {"over": "killed"}
                return
            message = json.loads(line)
            yield message
            if "over" in message or "error" in message:
                return

    def _process(self, seat: int) -> subprocess.Popen[str]:
        """The worker in this seat; a new one where there is none alive."""
        process = self._processes.get(seat)
        if process is None or process.poll() is not None:
            paths = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
            process = subprocess.Popen(
                [sys.executable, "-m", "hamel.study.worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                encoding="utf-8",
                env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            )
            self._processes[seat] = process
        return process
