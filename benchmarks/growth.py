"""How time grows with the number of links of a planar chain: derivation, emission, compilation, loading, evaluation.

    python benchmarks/growth.py [10 30 100 300 1000] [--json FILE]

Every length runs in a process of its own with an empty cache; times are processor seconds, the compiler's own included, so that
other work on the machine shows as little as possible. The exponents are between a tenth of the largest length and the largest.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

LENGTHS = (10, 30, 100, 300, 1000)
FUNCTIONS = ("dynamics", "bias", "inverse_dynamics", "energy")  # the mass matrix has n² entries by itself
STAGES = ("derive", "program", "emit", "compile", "load", "evaluate")


def chain(n: int) -> str:
    """A planar pendulum of n equal links."""
    lines = ["model: chain", "plane: xy", "gravity: [0, -9.81 m/s^2]", "bodies:"]
    lines += [f"  b{i}: {{mass: 1.0, com: [0.5, 0], inertia: 0.08}}" for i in range(n)]
    lines.append("joints:")
    for i in range(n):
        parent, at = (f"b{i - 1}", 1.0) if i else ("ground", 0.0)
        lines.append(f"  j{i}: {{type: revolute, parent: {parent}, child: b{i}, at: [{at}, 0], coordinate: q{i}}}")
    return "\n".join(lines) + "\n"


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("lengths", nargs="*", type=int, default=list(LENGTHS))
    options.add_argument("--json", type=Path)
    options.add_argument("--one", type=int, help=argparse.SUPPRESS)
    chosen = options.parse_args()
    if chosen.one:
        print(json.dumps(measured(chosen.one)))
        return
    rows = []
    print(f"{'links':>6}" + "".join(f"{name:>11}" for name in (*STAGES, "wall", "MB", "operations")) + "   (s; evaluate in ns)")
    for n in chosen.lengths:
        rows.append(_apart(n))
        print(_row(rows[-1]), flush=True)
    if len(rows) > 1:
        print("growth " + _exponents(rows))
    if chosen.json:
        chosen.json.write_text(json.dumps(rows, indent=1) + "\n")


def _apart(n: int) -> dict[str, Any]:
    """One length in a fresh process."""
    run = subprocess.run([sys.executable, __file__, "--one", str(n)], stdout=subprocess.PIPE, check=True, text=True)
    return json.loads(run.stdout)


def _row(row: dict[str, Any]) -> str:
    times = "".join(f"{row[stage]:11.2f}" for stage in STAGES[:-1])
    return f"{row['links']:6d}{times}{row['evaluate'] * 1e9:11.0f}{row['wall']:11.1f}{row['MB']:11d}{row['operations']:11d}"


def _exponents(rows: list[dict[str, Any]]) -> str:
    """Of each stage, from the longest chain of a tenth of the largest length to the largest."""
    last = rows[-1]
    first = next(row for row in reversed(rows[:-1]) if row["links"] * 10 <= last["links"] or row is rows[0])
    ratio = math.log(last["links"] / first["links"])
    found = (f"{stage} {math.log(last[stage] / first[stage]) / ratio:.2f}" for stage in STAGES if first[stage] > 0 < last[stage])
    return f"from {first['links']} to {last['links']} links, n to the power of: " + ", ".join(found)


def measured(n: int) -> dict[str, Any]:
    """All stages of one length; `wall` and `MB` are of the whole, compiler included."""
    from codegen import build, loader
    from codegen.passes import program
    from derive.formulations import equations
    from derive.mechanics import system
    from derive.model import load

    row: dict[str, Any] = {"links": n}
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = folder
        path = Path(folder, "chain.yaml")
        path.write_text(chain(n))
        start = time.perf_counter()
        derived = _timed(row, "derive", lambda: equations(system(load(path), "all")))
        made = _timed(row, "program", lambda: program(derived, FUNCTIONS))
        _timed(row, "emit", lambda: build.emit(made))
        built = _timed(row, "compile", lambda: build.build(made, Path(folder, "chain")))
        row["compile"] -= row["emit"]
        module = _timed(row, "load", lambda: loader.load(built.folder))
        row["wall"] = time.perf_counter() - start
        row["evaluate"] = _evaluation(module)
    row["operations"] = sum(kernel.operations["total"] for kernel in made.kernels)
    row["MB"] = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)) // 1024
    return row


def _timed(row: dict[str, Any], stage: str, work: Callable[[], Any]) -> Any:
    start = _processor()
    result = work()
    row[stage] = _processor() - start
    return result


def _processor() -> float:
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def _evaluation(module: Any) -> float:
    """Least time of one forward dynamics, in seconds; the Python call (some 40 ns) included."""
    import numpy as np

    x, out = np.full(module.nx, 0.1), np.empty(module.nx)
    least = math.inf
    for _ in range(200):
        start = time.perf_counter()
        module.dynamics(0.0, x, out=out)
        least = min(least, time.perf_counter() - start)
    return least


if __name__ == "__main__":
    main()
