"""make bench: our generated C beside its peers, in compiled loops without Python, into
build/bench.json.

    python benchmarks/bench.py [MODEL …]

First everything is compiled, as many at a time as there are cores, and kept in build/bench. Then
every contender is checked to agree with ours to 1e-9 and timed; all contenders of a scene run in
turn in one process. Each row is in the file as soon as it is there. Interrupted, it goes on where
it was: a scene is kept that was finished, by the same binaries, before the interruption.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import page
from peers import pinocchio
from peers.contest import BUILD, CORES, Contender, Unavailable, deriving, pinned
from rows import OURS, WRONG, Entry, Row, reason, rows
from scenes import SCENES, Scene
from targets import SCALAR

OUT, DONE = Path("build/bench.json"), BUILD / "measured.json"


class Stopwatch:
    """Lines of progress, each with the time since the start."""

    def __init__(self) -> None:
        self.start = time.monotonic()

    def say(self, words: str) -> None:
        print(f"{time.monotonic() - self.start:6.0f} s  {words}", file=sys.stderr, flush=True)


def main(chosen: Sequence[str]) -> int:
    unknown = [name for name in chosen if name not in SCENES]
    if unknown:
        print(f"bench: no model {unknown[0]!r}; there are {', '.join(SCENES)}", file=sys.stderr)
        return 2
    names, watch = [name for name in SCENES if name in chosen or not chosen], Stopwatch()
    entries = compiled(names, watch)
    watch.say("everything is compiled; now each scene by itself, on one core")
    pinned()
    print(page.HEAD)
    found = list(measured(names, entries, watch))
    page.drawn(read(OUT), OUT.parent)
    missed, met = (sum(row["met"] is verdict for row in found) for verdict in (False, True))
    print(
        f"{met} targets met, {missed} missed, {time.monotonic() - watch.start:.0f} s; see {OUT} and {OUT.parent}/bench_*.svg"
    )
    return int(any(row["peer"] == OURS or row["note"].startswith(WRONG) for row in found))


def compiled(names: Sequence[str], watch: Stopwatch) -> list[Entry]:
    """Every scene with its contenders. Threads: the compilers run as processes, while others derive
    and write C."""
    pool = ThreadPoolExecutor(CORES + 4)
    made: dict[Any, Future[Any]] = {}  # two scenes may have the same peer

    def submitted(label: str, make: Callable[[], Any]) -> Future[Any]:
        if make not in made:
            made[make] = pool.submit(_watched, label, make, watch)
        return made[make]

    if len(names) == len(SCENES):  # minutes each: they come first
        for template in (pinocchio.maker, pinocchio.library, pinocchio.loops_library):
            submitted(f"Pinocchio's templates, {template.__name__}", template)
    waiting = []
    try:
        for scene in (scene for name in names for scene in _derived(name, watch)):
            label = f"{scene.function}, {scene.model}"
            peers = {
                peer: submitted(f"{label}: {peer}", make) for peer, make in scene.peers.items()
            }
            waiting.append((Entry(scene), peers | {OURS: submitted(f"{label}: ours", scene.own)}))
        for entry, futures in waiting:
            for peer, future in futures.items():
                try:
                    entry.found[peer] = list(future.result())
                except Exception as error:  # a row says so
                    entry.missing[peer] = reason(error)
    finally:
        pool.shutdown(cancel_futures=True)
    return [entry for entry, _ in waiting]


def _derived(name: str, watch: Stopwatch) -> Iterator[Scene]:
    scenes = SCENES[name]()
    try:
        while True:
            with deriving():
                scene = next(scenes, None)
            if scene is None:
                return
            yield scene
    except Exception as error:
        watch.say(f"{name}: {reason(error)}")
        yield Scene(SCALAR, name, partial(_unavailable, reason(error)), {}, {})


def _unavailable(why: str) -> Sequence[Contender]:
    raise Unavailable(why)


def _watched(label: str, make: Callable[[], Any], watch: Stopwatch) -> Any:
    start = time.monotonic()
    try:
        with deriving():
            made = make()
    except Exception as error:
        watch.say(f"{label}: {reason(error)}")
        raise
    watch.say(f"{label}: {time.monotonic() - start:.0f} s")
    return made


def measured(names: Sequence[str], entries: Sequence[Entry], watch: Stopwatch) -> Iterator[Row]:
    """Rows into the file and out; models that are not run now keep theirs."""
    finished = set(read(DONE))
    over = {(e.scene.function, e.scene.model): e.key in finished for e in entries}
    kept = [
        row
        for row in read(OUT)
        if row["model"] not in names or over.get((row["function"], row["model"]))
    ]
    for entry in entries:
        scene = entry.scene
        if over[scene.function, scene.model]:
            watch.say(f"{scene.function}, {scene.model}: measured before the interruption")
            yield from (
                row
                for row in kept
                if (row["function"], row["model"]) == (scene.function, scene.model)
            )
            continue
        watch.say(f"{scene.function}, {scene.model}")
        for row in rows(entry):
            kept = sorted([*kept, row], key=lambda row: list(SCENES).index(row["model"]))
            write(OUT, kept)
            print(page.line(row), flush=True)
            yield row
        finished |= {entry.key} - {""}
        write(DONE, sorted(finished))
    write(DONE, sorted(finished - {entry.key for entry in entries}))


def read(path: Path) -> list[Any]:
    return json.loads(path.read_text("utf-8")) if path.exists() else []


def write(path: Path, found: Sequence[Any]) -> None:
    """At once or not at all."""
    new = path.with_suffix(".new")
    new.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", "utf-8")
    os.replace(new, path)


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        sys.exit("bench: interrupted; the next run goes on here")
