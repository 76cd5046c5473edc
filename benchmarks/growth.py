"""How time grows with the number of links: every stage from the file to a verified module, and
evaluation, of chains, trees and rows of loops.

    python benchmarks/growth.py [10 100 1000 10000] [--kinds planar,oblique,tree,rope,loops,pinocchio]
    [--json FILE] [--plot FILE.svg]

Every mechanism runs in a process of its own with an empty cache; times are processor seconds, the
compiler's own included, so that other work on the machine shows as little as possible. The
exponents are between a tenth of the largest number of links and the largest, and for those that
reach 10,000 between 100 and it. Beside them, as far as they come within a minute of processor time
and 8 GB: derivation by SymPy's KanesMethod, and one forward dynamics by Pinocchio, MuJoCo and
Exudyn where they are installed (the call from Python, some 2 µs, included). Rows that FILE already
has and that were not measured now are kept.
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
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from peers import long

LENGTHS = (10, 30, 100, 300, 1000, 3000, 10_000)
# what is made of a long tree by default and computes something
FUNCTIONS = ("dynamics", "bias", "inverse_dynamics", "power", "state")
LONGEST = 60  # processor seconds for a peer
MOST = 8 << 30  # bytes for a peer: Pinocchio's data grow with the cube of the length
FEW = (2, 3, 5, 8, 12)  # links besides those asked for, of a peer that does not come far
ROWS = 64  # states side by side
STAGES = ("model", "mechanics", "formulation", "passes", "emit", "compile", "verify")
SPEEDS = ("evaluate", "lanes")
LOOPS = 1_000  # the most that are looked at


def planar(n: int) -> str:
    """A planar pendulum of n equal links."""
    lines = [
        "model: planar",
        "plane: xy",
        "gravity: [0, -9.81 m/s^2]",
        f"repeat: {{i: 0..{n - 1}, j: 1..{n - 1}}}",
    ]
    lines += ["bodies:", '  "b{i}": {mass: 1.0, com: [0.5, 0], inertia: 0.08}', "joints:"]
    lines.append("  j0: {type: revolute, parent: ground, child: b0, coordinate: q0}")
    lines.append(
        '  "j{j}": {type: revolute, parent: "b{j-1}", child: "b{j}", at: [1.0, 0], coordinate: "q{j}"}'
    )
    return "\n".join(lines) + "\n"


def rope(n: int) -> str:
    """Equal links on ball joints."""
    body = "{mass: 0.1 kg, com: [0.05, 0, 0], inertia: [1e-5, 1e-4, 1e-4]}"
    return f"""model: rope
gravity: [0, 0, -9.81 m/s^2]
repeat: {{i: 1..{n - 1}}}
bodies: {{b0: {body}, "b{{i}}": {body}}}
joints:
  j0: {{type: ball, parent: ground, child: b0}}
  "j{{i}}": {{type: ball, parent: "b{{i-1}}", child: "b{{i}}", at: [0.1, 0, 0]}}
"""


def loops(n: int) -> str:
    """A row of n four-bars, each hinged to the next (IFToMM benchmark A02)."""
    text = (MODELS / "gallery" / "forty_four_bars.yaml").read_text(encoding="utf-8")
    return text.replace("1..40", f"1..{n}").replace("0..40", f"0..{n}")


def oblique(n: int) -> str:
    """A chain of turning links, placed and weighted at random."""
    return _robot(range(-1, n - 1), lambda draw: "continuous")


def tree(n: int) -> str:
    """Each link hangs on one of those before it, drawn at random; two thirds turn, the others
    slide."""
    draw = random.Random(n)
    parents = [-1, *(draw.randrange(i) for i in range(1, n))]
    return _robot(parents, lambda draw: draw.choice(("continuous", "continuous", "prismatic")))


def _robot(parents: Any, kind: Callable[[random.Random], str]) -> str:
    draw = random.Random(1)

    def numbers(size: float) -> str:
        return " ".join(str(draw.uniform(-size, size)) for _ in range(3))

    parts = ['<robot name="links"><link name="base"/>']
    for i, above in enumerate(parents):
        inertia = " ".join(
            f'{name}="{draw.uniform(0.013, 0.02)}"' for name in ("ixx", "iyy", "izz")
        )
        parts.append(
            f'<link name="l{i}"><inertial><origin xyz="{numbers(0.1)}"/><mass value="{draw.uniform(0.5, 2)}"/>'
            f'<inertia {inertia} ixy="0.001" ixz="-0.0005" iyz="0.0002"/></inertial></link>'
            f'<joint name="j{i}" type="{kind(draw)}"><parent link="{f"l{above}" if above >= 0 else "base"}"/>'
            f'<child link="l{i}"/><origin xyz="{numbers(0.3)}" rpy="{numbers(3.0)}"/><axis xyz="0 0 1"/>'
            '<limit effort="1" velocity="1" lower="-1" upper="1"/></joint>'
        )
    return "".join(parts) + "</robot>"


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("lengths", nargs="*", type=int, default=list(LENGTHS))
    options.add_argument("--kinds", default=",".join(KINDS))
    options.add_argument("--json", type=Path)
    options.add_argument("--plot", type=Path)
    options.add_argument("--one", help=argparse.SUPPRESS)
    chosen = options.parse_args()
    if chosen.one:
        kind, n = chosen.one.split(",")
        warnings.simplefilter("ignore")  # limits of joints, a hundred times
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
        + "".join(f"{name:>12}" for name in (*STAGES, *SPEEDS, "wall", "MB", "operations"))
        + "   (s; evaluate and lanes in ns a link)"
    )
    rows: list[dict[str, Any]] = []
    if kind == "loops":
        lengths = [n for n in lengths if n <= LOOPS]
    for n in lengths if kind not in PEERS else sorted({*lengths, *FEW}):
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
    def cell(name: str, digits: int, scale: float = 1.0) -> str:
        return f"{row[name] * scale:12.{digits}f}" if name in row else " " * 11 + "–"

    times = "".join(cell(stage, 2) for stage in STAGES)
    speeds = "".join(cell(name, 1, 1e9 / row["links"]) for name in SPEEDS)
    rest = cell("wall", 1) + cell("MB", 0) + cell("operations", 0)
    return f"{row['links']:6d}{times}{speeds}{rest}"


def _exponents(rows: list[dict[str, Any]]) -> str:
    """Of each stage, from the largest mechanism of at most a tenth of the largest to the
    largest."""
    last = rows[-1]
    share = 100 if last["links"] >= 10_000 else 10
    first = next(
        row
        for row in reversed(rows[:-1])
        if row["links"] * share <= last["links"] or row is rows[0]
    )
    ratio = math.log(last["links"] / first["links"])
    found = (
        f"{stage} {math.log(last[stage] / first[stage]) / ratio:.2f}"
        for stage in (*STAGES, *SPEEDS)
        if first.get(stage, 0) > 0 < last.get(stage, 0)
    )
    return f"from {first['links']} to {last['links']} links, n to the power of: " + ", ".join(found)


def _drawn(found: dict[str, list[dict[str, Any]]]) -> str:
    """Four charts, both axes logarithmic, two by two: how long until a module is there, by stages;
    its forward dynamics."""
    from hamel.draw import Series, chart, side_by_side

    def series(kind: str, name: str) -> Series:
        return Series(
            LABELS[kind], [(row["links"], row[name]) for row in found[kind] if name in row]
        )

    charts = []
    for name, title in CHARTS.items():
        shown = [kind for kind in KINDS if any(name in row for row in found.get(kind, []))]
        charts.append(chart(title, "links", "s", [series(kind, name) for kind in shown]))
    return side_by_side(charts)


def measured(text: str, n: int) -> dict[str, Any]:
    """All stages of one mechanism; `wall` and `MB` are of the whole, compiler included."""
    from codegen import loader
    from codegen.emit import emit
    from codegen.passes import program
    from derive.formulations import equations
    from derive.robots.reading import load
    from derive.states import system
    from hamel.build.module import published
    from hamel.build.options import affordable
    from hamel.verify import quick_verification

    row: dict[str, Any] = {"links": n}
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = folder
        path = Path(folder, "links.urdf" if text.startswith("<") else "links.yaml")
        path.write_text(text)
        start = time.perf_counter()
        model = _timed(row, "model", lambda: load(path))
        mechanics = _timed(row, "mechanics", lambda: system(model, "all"))
        derived = _timed(row, "formulation", lambda: equations(mechanics))
        made = _timed(row, "passes", lambda: program(derived, FUNCTIONS))
        _timed(row, "emit", lambda: emit(made))
        built = _timed(row, "compile", lambda: published(made, Path(folder, "links")))
        row["compile"] -= row["emit"]
        module = loader.load(built.folder)
        states = affordable(derived, 20)
        checked = _timed(
            row, "verify", lambda: quick_verification(model, derived, lambda: module, states)
        )
        if not checked.passed:
            sys.exit(f"{n} links: wrong in {[x for x in checked.checks if not x.passed]}")
        row["wall"] = time.perf_counter() - start
        row |= dict(zip(SPEEDS, _evaluation(module, derived)))
    row["operations"] = made.kernel("dynamics").operations["total"]
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


def _evaluation(module: Any, derived: Any) -> tuple[float, float]:
    """Least time of one forward dynamics, alone and of many side by side, in seconds; the Python
    call (some 40 ns) included."""
    import numpy as np

    from derive.states.sampling import states

    s = states(derived.system, 1)
    x = module.state(0.0, np.concatenate([s.q[0], s.v[0]]), s.u[0])
    rows, u = np.tile(x, (ROWS, 1)), s.u[0]
    out, many = np.empty(module.nx), np.empty((ROWS, module.nx))
    alone = min(_elapsed(lambda: module.dynamics(0.0, x, u, out=out)) for _ in range(200))
    side = min(_elapsed(lambda: module.dynamics(0.0, rows, u, out=many)) for _ in range(20))
    return alone, side / ROWS


def _elapsed(work: Callable[[], Any]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def _kane(n: int) -> dict[str, Any]:
    start = _processor()
    long.kane(n)
    return {"links": n, "formulation": _processor() - start}


def _peer(
    peer: Callable[[str], Callable[[], Any]], text: Callable[[int], str], steps: int = 1
) -> Callable[[int], dict[str, Any]]:
    """The least time of many calls; one does so many `steps`."""

    def run(n: int) -> dict[str, Any]:
        work = peer(text(n))
        return {"links": n, "evaluate": min(_elapsed(work) for _ in range(100)) / steps}

    return run


MODELS = Path(__file__).resolve().parent.parent / "models"
KINDS: dict[str, Callable[[int], dict[str, Any]]] = {
    "planar": lambda n: measured(planar(n), n),
    "oblique": lambda n: measured(oblique(n), n),
    "tree": lambda n: measured(tree(n), n),
    "rope": lambda n: measured(rope(n), n),
    "loops": lambda n: measured(loops(n), n),
    "kane": _kane,
    "pinocchio": _peer(long.pinocchio, oblique),
    "pinocchio_tree": _peer(long.pinocchio, tree),
    "mujoco": _peer(long.mujoco, oblique),
    "exudyn": _peer(long.exudyn, oblique, long.STEPS),
}
PEERS = tuple(KINDS)[5:]
LABELS = {
    "planar": "planar chain",
    "oblique": "oblique chain",
    "tree": "tree",
    "rope": "rope of ball joints",
    "loops": "four-bars in a row",
    "kane": "KanesMethod, planar",
    "pinocchio": "Pinocchio, oblique",
    "pinocchio_tree": "Pinocchio, tree",
    "mujoco": "MuJoCo, oblique",
    "exudyn": "Exudyn, oblique",
}
CHARTS = {
    "formulation": "System → equations, processor seconds",
    "passes": "Equations → program, processor seconds",
    "wall": "File → verified module, seconds",
    "evaluate": "Forward dynamics of one state, seconds",
}


if __name__ == "__main__":
    main()
