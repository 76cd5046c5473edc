"""`make faults`: what is stored is spoiled, builds are killed, run side by side, meet full disks
and odd compilers.

Each ends in a right module or in a clear refusal: a documented exit code, one message, no
traceback. A module is right when every backend in its folder gives the values of a module that was
built undisturbed, in a fresh process.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import random
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import environment
from environment import (
    HOME,
    KILLED,
    Ends,
    Outcome,
    Record,
    asked,
    complaint,
    ended,
    python,
    run,
    started,
)

CORRUPTIONS, KILLS, TOGETHER = 200, 60, 16  # at most --count of each
REFUSALS = (1, 2, 3, 4, 64)
PATIENCE = 400.0  # seconds for a build whose compiler never ends

# `model` with a length: two modules that share everything but numbers, so that an old one and a new
# one can be told apart.
MODEL = """model: swing
coordinates: {{x: m, y: m}}
parameters: {{m: 1.25 kg, l: {length} m, g: 9.81 m/s^2}}
kinetic: m/2*(der(x)^2 + der(y)^2)
potential: m*g*y
constraints: {{rod: {{holonomic: (x^2 + y^2 - l^2)/2}}}}
initial: {{guess: {{x: {length} m, y: 0.1 m}}}}
"""
PHYSICAL = (1.25 * 9.81, 9.81, 0.625, 1.25)  # what the binaries hold: m g, g, m/2, m
BUILD = (
    "build",
    "m.yaml",
    "-o",
    "out",
    "--constants",
    "all",
    "--functions",
    "dynamics,energy,reactions",
)

# Every backend of the module in ./out at three states; what cannot be imported is told by name.
PROBE = """
import importlib, json, os, sys
sys.path.insert(0, os.getcwd())
answer = {"values": {}, "errors": {}}
import out
answer["backend"] = out.backend
name = out.name
for backend in ("_" + name, "_library", "_numpy"):
    try:
        module = importlib.import_module("out." + backend)
        found = []
        for i, (x, y) in enumerate([(0.6, 0.8), (0.8, -0.6), (-0.28, 0.96)]):
            state = [x, y, *[0.3 + i] * (out.nx - 2)]
            for function in ("dynamics", "energy", "reactions"):
                found += [float(v) for v in getattr(module, function)(0.5, state, [], []).ravel()]
        answer["values"][backend] = found
    except ImportError as error:
        answer["errors"][backend] = str(error)[:200]
print(json.dumps(answer))
"""


def place(length: float = 1.0) -> Path:
    """A new folder with a model file in it."""
    folder = Path(tempfile.mkdtemp(dir=HOME))
    (folder / "m.yaml").write_text(MODEL.format(length=length))
    return folder


def cache_in(folder: Path) -> dict[str, str]:
    return {"XDG_CACHE_HOME": str(folder / "cache")}


def probed(folder: Path) -> tuple[dict, str]:
    """What the module's backends give, or how the process ended."""
    outcome = python(PROBE, [], folder, 60)
    if outcome.code:
        return {}, f"exit {outcome.code}: {outcome.words}"
    return json.loads(outcome.out.splitlines()[-1]), ""


def same(a: list[float], b: list[float]) -> bool:
    return len(a) == len(b) and all(
        abs(x - y) <= 1e-11 * (1 + abs(y)) for x, y in zip(a, b, strict=True)
    )


class Good:
    """What undisturbed modules give, by length; `wrong` says how another differs."""

    def __init__(self) -> None:
        self.values = {length: self._built(length) for length in (1.0, 2.0)}

    def _built(self, length: float) -> dict[str, list[float]]:
        folder = place(length)
        outcome = run(BUILD, folder, more=cache_in(folder))
        found, broken = probed(folder)
        assert not outcome.code and not broken and len(found["values"]) == 3, (
            outcome,
            found,
            broken,
        )
        return found["values"]

    def wrong(
        self, folder: Path, lengths: tuple[float, ...] = (1.0,), compiled: bool = True
    ) -> str:
        found, broken = probed(folder)
        if broken:
            return f"the module cannot be used: {broken}"
        if compiled and found["errors"]:
            return f"a backend is broken: {found['errors']}"
        for length in lengths:
            if all(
                same(value, self.values[length][name]) for name, value in found["values"].items()
            ):
                return ""
        return f"wrong numbers: {found['values']}"


def verdict(
    good: Good, folder: Path, outcome: Outcome, refusals: tuple[int, ...] = REFUSALS
) -> str:
    """A right module, or a clear refusal."""
    wrong = complaint(outcome, refusals) or wordy(outcome)
    return wrong or ("" if outcome.code else good.wrong(folder))


def wordy(outcome: Outcome) -> str:
    """A refusal is one message; what it quotes of a compiler does not count."""
    messages = re.findall(r"^(?:error:|m\.yaml:|out:)", outcome.err, re.MULTILINE)
    if outcome.code == 0 or len(messages) == 1:
        return ""
    return f"exit {outcome.code} with {len(messages)} messages: {outcome.err[:300]!r}"


# ---- spoiled files -------------------------------------------------------------------------------


def flip(rng: random.Random, path: Path, others: list[Path]) -> None:
    data = bytearray(path.read_bytes()) or bytearray(1)
    data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    path.write_bytes(data)


def truncate(rng: random.Random, path: Path, others: list[Path]) -> None:
    os.truncate(path, rng.randrange(max(1, path.stat().st_size)))


def constant(rng: random.Random, path: Path, others: list[Path]) -> None:
    """Another number for one of the doubles in a binary, or for a digit in a text."""
    data = path.read_bytes()
    values = [struct.pack("<d", sign * x) for x in PHYSICAL for sign in (1, -1)]
    places = [data.find(value) for value in values if value in data]
    if path.suffix == ".so" and places:
        i = rng.choice(places)
        path.write_bytes(
            data[:i] + struct.pack("<d", 1.5 * struct.unpack_from("<d", data, i)[0]) + data[i + 8 :]
        )
        return
    digits = [i for i, byte in enumerate(data) if byte in b"12345678"]
    if digits:
        i = rng.choice(digits)
        path.write_bytes(data[:i] + bytes([data[i] + 1]) + data[i + 1 :])


def delete(rng: random.Random, path: Path, others: list[Path]) -> None:
    path.unlink()


def empty(rng: random.Random, path: Path, others: list[Path]) -> None:
    path.write_bytes(b"")


def swap(rng: random.Random, path: Path, others: list[Path]) -> None:
    other = rng.choice(others)
    mine, its = path.read_bytes(), other.read_bytes()
    path.write_bytes(its)
    other.write_bytes(mine)


SPOILS = (flip, truncate, constant, delete, empty, swap)


def spoiled(good: Good, template: Path, number: int) -> Ends:
    """Spoil one file of the cache or of the module, build again, and judge."""
    rng = random.Random(number)
    folder = HOME / f"spoiled{number}"
    shutil.copytree(template, folder)
    stored = "cache" if number % 2 else "out"
    files = sorted(path for path in (folder / stored).rglob("*") if path.is_file())
    weighty = [path for path in files if path.suffix in (".so", ".json")]
    path = rng.choice(weighty if rng.random() < 0.5 and weighty else files)
    how = SPOILS[number // 2 % len(SPOILS)]
    name = f"{how.__name__} {path.relative_to(folder)}"
    how(rng, path, [other for other in files if other != path])
    if stored == "cache":
        shutil.rmtree(folder / "out")
    wrong = "" if stored == "cache" else told(good, folder)
    outcome = run(BUILD, folder, more=cache_in(folder))
    wrong = wrong or verdict(good, folder, outcome)
    shutil.rmtree(folder)
    return ends(f"spoiled {stored}: {how.__name__}", f"corruption {number}, {name}", wrong)


def ends(kind: str, name: str, wrong: str) -> Ends:
    return [kind], [f"{name}: {wrong}"] if wrong else []


def told(good: Good, folder: Path) -> str:
    """`hamel verify FOLDER` of a spoiled module says 0 only where every number is right."""
    outcome = run(["verify", "out"], folder, more=cache_in(folder))
    wrong = complaint(outcome, REFUSALS)
    if not wrong and outcome.code == 0:
        wrong = good.wrong(folder, compiled=False)
    return wrong and f"hamel verify out: {wrong}"


def corruptions(record: Record, good: Good, count: int) -> None:
    template = place()
    run(BUILD, template, more=cache_in(template))
    outcome = run(["verify", "out"], template, more=cache_in(template))
    record.note(
        "verify FOLDER",
        f"hamel verify out refuses a good module: {outcome.words}" if outcome.code else "",
    )
    numbered = ((f"corruption {number}", number) for number in range(min(count, CORRUPTIONS)))
    record.all(lambda number: spoiled(good, template, number), numbered)


# ---- kills ---------------------------------------------------------------------------------------


class Watch(threading.Thread):
    """Looks again and again whether there is a module, and counts the times when there is none."""

    def __init__(self, path: Path):
        super().__init__(daemon=True)
        self.path, self.looks, self.missing, self.over = path, 0, 0, False

    def run(self) -> None:
        while not self.over:
            self.looks += 1
            self.missing += not self.path.exists()
            time.sleep(2e-4)


def killed(good: Good, folder: Path, number: int, duration: float) -> str:
    """Kill one build, half of the times with its compilers; then build the other length,
    undisturbed."""
    rng = random.Random(number)
    length = 1.0 + number % 2
    (folder / "m.yaml").write_text(MODEL.format(length=length))
    if number % 3:
        shutil.rmtree(folder / "cache", ignore_errors=True)  # so that it compiles
    process = started([sys.executable, "-m", "hamel", *BUILD], folder, cache_in(folder))
    watch = Watch(folder / "out" / "manifest.json")
    watch.start()
    time.sleep(rng.uniform(0, 1.1 * duration))
    (process.kill if number % 2 else lambda: os.killpg(process.pid, signal.SIGKILL))()
    ended(process, BUILD, 60)
    wrong = good.wrong(folder, (1.0, 2.0), compiled=False)
    outcome = run(BUILD, folder, more=cache_in(folder))
    watch.over = True
    watch.join()
    wrong = wrong or complaint(outcome, ()) or good.wrong(folder, (length,))
    if not wrong and watch.missing:
        wrong = f"no module was there at {watch.missing} of {watch.looks} looks"
    strange = sorted({path.name for path in folder.iterdir()} - {"m.yaml", "out", "cache"})
    return wrong or (f"left behind: {strange}" if strange else "")


def kills(record: Record, good: Good, count: int) -> None:
    folder = place()
    start = time.monotonic()
    run(BUILD, folder, more=cache_in(folder))
    duration = time.monotonic() - start

    def end(number: int) -> Ends:
        wrong = killed(good, folder, number, duration)
        if wrong.startswith("left behind"):  # told once each
            for path in folder.glob(".*"):
                shutil.rmtree(path, ignore_errors=True)
        return ends("kills", f"kill {number}", wrong)

    numbered = ((f"kill {number}", number) for number in range(min(count, KILLS)))
    record.all(end, numbered, processes=1)  # they share the folder


# ---- side by side --------------------------------------------------------------------------------


def together(record: Record, good: Good, count: int) -> None:
    """Half of the builds go into one folder, half into one each; none finds anything in the cache
    they share."""
    shared, most = place(), min(count, TOGETHER)
    folders = [shared] * (most // 2) + [place() for _ in range(most - most // 2)]
    command = [sys.executable, "-m", "hamel", *BUILD]
    processes = [started(command, folder, cache_in(shared)) for folder in folders]
    for folder, process in zip(folders, processes, strict=True):
        outcome = ended(process, BUILD, PATIENCE)
        wrong = complaint(outcome, (3,)) or good.wrong(folder)
        record.note(f"side by side {outcome.code}", wrong and f"side by side: {wrong}")
    strange = sorted({path.name for path in shared.iterdir()} - {"m.yaml", "out", "cache"})
    record.note(
        "side by side, afterwards", f"side by side left behind: {strange}" if strange else ""
    )


# ---- disks ---------------------------------------------------------------------------------------


@contextlib.contextmanager
def disk(folder: Path, size: str) -> Iterator[bool]:
    """A small disk at a folder; False where none may be mounted."""
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(folder)]
    mounted = (
        shutil.which("mount") is not None
        and subprocess.run(command, check=False, capture_output=True).returncode == 0
    )
    try:
        yield mounted
    finally:
        if mounted:
            subprocess.run(["umount", "-l", str(folder)], check=True)


def full(good: Good, size: str) -> Iterator[tuple[str, str]]:
    """Module and cache on a full disk, then the module alone on one that may not be written, then
    the cache alone."""
    for what, variables in (("module", {}), ("cache", {}), ("TMPDIR", {"TMPDIR": "small"})):
        folder = place()
        with disk(folder / "small", size) as mounted:
            if not mounted:
                yield "full disk, skipped: no disk may be mounted here", ""
                return
            out = "small/out" if what == "module" else "out"
            cache = {"XDG_CACHE_HOME": str(folder / ("small" if what == "cache" else "cache"))}
            outcome = run(
                [out if word == "out" else word for word in BUILD],
                folder,
                more=cache | absolute(folder, variables),
            )
            wrong = verdict(
                good, folder / "small" if what == "module" else folder, outcome
            ) or blames_compiler(outcome)
            yield f"full disk {outcome.code}", wrong and f"{what} on a disk of {size}: {wrong}"


def absolute(folder: Path, variables: dict[str, str]) -> dict[str, str]:
    return {name: str(folder / value) for name, value in variables.items()}


def blames_compiler(outcome: Outcome) -> str:
    words = ("install one", "install gcc", "no C compiler")
    said = next((word for word in words if word in outcome.err), "")
    return f"says '{said}' where the disk is full: {outcome.words}" if said else ""


def short_files(good: Good) -> Iterator[tuple[str, str]]:
    """No file may be longer than so many blocks of 512 bytes."""
    for blocks in (0, 1, 8, 20, 60):
        folder = place()
        command = [
            "sh",
            "-c",
            f'ulimit -f {blocks}; exec "$@"',
            "sh",
            sys.executable,
            "-m",
            "hamel",
            *BUILD,
        ]
        outcome = ended(started(command, folder, cache_in(folder)), BUILD, environment.LIMIT)
        wrong = verdict(good, folder, outcome) or blames_compiler(outcome)
        yield f"short files {outcome.code}", wrong and f"files of at most {blocks} blocks: {wrong}"


def unwritable(good: Good) -> Iterator[tuple[str, str]]:
    """Folders that may only be read: a disk mounted so for root, permissions for others."""
    for what in ("module", "cache"):
        folder = place()
        with disk(folder / "small", "4m") as mounted:
            options = ["mount", "-o", "remount,ro", str(folder / "small")]
            if not mounted or subprocess.run(options, check=False, capture_output=True).returncode:
                (folder / "small").chmod(0o555)
            if os.access(folder / "small", os.W_OK):
                yield "read-only, skipped: everything may be written here", ""
                return
            out = "small/out" if what == "module" else "out"
            cache = {"XDG_CACHE_HOME": str(folder / ("small" if what == "cache" else "cache"))}
            outcome = run([out if word == "out" else word for word in BUILD], folder, more=cache)
            wrong = verdict(good, folder, outcome)
            wanted = 3 if what == "module" else 0
            if not wrong and outcome.code != wanted:
                wrong = f"exit {outcome.code} where {wanted} is right: {outcome.words}"
            yield f"read-only {outcome.code}", wrong and f"{what} in a read-only folder: {wrong}"


# ---- compilers -----------------------------------------------------------------------------------

TARGET = 'while [ $# -gt 0 ]; do [ "$1" = -o ] && shift && out="$1"; shift; done\n'
AARCH64 = r"\177ELF\002\001\001\000\000\000\000\000\000\000\000\000\003\000\267\000"
SCRIPTS = {
    "writes junk": TARGET + 'echo junk > "${out:-a.out}"\n',
    "writes nothing": "exit 0\n",
    "for another machine": TARGET + f"printf '{AARCH64}%0200d' 0 > \"${{out:-a.out}}\"\n",
    "hangs": "exec sleep 100000\n",
    "dies": "kill -SEGV $$\n",
    "talks": "yes 'warning: nothing' | head -c 5000000 >&2\nexit 1\n",
    "forgets a function": 'exec gcc -Ddynamics=dynamic "$@"\n',
    "compiles other numbers": 'for f in "$@"; do case "$f" in '
    '*.c) sed -i s/9.81/9.18/g "$f";; esac; done\nexec gcc "$@"\n',
}
WORDS = ("false", "   ", "'", "", "/nonexistent/cc", "/tmp", "gcc --no-such-option", "gcc\n", "cat")


def compilers(folder: Path) -> Iterator[tuple[str, str]]:
    for name, text in SCRIPTS.items():
        path = folder / f"cc-{name.replace(' ', '-')}"
        path.write_text(f"#!/bin/sh\n{text}")
        path.chmod(0o755)
        yield name, str(path)
    yield from ((repr(word), word) for word in WORDS)


def compiled(good: Good, job: tuple[str, str]) -> Ends:
    """A build with another compiler: one that did its work is used, any other is refused."""
    name, compiler = job
    folder = place()
    outcome = run(BUILD, folder, PATIENCE, cache_in(folder) | {"CC": compiler})
    wrong = verdict(good, folder, outcome, (3, 4))
    if outcome.code == KILLED:
        wrong = f"the build does not end within {PATIENCE:g} s"
    if outcome.code and not wrong and (folder / "out").exists():
        wrong = f"exit {outcome.code}, and yet a module is there"
    return ends(f"compilers {outcome.code}", f"CC {name}", wrong)


# ---- all -----------------------------------------------------------------------------------------


def noted(record: Record, tried: Callable[[], Iterator[tuple[str, str]]]) -> None:
    for kind, wrong in tried():
        record.note(kind, wrong)


def odd_compilers(record: Record, good: Good, count: int) -> None:
    named = ((f"compiler {job[0]}", job) for job in itertools.islice(compilers(HOME), count))
    record.all(lambda job: compiled(good, job), named)


def disks(record: Record, good: Good, count: int) -> None:
    for size in ("64k", "300k", "1m"):
        noted(record, lambda size=size: full(good, size))
    noted(record, lambda: short_files(good))
    noted(record, lambda: unwritable(good))


FAULTS = {
    "compilers": odd_compilers,
    "disks": disks,
    "together": together,
    "kills": kills,
    "corruptions": corruptions,
}


def main() -> int:
    given = asked(__doc__ or "", list(FAULTS), count=max(CORRUPTIONS, KILLS, TOGETHER))
    record, good = Record("faults", given.resume), Good()
    for kind in given.kinds:
        FAULTS[kind](record, good, given.count)
    return record.write()


if __name__ == "__main__":
    sys.exit(main())
