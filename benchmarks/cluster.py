"""Nothing lost, nothing twice: a sweep on a real dask scheduler while its workers, and once the
scheduler itself, are killed; compared byte by byte with one that nobody disturbed.

    make cluster

Starts `dask scheduler` and `dask worker` as processes on the loopback address, runs `hamel sweep`
against them as a process of its own, sends SIGKILL to workers at random moments (and starts others
in their place) until there were enough, and once to the scheduler; then the same command goes on in
the same folder. Writes build/cluster.json.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pyarrow.parquet as parquet

ROOT = Path(__file__).resolve().parent.parent
PLACE = ROOT / "build" / "cluster"
WORKERS, KILLS = 2, 10
MODEL = "models/four_bar.yaml"
VARIED = (
    *("--vary", "m2=normal(2.5, 0.1)", "--vary", "l1=normal(0.2, 1 mm)"),
    *("--vary", "q1=uniform(0, 360 deg)", "--keep", "state", "--keep", "tip.x", "--keep", "steps"),
)
LONG, MOST = 30.0, 1800.0  # s of the sweep in one process; at most, with all that happens to it
PYTHON = sys.executable


def started(*command: str) -> subprocess.Popen[bytes]:
    """A process whose words go to the log."""
    log = (PLACE / "log").open("ab")
    return subprocess.Popen([PYTHON, "-m", *command], cwd=ROOT, stdout=log, stderr=log)


def port() -> int:
    """One that is free."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


class Cluster:
    """A scheduler and workers without nannies: what is killed stays so until it is replaced."""

    def __init__(self) -> None:
        self.address = f"tcp://127.0.0.1:{port()}"
        self.scheduler = self._scheduler()
        self.workers = [self._worker() for _ in range(WORKERS)]

    def _scheduler(self) -> subprocess.Popen[bytes]:
        number = self.address.rpartition(":")[2]
        place = ("--host", "127.0.0.1", "--port", number, "--no-dashboard")
        return started("distributed.cli.dask_scheduler", *place)

    def _worker(self) -> subprocess.Popen[bytes]:
        alone = ("--no-nanny", "--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1")
        return started("distributed.cli.dask_worker", self.address, *alone)

    def kill_worker(self, which: int) -> None:
        """SIGKILL, and another in its place."""
        self.workers[which].kill()
        self.workers[which].wait()
        self.workers[which] = self._worker()

    def kill_scheduler(self) -> None:
        """SIGKILL; workers that have lost it are replaced, too."""
        self.scheduler.kill()
        self.scheduler.wait()

    def begin_again(self) -> None:
        """A scheduler at the same address, and workers of it."""
        for worker in self.workers:
            worker.kill()
            worker.wait()
        self.scheduler = self._scheduler()
        self.workers = [self._worker() for _ in range(WORKERS)]

    def end(self) -> None:
        """All of it."""
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()


@contextlib.contextmanager
def cluster() -> Iterator[Cluster]:
    """Gone at the end of the block."""
    found = Cluster()
    try:
        yield found
    finally:
        found.end()


def sweep(folder: Path, motions: int, chunk: int, *more: str) -> tuple[str, ...]:
    """The command."""
    size = ("--samples", str(motions), "--chunk", str(chunk), "--time", "5")
    return ("hamel", "sweep", MODEL, *VARIED, *size, "-o", str(folder), *more)


def chunks(folder: Path) -> int:
    """How many are finished."""
    place = folder / "chunks"
    return (
        sum(1 for entry in os.scandir(place) if entry.name.endswith(".parquet"))
        if place.is_dir()
        else 0
    )


def undisturbed(folder: Path, motions: int, chunk: int) -> float:
    """Seconds of the sweep in one process."""
    begin = time.monotonic()
    if done := started(*sweep(folder, motions, chunk)).wait():
        raise SystemExit(f"the undisturbed sweep ended with exit code {done}: see {PLACE / 'log'}")
    return time.monotonic() - begin


def enough(chunk: int) -> int:
    """Motions that keep this machine busy for about LONG: none is killed of a sweep that is over
    before its workers have begun."""
    few, more = 2_000, 22_000
    seconds = [undisturbed(PLACE / f"{count}", count, chunk) for count in (few, more)]
    each = max(seconds[1] - seconds[0], 0.1) / (more - few)
    return round(min(max(LONG / each, 60_000), 1_000_000) / chunk) * chunk


def disturbed(folder: Path, motions: int, chunk: int, seed: int) -> tuple[int, int, list[int]]:
    """The sweep, with all that happens to it: kills of workers and of the scheduler, exit codes of
    the command."""
    rng, killed, lost, codes = random.Random(seed), 0, 0, []
    size = -(-motions // chunk)
    end = time.monotonic() + MOST
    with cluster() as here:
        command = sweep(folder, motions, chunk, "--scheduler", here.address)
        process = started(*command)
        while time.monotonic() < end:
            time.sleep(rng.uniform(0.2, 1.0))
            if (code := process.poll()) is not None:
                codes.append(code)
                if code == 0:
                    return killed, lost, codes
                if code != 3 or len(codes) > 10:
                    raise SystemExit(f"the sweep ended with exit code {code}: see {PLACE / 'log'}")
                here.begin_again()
                process = started(*command)
                continue
            done = chunks(folder)
            if not lost and done > size / 2 and here.scheduler.poll() is None:
                here.kill_scheduler()
                lost += 1
            elif killed < KILLS and done >= (killed + 1) * size / (KILLS + 3):
                here.kill_worker(rng.randrange(WORKERS))
                killed += 1
        process.kill()
        process.wait()
    raise SystemExit(f"the sweep did not end within {MOST:.0f} s: see {PLACE / 'log'}")


def files(folder: Path) -> dict[str, bytes]:
    """By relative path, hidden ones too: nothing half-written may be left."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def numbers(folder: Path) -> list[int]:
    """Of all motions in the folder."""
    found: list[int] = []
    for path in sorted((folder / "chunks").glob("*.parquet")):
        found += parquet.read_table(path, columns=["motion"])["motion"].to_pylist()
    return found


def main() -> None:
    """The comparison; exit code 1 where anything differs."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--motions", type=int, help="default: as many as take LONG")
    arguments.add_argument("--chunk", type=int, default=250)
    arguments.add_argument("--seed", type=int, default=0)
    asked = arguments.parse_args()
    shutil.rmtree(PLACE, ignore_errors=True)
    PLACE.mkdir(parents=True)
    calm, rough = PLACE / "undisturbed", PLACE / "disturbed"
    motions = asked.motions or enough(asked.chunk)
    print(f"{motions} motions in one process", flush=True)
    undisturbed(calm, motions, asked.chunk)
    print("the same on dask, with workers and the scheduler killed on the way", flush=True)
    killed, lost, codes = disturbed(rough, motions, asked.chunk, asked.seed)
    made = numbers(rough)
    record = {
        "motions": motions,
        "killed_workers": killed,
        "killed_schedulers": lost,
        "identical": files(calm) == files(rough),
        "lost": motions - len(set(made)),
        "doubled": len(made) - len(set(made)),
        "exit_codes": codes,
    }
    place = ROOT / "build" / "cluster.json"
    place.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(record))
    good = record["identical"] and not record["lost"] and not record["doubled"]
    sys.exit(0 if good and killed >= KILLS and lost == 1 else 1)


if __name__ == "__main__":
    main()
