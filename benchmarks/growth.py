"""How time grows with the number of links: derivation, emission, compilation, loading, evaluation
of chains and random trees.

    python benchmarks/growth.py [10 30 100 300 1000] [--kinds chain,tree,kane,pinocchio] [--json
    FILE] [--plot FILE.svg]

Every mechanism runs in a process of its own with an empty cache; times are processor seconds, the
compiler's own included, so that other work on the machine shows as little as possible. The
exponents are between a tenth of the largest number of links and the largest. Beside them, as far as
they come within a minute of processor time and 8 GB: derivation by SymPy's KanesMethod (also for 2,
3, 5, 8, … links), and evaluation by Pinocchio's articulated-body algorithm where it is installed
(its Python call, some 2 µs, included). Rows that FILE already has and that were not measured now
are kept.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import random
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

LENGTHS = (10, 30, 100, 300, 1000)
FUNCTIONS = (
    "dynamics",
    "bias",
    "inverse_dynamics",
    "energy",
)  # the mass matrix has n² entries by itself
LONGEST = 60  # processor seconds for a peer
MOST = 8 << 30  # bytes for a peer: Pinocchio's data grow with the cube of the length
PEERS = {
    "kane": (2, 3, 5, 8, 12, 20, 30),
    "pinocchio": (),
}  # numbers of links besides those asked for
WIDTH, HEIGHT = 510, 420  # of one chart and the room around it
STAGES = ("derive", "program", "emit", "compile", "load", "evaluate")


def chain(n: int) -> str:
    """A planar pendulum of n equal links."""
    lines = ["model: chain", "plane: xy", "gravity: [0, -9.81 m/s^2]", "bodies:"]
    lines += [f"  b{i}: {{mass: 1.0, com: [0.5, 0], inertia: 0.08}}" for i in range(n)]
    lines.append("joints:")
    for i in range(n):
        parent, at = (f"b{i - 1}", 1.0) if i else ("ground", 0.0)
        lines.append(
            f"  j{i}: {{type: revolute, parent: {parent}, child: b{i}, at: [{at}, 0], coordinate: q{i}}}"
        )
    return "\n".join(lines) + "\n"


def tree(n: int) -> str:
    """A planar tree: each link hangs on the tip of one of those before it, drawn at random."""
    draw = random.Random(n)
    parents = [-1, *(draw.randrange(i) for i in range(1, n))]
    lines = chain(n).splitlines()
    first = len(lines) - n
    for i, above in enumerate(parents):
        parent, at = (f"b{above}", 1.0) if i else ("ground", 0.0)
        lines[first + i] = (
            f"  j{i}: {{type: revolute, parent: {parent}, child: b{i}, at: [{at}, 0], coordinate: q{i}}}"
        )
    return "\n".join(lines) + "\n"


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("lengths", nargs="*", type=int, default=list(LENGTHS))
    options.add_argument("--kinds", default="chain,tree,kane,pinocchio")
    options.add_argument("--json", type=Path)
    options.add_argument("--plot", type=Path)
    options.add_argument("--one", help=argparse.SUPPRESS)
    chosen = options.parse_args()
    if chosen.one:
        kind, n = chosen.one.split(",")
        if kind in PEERS:
            resource.setrlimit(resource.RLIMIT_CPU, (LONGEST, LONGEST))
            resource.setrlimit(resource.RLIMIT_AS, (MOST, MOST))
        print(json.dumps(KINDS[kind](int(n))))
        return
    found = json.loads(chosen.json.read_text()) if chosen.json and chosen.json.exists() else {}
    for kind in chosen.kinds.split(","):
        new = _series(kind, chosen.lengths)
        kept = [
            row for row in found.get(kind, []) if row["links"] not in {row["links"] for row in new}
        ]
        found[kind] = sorted([*kept, *new], key=lambda row: row["links"])
        if chosen.json:
            _write(chosen.json, json.dumps(found, indent=1) + "\n")
    if chosen.plot:
        _write(chosen.plot, _drawn(found))


def _write(place: Path, text: str) -> None:
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_text(text)


def _series(kind: str, lengths: list[int]) -> list[dict[str, Any]]:
    """One kind, length after length, until one cannot be had."""
    print(
        f"\n{kind}\n{'links':>6}"
        + "".join(f"{name:>11}" for name in (*STAGES, "wall", "MB", "operations"))
        + "   (s; evaluate in ns)"
    )
    rows: list[dict[str, Any]] = []
    for n in lengths if kind not in PEERS else sorted({*lengths, *PEERS[kind]}):
        row = _apart(kind, n)
        if row is None:
            print(f"{n:6d}  not reached")
            break
        rows.append(row)
        print(_row(row), flush=True)
    if len(rows) > 1 and kind not in PEERS:
        print("growth " + _exponents(rows))
    return rows


def _apart(kind: str, n: int) -> dict[str, Any] | None:
    """One length in a fresh process; None where it takes too long or is not installed."""
    command = [sys.executable, __file__, "--one", f"{kind},{n}"]
    run = subprocess.run(command, capture_output=True, check=False, text=True)
    if run.returncode and kind not in PEERS:
        sys.exit(run.stderr)
    if run.returncode:
        return None
    return json.loads(run.stdout)


def _row(row: dict[str, Any]) -> str:
    def cell(name: str, width: int, digits: int, scale: float = 1.0) -> str:
        return f"{row[name] * scale:{width}.{digits}f}" if name in row else " " * (width - 1) + "–"

    times = "".join(cell(stage, 11, 2) for stage in STAGES[:-1])
    rest = (
        cell("evaluate", 11, 0, 1e9)
        + cell("wall", 11, 1)
        + cell("MB", 11, 0)
        + cell("operations", 11, 0)
    )
    return f"{row['links']:6d}{times}{rest}"


def _exponents(rows: list[dict[str, Any]]) -> str:
    """Of each stage, from the largest mechanism of at most a tenth of the largest to the
    largest."""
    last = rows[-1]
    first = next(
        row for row in reversed(rows[:-1]) if row["links"] * 10 <= last["links"] or row is rows[0]
    )
    ratio = math.log(last["links"] / first["links"])
    found = (
        f"{stage} {math.log(last[stage] / first[stage]) / ratio:.2f}"
        for stage in STAGES
        if first[stage] > 0 < last[stage]
    )
    return f"from {first['links']} to {last['links']} links, n to the power of: " + ", ".join(found)


def _drawn(found: dict[str, list[dict[str, Any]]]) -> str:
    """Four charts, both axes logarithmic, two by two."""
    from hamel.draw import Series, chart

    def series(kind: str, name: str) -> Series:
        return Series(
            LABELS[kind], [(row["links"], row[name]) for row in found[kind] if name in row]
        )

    parts = []
    for k, name in enumerate(("derive", "emit", "compile", "evaluate")):
        shown = [kind for kind in KINDS if any(name in row for row in found.get(kind, []))]
        title = (
            f"{name[0].upper()}{name[1:]}, processor seconds"
            if name != "evaluate"
            else "Evaluate forward dynamics, seconds"
        )
        drawn = chart(title, "links", "s", [series(kind, name) for kind in shown])
        parts.append(drawn.replace("<svg ", f'<svg x="{k % 2 * WIDTH}" y="{k // 2 * HEIGHT}" ', 1))
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {2 * WIDTH} {2 * HEIGHT}" role="img">'
    return f'{head}\n<rect width="100%" height="100%" fill="#fff"/>\n{"".join(parts)}</svg>\n'


def measured(text: str, n: int) -> dict[str, Any]:
    """All stages of one mechanism; `wall` and `MB` are of the whole, compiler included."""
    from codegen import loader
    from codegen.emit import emit
    from codegen.passes import program
    from derive.formulations import equations
    from derive.model import load
    from derive.states import system
    from hamel.build.module import published

    row: dict[str, Any] = {"links": n}
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = folder
        path = Path(folder, "chain.yaml")
        path.write_text(text)
        start = time.perf_counter()
        derived = _timed(row, "derive", lambda: equations(system(load(path), "all")))
        made = _timed(row, "program", lambda: program(derived, FUNCTIONS))
        _timed(row, "emit", lambda: emit(made))
        built = _timed(row, "compile", lambda: published(made, Path(folder, "chain")))
        row["compile"] -= row["emit"]
        module = _timed(row, "load", lambda: loader.load(built.folder))
        row["wall"] = time.perf_counter() - start
        row["evaluate"] = _evaluation(module)
    row["operations"] = sum(kernel.operations["total"] for kernel in made.kernels)
    row["MB"] = (
        max(
            resource.getrusage(who).ru_maxrss
            for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
        )
        // 1024
    )
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


def kane(n: int) -> dict[str, Any]:
    """Kane's equations of the same chain, formed by SymPy and not simplified."""
    from sympy import symbols
    from sympy.physics.mechanics import (
        KanesMethod,
        Point,
        ReferenceFrame,
        RigidBody,
        dynamicsymbols,
        inertia,
    )

    start = _processor()
    q, w = dynamicsymbols(f"q:{n}"), dynamicsymbols(f"w:{n}")
    g, t = symbols("g"), dynamicsymbols._t
    ground, joint = ReferenceFrame("N"), Point("O")
    joint.set_vel(ground, 0)
    bodies, loads, frame = [], [], ground
    for i in range(n):
        turned = frame.orientnew(f"A{i}", "axis", [q[i], ground.z])
        turned.set_ang_vel(frame, w[i] * ground.z)
        centre, tip = joint.locatenew(f"C{i}", turned.x / 2), joint.locatenew(f"P{i}", turned.x)
        centre.v2pt_theory(joint, ground, turned)
        tip.v2pt_theory(joint, ground, turned)
        bodies.append(
            RigidBody(f"B{i}", centre, turned, 1.0, (inertia(turned, 0, 0, 0.08), centre))
        )
        loads.append((centre, -g * ground.y))
        frame, joint = turned, tip
    KanesMethod(ground, q, w, [a.diff(t) - b for a, b in zip(q, w)]).kanes_equations(bodies, loads)
    return {"links": n, "derive": _processor() - start}


def pinocchio(n: int) -> dict[str, Any]:
    """Pinocchio's `aba` on the same chain."""
    import numpy as np
    import pinocchio as pin  # pyright: ignore[reportMissingImports]

    model, parent, place = pin.Model(), 0, pin.SE3.Identity()
    for i in range(n):
        parent = model.addJoint(parent, pin.JointModelRZ(), place, f"j{i}")
        body = pin.Inertia(1.0, np.array([0.5, 0.0, 0.0]), np.diag([0.0, 0.08, 0.08]))
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        place = pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0]))
    data, x = model.createData(), np.full(n, 0.1)
    return {
        "links": n,
        "evaluate": min(_elapsed(lambda: pin.aba(model, data, x, x, x)) for _ in range(200)),
    }


def _elapsed(work: Callable[[], Any]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


KINDS: dict[str, Callable[[int], dict[str, Any]]] = {
    "chain": lambda n: measured(chain(n), n),
    "tree": lambda n: measured(tree(n), n),
    "kane": kane,
    "pinocchio": pinocchio,
}
LABELS = {
    "chain": "hamel, chain",
    "tree": "hamel, tree",
    "kane": "KanesMethod",
    "pinocchio": "Pinocchio aba",
}


if __name__ == "__main__":
    main()
