"""How near a sweep comes to the bare lane kernel, what a chunk costs besides, and how many tasks a
dask scheduler hands out: build/sweeps.json. Everything is measured side by side, the least of several;
by the clock, and in processor time of this process and its workers, which other work on the machine
leaves nearly as it is.

    python benchmarks/sweeps.py [--dask] [--plot FILE] [--peers]
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import ensembles
import numpy as np
import psutil
from peers.contest import BUILD
from peers.ensembles import by_processes, one_by_one, rolled_out

from hamel.draw import Series, chart
from hamel.engines import Engine, engine
from hamel.simulate.compiled import Rows
from hamel.simulate.method import Method
from hamel.sweep import work
from hamel.sweep.axes import Sampling
from hamel.sweep.drive import driven
from hamel.sweep.folder import Folder
from hamel.sweep.job import Motions, payload
from hamel.sweep.plan import Asked, Plan, planned

ROOT = Path(__file__).resolve().parent.parent
CORES = os.cpu_count() or 1
CHUNKS = (16, 128, 1024, 8192)  # motions; the last ones take a core a third of a second
FEW, MUCH = 1, 5  # of the longest chunks for each core, or of so many short ones:
SHORT = 64
PROCESSOR = ", processor time"
METHOD = Method("quasi_velocities", None, None, "dop853", None, 1e-9, None)


def plan(count: int, chunk: int, seconds: float) -> Plan:
    """Four-bars with lengths and masses of their own."""
    vary = {"l1": "normal(0.2, 0.5 mm)", "l2": "normal(0.5, 0.5 mm)", "m2": "normal(2.5, 0.1)"}
    sampling = Sampling(count, "random", 0)
    keep = ["state", "tip.x"]
    asked = Asked(vary, (), keep, sampling, METHOD, Rows(seconds), chunk=chunk)
    return planned(ROOT / "models" / "four_bar.yaml", asked)


def now() -> np.ndarray:
    """Seconds by the clock, and of processor time."""
    me = psutil.Process()
    times = [each.cpu_times() for each in (me, *me.children(recursive=True))]
    return np.array([time.perf_counter(), sum(each.user + each.system for each in times)])


def swept(of: Plan, by: Engine) -> np.ndarray:
    """Seconds of a whole sweep into a new folder, as `now` has them."""
    with tempfile.TemporaryDirectory(dir=ROOT / "build") as place:
        folder = Folder(place + "/sweep", True)
        folder.enter(dict(of.about))
        begin = now()
        driven(of, by, folder, 0)
        return now() - begin


def bare(of: Plan) -> Callable[[], np.ndarray]:
    """Seconds of the same motions in one call of the module, on all cores, with starts at hand."""
    job = of.jobs[0]
    name, data = payload(job)
    found = work.prepared(work.Task(job.version, name, 0, data))
    assert found is not None and isinstance(job.work, Motions)
    module: Any = found[1]
    values = job.design.values(0, of.design.size)
    p = np.tile(job.work.p, (of.design.size, 1))
    for name, column in values.items():
        p[:, job.work.parameters.index(name)] = column
    start = job.work.starter({}, p)
    u = np.zeros(module.nu)
    x = module.state(0.0, np.hstack([start.q, start.v]), u, p)
    by = job.work.stepping

    def seconds() -> np.ndarray:
        begin = now()
        module.simulate(
            (job.work.times[0], job.work.times[-1]), x, u, p, rtol=by.rtol, atol=by.atol,
            threads=CORES, times=job.work.times, integrator=by.integrator, enforcement=by.enforcement,
        )  # fmt: skip
        return now() - begin

    return seconds


def least(times: int, *calls: Callable[[], np.ndarray]) -> list[np.ndarray]:
    """Of each, in turn."""
    rounds = [[call() for call in calls] for _ in range(times)]
    return [np.min(column, axis=0) for column in zip(*rounds)]


def beside_peers(by: Engine) -> dict[str, float]:
    """Motions per second of a sweep over those of others on as many cores: two pendulums for 5 s,
    each to an error of 1e-8 at its end."""
    place = ensembles.Place(ensembles.SCENES[0])
    span, most = place.site.scene.span, ensembles.PYTHON
    mine = ensembles.fastest([ensembles.tuned(each, place) for each in place.ours()], most)
    assert mine is not None
    integrator, rtol = mine.ensemble.peer.partition(",")[0], 10.0**mine.setting
    method = replace(METHOD, integrator=integrator, rtol=rtol)
    vary = {f"q{i}": f"uniform({x - 0.02}, {x + 0.02})" for i, x in enumerate(place.site.x[:2])}
    sampling = Sampling(ensembles.MANY, "random", 0)
    asked = Asked(vary, (), ["state"], sampling, method, Rows(span), chunk=1024)
    of = planned(BUILD / "whole" / "chain2.yaml", asked)
    own = least(3, partial(swept, of, by))[0][0] / ensembles.MANY
    alone = one_by_one(place.folder, place.site.u, span)
    ratios: dict[str, float] = {}
    for peer in (by_processes(alone, CORES), rolled_out(2, span, CORES)):
        best = ensembles.tuned(peer, place, 8 * CORES)[most]
        ratios[peer.peer] = best.seconds / own
    return ratios


def shares(engines: dict[str, Engine], rounds: int) -> dict[str, list[tuple[int, float]]]:
    """Of the throughput of the bare kernel on all cores, by motions a chunk; and what both take of
    processor time, one over the other. The kernel and all
    engines go in turn, and for about as long, so that what else the machine does meets them alike.
    What a sweep takes to start is left out: between few motions and many."""
    names = [name + how for name in engines for how in ("", PROCESSOR)]
    found: dict[str, list[tuple[int, float]]] = {name: [] for name in names}
    kernel = bare(plan(CHUNKS[-1] * CORES, CHUNKS[-1], 5.0))
    for chunk in CHUNKS:
        some = CORES * min(CHUNKS[-1], SHORT * chunk)
        few, many = (plan(times * some, chunk, 5.0) for times in (FEW, MUCH))
        calls = [partial(swept, of, by) for by in engines.values() for of in (few, many)]
        alone, *seconds = least(rounds, kernel, *calls)
        for name, short, long in zip(engines, seconds[::2], seconds[1::2]):
            fair = alone * (MUCH - FEW) * some / (CHUNKS[-1] * CORES)
            for how, share in zip(("", PROCESSOR), fair / (long - short)):
                found[name + how].append((chunk, float(share)))
    return found


def plot(found: dict[str, list[tuple[int, float]]]) -> str:
    """The shares of processor time over motions a chunk: those that repeat."""
    ends = {name: points for name, points in found.items() if name.endswith(PROCESSOR)}
    lines = [Series(name.removesuffix(PROCESSOR), points) for name, points in ends.items()]
    title = "Processor time of the bare kernel over that of a sweep and its workers"
    return chart(title, "motions a chunk", "share", lines, log=(True, False))


def nothing(number: int) -> int:
    """A task without work."""
    return number


def tasks_per_second(by: Engine, count: int = 2000) -> float:
    """That the engine hands out and takes back, some hundred on their way at a time."""
    begin = time.perf_counter()
    for first in range(0, count, 200):
        for future in [by.executor.submit(nothing, first + k) for k in range(200)]:
            future.result()
    return count / (time.perf_counter() - begin)


def main() -> None:
    """The figures, printed and written."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--dask", action="store_true", help="also dask with a worker a core")
    arguments.add_argument("--rounds", type=int, default=5)
    arguments.add_argument("--plot", type=Path, help="shares over motions a chunk, as SVG")
    arguments.add_argument("--peers", action="store_true", help="also joblib and MuJoCo")
    asked = arguments.parse_args()
    warnings.simplefilter("ignore")
    found: dict[str, Any] = {"cores": CORES}
    long, short, more_short = plan(4096, 1024, 5.0), plan(512, 8, 1e-3), plan(4096, 8, 1e-3)
    alone = least(3 * asked.rounds, bare(long))[0]
    found["motions_per_second_bare"] = 4096 / alone[0]
    found["motion_us"] = 1e6 * alone[1] / 4096
    with contextlib.ExitStack() as stack:
        here = stack.enter_context(engine("here", CORES))
        few, many = least(asked.rounds, lambda: swept(short, here), lambda: swept(more_short, here))
        each = (many - few) / (more_short.chunks - short.chunks)
        found["chunk_overhead_ms"], found["chunk_processor_ms"] = 1e3 * each
        found["start_seconds"] = (few - short.chunks * each)[0]
        found["bytes_a_motion"] = _bytes(long, here)
        found["job_bytes"] = len(payload(long.jobs[0])[1])
        engines = {"threads": here}
        if asked.dask:
            engines["dask"] = dask = stack.enter_context(engine("local", CORES))
            swept(long, dask)  # workers import what they need
            found["dask_tasks_per_second"] = tasks_per_second(dask)
        found["shares"] = shares(engines, asked.rounds)
        found["load"] = os.getloadavg()[0]
    if asked.plot:
        asked.plot.write_text(plot(found["shares"]), encoding="utf-8")
    if asked.peers:
        with engine("here", CORES) as here:
            found["times_as_many_motions"] = beside_peers(here)
    (ROOT / "build" / "sweeps.json").write_text(json.dumps(found, indent=1) + "\n")
    print(json.dumps(found, indent=1))


def _bytes(of: Plan, by: Engine) -> float:
    with tempfile.TemporaryDirectory(dir=ROOT / "build") as place:
        folder = Folder(place, True)
        return driven(of, by, folder, 0).bytes / of.design.size


if __name__ == "__main__":
    main()
