"""Contenders side by side: compiled once and kept, compared with each other, then timed in turn by
driver.c."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

BUILD = Path("build/bench")
HERE = Path(__file__).resolve().parent
ROWS = 128  # random states
COPIES = 3  # of every binary: where a file comes to lie in memory alone may cost a factor
AGREEMENT = 1e-9
NATIVE = ("-march=native",)
PLAIN = (
    "-O2",
    *NATIVE,
)  # what users of other generators call; they are also compiled with all flags of ours
GIVEN = (
    os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set(range(os.cpu_count() or 1))
)
CORES = len(GIVEN)
LIMITED = ("sh", "-c", 'ulimit -t 900; exec "$@"', "sh")  # s of processor time at most for one file
DRIVING = 300.0  # s at most for all contenders of one scene
_turns = threading.BoundedSemaphore(CORES)  # compilers that run at the same time
_making: dict[Path, threading.Lock] = {}
_derives = threading.Lock()
_own = threading.local()  # does this thread derive?


class Unavailable(Exception):
    """A peer that cannot be had or does not build here; the message goes into the table."""


@dataclass(frozen=True, eq=False)
class Contender:
    """A library that maps rows of `inputs` to rows of `size` results; `read`: those results → what
    is compared."""

    peer: str
    library: Path
    inputs: np.ndarray
    size: int
    argument: str = "-"
    read: Callable[[np.ndarray], np.ndarray] = lambda rows: rows
    tolerance: float = AGREEMENT
    turn: int = 0  # additions and multiplications of a sine with its cosine, of ours
    variant: str = ""  # several ways of one peer; the fastest counts


@dataclass(frozen=True)
class Time:
    """Least time of one evaluation, what came out, and how far it is from the first contender's
    where that is too far."""

    ns: float
    results: np.ndarray
    wrong: float = 0.0


@contextlib.contextmanager
def deriving() -> Iterator[None]:
    """One thread at a time: CasADi lets go of Python's lock, and graphs that two threads share are
    spoiled."""
    with _derives:
        _own.derives = True
        try:
            yield
        finally:
            _own.derives = False


@contextlib.contextmanager
def _meanwhile() -> Iterator[None]:
    """Others may derive."""
    if not getattr(_own, "derives", False):
        yield
        return
    _derives.release()
    try:
        yield
    finally:
        _derives.acquire()


def compiled(
    name: str, sources: Mapping[Path, Sequence[str]], link: Sequence[str] = (), shared: bool = True
) -> Path:
    """A library (or program) below build/bench/kept, made anew only where a source, an option, the
    compiler or the processor has changed. Threads may ask for the same one; as many compilers run
    at a time as there are cores.

    `sources`: each file with its options; .cpp files are g++'s.
    """
    commands = {path: "g++" if path.suffix == ".cpp" else "gcc" for path in sources}
    versions = [version(command) for command in commands.values()]
    digest = hashlib.sha256(
        repr((list(sources.values()), link, shared, versions, processor())).encode()
    )
    headers = {
        *HERE.glob("*.hpp"),
        *(header for path in sources for header in path.parent.glob("*.h")),
    }
    for file in [*sources, *sorted(headers)]:
        digest.update(file.read_bytes())
    made = BUILD / "kept" / f"{name}-{digest.hexdigest()[:16]}{'.so' if shared else ''}"
    with _meanwhile(), _making.setdefault(made, threading.Lock()):
        if not made.exists():
            _make(made, sources, commands, link, shared)
    return made.resolve()


def _make(
    made: Path,
    sources: Mapping[Path, Sequence[str]],
    commands: Mapping[Path, str],
    link: Sequence[str],
    shared: bool,
) -> None:
    made.parent.mkdir(parents=True, exist_ok=True)
    kind = ["-shared", "-Wl,-Bsymbolic"] if shared else []
    with tempfile.TemporaryDirectory(prefix="new-", dir=made.parent) as folder:
        objects = [f"{folder}/{i}.o" for i in range(len(sources))]
        for out, (path, options) in zip(objects, sources.items()):
            with _turns:
                run(
                    [
                        *LIMITED,
                        commands[path],
                        *options,
                        *(["-fPIC"] if shared else []),
                        "-c",
                        str(path),
                        "-o",
                        out,
                    ]
                )
        run([max(commands.values()), *kind, *objects, *link, "-lm", "-o", f"{folder}/made"])
        Path(folder, "made").rename(made)


def put(path: Path, text: str) -> None:
    """A file of sources; one that is as it should be is left alone, for a compiler may be reading
    it."""
    if not path.exists() or path.read_text() != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        new = path.with_name(f"{path.name}.{threading.get_ident()}")
        new.write_text(text)
        new.replace(path)


def run(
    command: Sequence[str], text: str = "", folder: Path | None = None, most: float | None = None
) -> str:
    """What a command prints; Unavailable with its last words where it fails or takes more than
    `most` seconds."""
    name = Path(command[0]).name
    try:
        done = subprocess.run(
            list(command),
            input=text,
            capture_output=True,
            text=True,
            check=False,
            cwd=folder,
            timeout=most,
        )
    except subprocess.TimeoutExpired as error:
        raise Unavailable(f"{name} is not done within {most:.0f} s") from error
    except OSError as error:
        raise Unavailable(f"{name} does not start: {error}") from error
    if done.returncode:
        ended = (
            f"{name} ended by signal {-done.returncode}"
            if done.returncode < 0
            else f"{name} failed without a word"
        )
        said = (
            [line for line in done.stderr.splitlines() if "error" in line]
            or done.stderr.splitlines()
            or [ended]
        )
        raise Unavailable(f"{said[0].strip()[:200]}")
    return done.stdout


@functools.cache
def version(command: str) -> str:
    if not shutil.which(command):
        raise Unavailable(f"{command} is not installed")
    return subprocess.run(
        [command, "--version"], capture_output=True, text=True, check=True
    ).stdout.splitlines()[0]


@functools.cache
def processor() -> str:
    """Its name, as the kernel says it."""
    path = Path("/proc/cpuinfo")
    lines = path.read_text().splitlines() if path.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def times(
    contenders: Sequence[Contender], seconds: float = 2.0, rows: int = ROWS, passing: float = 150e3
) -> list[Time]:
    """All of them, in turn, in one process.

    `rows`: their states, repeated as often as it takes; `passing`: ns of one pass over as many of
    them as fit.
    """
    driver = compiled("driver", {HERE / "driver.c": ["-O2", "-std=gnu11"]}, ["-ldl"], shared=False)
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        jobs = [
            _job(Path(folder), f"{i}-{copy}", c, rows)
            for copy in range(COPIES)
            for i, c in enumerate(contenders)
        ]
        said = run(
            [str(driver), str(seconds), str(rows), str(passing)],
            "\n".join(jobs) + "\n",
            most=DRIVING,
        )
        results = [_results(Path(folder), f"{i}-0", c) for i, c in enumerate(contenders)]
    least = [float(line) for line in said.split()]
    differs = [difference(result, results[0]) for result in results]
    return [
        Time(
            min(least[i :: len(contenders)]),
            results[i],
            differs[i] if differs[i] > c.tolerance else 0.0,
        )
        for i, c in enumerate(contenders)
    ]


def measured(contenders: Sequence[Contender]) -> tuple[dict[Contender, Time], dict[Contender, str]]:
    """Times of those that run, and why the others do not: one that crashes takes only itself
    out."""
    try:
        return dict(zip(contenders, times(contenders))), {}
    except Unavailable:
        failing = {c: why for c in contenders if (why := _failure(c))}
        if not failing or contenders[0] in failing:
            raise
        rest = [c for c in contenders if c not in failing]
        return dict(zip(rest, times(rest))), failing


def _failure(contender: Contender) -> str:
    """Why it does not run by itself; empty where it does."""
    try:
        times([contender], seconds=0.0)
    except Unavailable as error:
        return str(error)
    return ""


def difference(found: np.ndarray, expected: np.ndarray) -> float:
    """The largest over the states, relative to the largest entry of a state; infinite where it is
    not a number."""
    if found.shape != expected.shape:
        return 0.0  # chains of additions have nothing to compare
    error = float(
        np.max(np.max(np.abs(found - expected), axis=1) / np.max(np.abs(expected), axis=1))
    )
    return error if np.isfinite(error) else np.inf


def _job(folder: Path, label: str, contender: Contender, count: int) -> str:
    library = folder / f"{label}.so"
    shutil.copyfile(contender.library, library)
    rows = np.resize(np.asarray(contender.inputs, dtype=float), (count, contender.inputs.shape[1]))
    rows.tofile(folder / f"{label}.in")
    return f"{library} {folder / label}.in {rows.shape[1]} {folder / label}.out {contender.size} {contender.argument}"


def _results(folder: Path, label: str, contender: Contender) -> np.ndarray:
    return contender.read(
        np.fromfile(folder / f"{label}.out").reshape(-1, contender.size)[: len(contender.inputs)]
    )


def pinned(cores: int = 1) -> None:
    """This process and its children on so many of the cores that it was given."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, set(sorted(GIVEN)[-cores:]))
