"""Where the trials run: hamel from a wheel in an environment of its own, one fresh process for
each verb.

`python environment.py FOLDER` builds the wheel of this checkout and installs it into
FOLDER/venv. The trials are then run by that environment's interpreter, so that nothing of the
checkout can be imported, and drive hamel by its command line and its public functions alone.
"""

from __future__ import annotations

import argparse
import atexit
import json
import os
import re
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import venv
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

ROOT = Path(__file__).resolve().parents[2]
FINDINGS = ROOT / "tests" / "findings"  # what broke something before
ROBOTS = ROOT / "tests" / "robots"
LIMIT = 180.0  # seconds of processor time of one process
BUSY = 5  # times as long by the clock: other work may go on beside
PROCESSES = int(os.environ.get("PROCESSES", "2"))
KILLED = -1000
OUT_OF_TIME = (-signal.SIGXCPU, -signal.SIGKILL)  # of a process that is limited
EXTRAS = "sweep,identify"
PATHS: dict[str, str] = {}  # more variables for every process; none where hamel is installed

# What a library says and a user must never read. hamel's own warnings are sentences without these
# words.
LIBRARY = re.compile(
    r"Traceback|\w+Warning\b|WARNING|encountered in|site-packages|discards the imaginary"
    r"|\b(?:casadi|numpy|pydantic|sympy)\."
)


@dataclass(frozen=True)
class Outcome:
    """The end of one process; its code is KILLED when it ran out of time."""

    arguments: tuple[str, ...]
    code: int
    out: str
    err: str

    @property
    def words(self) -> str:
        """The last line it said, for a message."""
        said = (self.err.strip() or self.out.strip() or "nothing said").splitlines()
        return said[-1][:300]


def variables(folder: Path, more: Mapping[str, str] | None = None) -> dict[str, str]:
    """Few variables, with a home and a cache in `folder`."""
    kept = {name: os.environ[name] for name in ("PATH", "LANG", "LC_ALL") if name in os.environ}
    own = {"HOME": str(folder), "XDG_CACHE_HOME": str(folder / "cache"), "CC": str(plain_gcc())}
    # several run side by side: a second thread that waits for its turn would count as work
    alone = {"OPENBLAS_NUM_THREADS": "1"}
    return kept | PATHS | own | alone | dict(more or {})


@cache
def plain_gcc() -> Path:
    """gcc that does not optimise: hamel is on trial here, and its code is compiled in half the
    time."""
    path = HOME / "gcc"
    path.write_text('#!/bin/sh\nexec gcc "$@" -O0\n')
    path.chmod(0o755)
    return path


def ended(process: subprocess.Popen[str], arguments: Sequence[str], limit: float) -> Outcome:
    """Wait for a process in a session of its own; at the limit it is killed with its children."""
    try:
        out, err = process.communicate(timeout=limit)
        return Outcome(tuple(arguments), process.returncode, out, err)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        out, err = process.communicate()
        return Outcome(tuple(arguments), KILLED, out, f"{err}\nkilled after {limit:g} s")


def started(
    command: Sequence[str], folder: Path, more: Mapping[str, str] | None = None
) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command, cwd=folder, env=variables(HOME, more), text=True, start_new_session=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, errors="replace",
    )  # fmt: skip


def run(
    arguments: Sequence[str],
    folder: Path,
    limit: float = LIMIT,
    more: Mapping[str, str] | None = None,
) -> Outcome:
    """`hamel ARGUMENTS` in a fresh process that works in `folder`."""
    command = limited([sys.executable, "-m", "hamel", *arguments], limit)
    return ended(started(command, folder, more), arguments, BUSY * limit)


def limited(command: Sequence[str], limit: float) -> list[str]:
    """The command, killed when it has used so many seconds of processor time."""
    return ["sh", "-c", f'ulimit -t {limit:.0f}; exec "$@"', "sh", *command]


def python(program: str, arguments: Sequence[str], folder: Path, limit: float = LIMIT) -> Outcome:
    """A Python program in a fresh process that works in `folder`."""
    command = limited([sys.executable, "-c", program, *arguments], limit)
    return ended(started(command, folder), arguments, BUSY * limit)


@cache
def documented() -> frozenset[int]:
    """The exit codes that `hamel --help` names, without the one of an internal error."""
    told = run(["--help"], HOME).out.partition("Exit codes:")[2]
    return frozenset(int(code) for code in re.findall(r"(?<![\w.])(\d+) [a-z]", told)) - {70}


def complaint(outcome: Outcome, refusals: Iterable[int] = (1, 2, 64)) -> str:
    """What is wrong with the end of a process; empty when it did its work or refused for a
    documented reason."""
    said = f"{outcome.err}\n{outcome.out if outcome.code else ''}"
    if outcome.code in (KILLED, *OUT_OF_TIME):
        return f"ran for more than the limit: {outcome.words}"
    if outcome.code not in documented():
        return f"exit {outcome.code}: {outcome.words}"
    if outcome.code and outcome.code not in refusals:
        return f"exit {outcome.code} here is no true reason: {outcome.words}"
    if word := LIBRARY.search(said):
        line = next(line for line in said.splitlines() if word.group() in line)
        return f"says '{word.group()}': {line[:300]}"
    if outcome.code and not said.strip():
        return f"exit {outcome.code} without a word"
    return unreadable(outcome) if "--json" in outcome.arguments else ""


def unreadable(outcome: Outcome) -> str:
    """With --json standard output is one JSON value."""
    try:
        json.loads(outcome.out)
    except json.JSONDecodeError as error:
        return f"--json printed no JSON ({error}): {outcome.out[:100]!r}"
    return ""


def asked(about: str, kinds: Sequence[str], **numbers: int) -> argparse.Namespace:
    """What a command line wants of trials: `kinds`, all when none is named, and `numbers`."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=", ".join(kinds))
    for name, usual in numbers.items():
        parser.add_argument(f"--{name}", type=int, default=usual)
    parser.add_argument("--resume", action="store_true", help="leave out what went well before")
    wanted = parser.parse_args()
    if unknown := [kind for kind in wanted.kinds if kind not in kinds]:
        parser.error(f"no kind of trial: {', '.join(unknown)}")
    wanted.kinds = wanted.kinds or list(kinds)
    return wanted


Item = TypeVar("Item")
Ends = tuple[list[str], list[str]]  # the kinds of trial that were made, and what failed


class Record:
    """What was tried, by kind, and what failed.

    A journal, one line for each trial, lets an interrupted run go on: `resume` counts what went
    well before instead of trying it again.
    """

    def __init__(self, name: str, resume: bool = False, folder: Path = ROOT / "build"):
        self.name, self.folder = name, folder
        self.tried: Counter[str] = Counter()
        self.failures: list[str] = []
        self.journal = folder / "trials" / f"{name}.jsonl"
        self.earlier = self._earlier() if resume else {}
        if not resume:
            self.journal.unlink(missing_ok=True)

    def _earlier(self) -> dict[str, list[str]]:
        """The trials that went well, by name."""
        if not self.journal.exists():
            return {}
        entries = map(json.loads, self.journal.read_text().splitlines())
        latest = {entry["name"]: entry for entry in entries}
        return {n: entry["ends"] for n, entry in latest.items() if not entry["failures"]}

    def note(self, kind: str, failure: str = "") -> None:
        self._count([kind], [failure] if failure else [])

    def _count(self, kinds: list[str], failures: list[str]) -> None:
        self.tried.update(kinds)
        self.failures += failures
        for failure in failures:
            print(f"FAILED {failure}", flush=True)

    def all(
        self,
        work: Callable[[Item], Ends],
        items: Iterable[tuple[str, Item]],
        processes: int = PROCESSES,
    ) -> None:
        """Try each item, which has a name of its own; the work itself is done by processes."""

        def named(item: tuple[str, Item]) -> tuple[str, Ends]:
            name, given = item
            return name, (self.earlier[name], []) if name in self.earlier else work(given)

        self.journal.parent.mkdir(parents=True, exist_ok=True)
        with ThreadPoolExecutor(processes) as pool, self.journal.open("a") as journal:
            for name, (kinds, failures) in pool.map(named, items):
                self._count(kinds, failures)
                if name not in self.earlier:
                    entry = {"name": name, "ends": kinds, "failures": failures}
                    journal.write(json.dumps(entry) + "\n")
                    journal.flush()

    @property
    def place(self) -> Path:
        return self.folder / f"{self.name}.json"

    def take_up(self) -> None:
        """Go on counting where the last run ended."""
        if self.place.exists():
            earlier = json.loads(self.place.read_text())
            self.tried.update(earlier["tried"])
            self.failures += earlier["failures"]

    def write(self) -> int:
        """Write build/NAME.json and return the exit code."""
        self.folder.mkdir(exist_ok=True)
        text = {"tried": dict(sorted(self.tried.items())), "failures": self.failures}
        self.place.write_text(json.dumps(text, indent=1, ensure_ascii=False) + "\n")
        total, bad = sum(self.tried.values()), len(self.failures)
        print(f"{self.name}: {total} tried, {bad} failures ({self.place})")
        return 1 if self.failures else 0


WORKER = """
import json, sys, warnings
import hamel, hamel.api
answer, sys.stdout = sys.stdout, sys.stderr
for line in sys.stdin:
    verb, arguments, options = json.loads(line)
    said = []
    def shown(message, category, *place, **more):
        if not str(message).startswith(tuple(arguments)):  # hamel's own begin with the file
            said.append(f"{category.__name__}: {message}")
    warnings.showwarning = shown
    warnings.simplefilter("always")
    try:
        getattr(hamel, verb)(*arguments, **options)
        end = {"code": 0, "text": ""}
    except BaseException as error:
        code = getattr(error, "exit_code", 70)
        end = {"code": code, "text": f"{type(error).__name__}: {error}"}
    print(json.dumps(end | {"warnings": said}), file=answer, flush=True)
"""


class Worker:
    """A process that calls hamel's functions again and again; started anew when it hangs or
    dies."""

    def __init__(self, memory: int | None = None, more: Mapping[str, str] | None = None):
        self.memory, self.more, self.process = memory, more, None

    def call(
        self, verb: str, *arguments: str, limit: float = 20.0, **options: Any
    ) -> dict[str, Any]:
        """{"code", "text", "warnings"}; the code is KILLED when it took longer than the limit or
        the process died."""
        if self.process is None or self.process.poll() is not None:
            self.process = self._start()
        process = self.process
        try:
            process.stdin.write(json.dumps([verb, arguments, options]) + "\n")
            process.stdin.flush()
            if self._answers(limit) and (line := process.stdout.readline()):
                return json.loads(line)
        except BrokenPipeError:
            pass
        died = process.poll() is not None
        self.stop()
        return {
            "code": KILLED,
            "text": "the process died" if died else f"took more than {limit:g} s",
            "warnings": [],
        }

    def _answers(self, limit: float) -> bool:
        """Whether it answers before it has used `limit` seconds of processor time (five times as
        much by the clock)."""
        busy, begin = self._busy(), time.monotonic()
        while not select.select([self.process.stdout], [], [], 0.5)[0]:
            if self._busy() - busy > limit or time.monotonic() - begin > 5 * limit:
                return False
        return True

    def _busy(self) -> float:
        """Seconds of processor time; 0 where the system does not tell."""
        try:
            fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            return 0.0
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def stop(self) -> None:
        if self.process is not None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
            self.process = None

    def _start(self) -> subprocess.Popen[str]:
        limit = "" if self.memory is None else f"ulimit -v {self.memory // 1024}; "
        command = ["sh", "-c", f'{limit}exec "$@"', "sh", sys.executable, "-c", WORKER]
        return subprocess.Popen(
            command, cwd=HOME, env=variables(HOME, self.more), text=True, start_new_session=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip


HOME = Path(tempfile.mkdtemp(prefix="trials-"))  # outside the checkout
atexit.register(shutil.rmtree, HOME, ignore_errors=True)


def install(folder: Path) -> None:
    """Build the wheel of this checkout and install it into the empty environment FOLDER/venv, with
    what `hamel sweep` and `hamel identify` ask for."""
    home, dist = folder / "venv", folder / "dist"
    wanted = (ROOT / "pyproject.toml").read_text()
    stamp = home / "pyproject.toml"
    if not stamp.exists() or stamp.read_text() != wanted:
        venv.EnvBuilder(clear=True, with_pip=True).create(home)
    pip = [str(home / "bin" / "python"), "-m", "pip", "--quiet", "--disable-pip-version-check"]
    shutil.rmtree(dist, ignore_errors=True)
    subprocess.run([*pip, "wheel", "--no-deps", "--wheel-dir", str(dist), str(ROOT)], check=True)
    (wheel,) = dist.glob("*.whl")
    subprocess.run([*pip, "install", f"{wheel}[{EXTRAS}]"], check=True)
    subprocess.run([*pip, "install", "--no-deps", "--force-reinstall", str(wheel)], check=True)
    stamp.write_text(wanted)


if __name__ == "__main__":
    install(Path(sys.argv[1]))
