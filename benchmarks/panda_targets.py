"""What targets cost for the Panda arm. The external functions of the CasADi target beside C that
CasADi makes of Pinocchio on casadi::SX: forward dynamics with its Jacobians, both through
`casadi.external`, as a ratio of least times taken in turn. And the instructions of `dynamics` on a
Cortex-M7 in QEMU beside its operations and loads. Writes build/panda_targets.json; 4 where a ratio
is above its limit.

Run by `make target-speed`: with Pinocchio and the robots of example-robot-data installed.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from peers import pinocchio
from peers.contest import PLAIN
from peers.robot import robot
from robots import Peer, robots
from target_speed import least

from codegen import compiler
from derive.robots.reading import imported
from hamel.build.module import published
from hamel.build.options import BuildOptions
from hamel.build.stages import equations_of, program_for
from hamel.verbs.verify import target_subject
from hamel.verify.targets import cortex_m
from hamel.verify.targets.records import generated

EXTERNAL = "CasADi external with Jacobian / CasADi's C of Pinocchio"
INSTRUCTIONS = "Cortex-M7 instructions / (operations + loads)"
LIMITS = {EXTERNAL: 0.5, INSTRUCTIONS: 1.3}
PROCESSOR = "cortex-m7"
STATES, TURNS = 200, 300
CLOSE = 1e-9  # relative, of what both compute


class Panda:
    """The arm, Pinocchio's tree of it, and random states of both; `columns`: where Pinocchio's
    velocities stand among ours."""

    def __init__(self) -> None:
        self.file = robot("panda", robots())
        found = imported(self.file, False)
        peer, random = Peer(self.file, False, found), np.random.default_rng(1)
        drawn = [peer.state(random) for _ in range(STATES)]
        self.q, self.v, self.pin_q = (
            np.array([getattr(s, part) for s in drawn]).T for part in ("q", "v", "pin_q")
        )
        self.u = random.normal(size=self.v.shape)
        self.columns = peer.columns
        self.tree = pinocchio.written(peer.model, "panda")


def ours(panda: Panda, base: Path) -> tuple[ca.Function, ca.Function]:
    """ẋ, ∂ẋ/∂x and ∂ẋ/∂u by the compiled function and its Jacobian; and by `derivatives` at once."""
    options = BuildOptions(functions=("dynamics",), targets=("casadi",), constants="all")
    program = program_for(equations_of(panda.file, constants="all"), options)
    folder = published(program, base / program.name).folder
    place = type("Place", (), {"name": program.name, "folder": folder})
    symbols: Any = generated(place, "casadi")  # pyright: ignore[reportArgumentType]
    library = folder / compiler.shared_library(program.name)
    fast, at_once = (symbols.external(name, library) for name in ("dynamics", "derivatives"))
    t, x, u, p = (ca.MX.sym(name, fast.size1_in(k)) for k, name in enumerate("txup"))
    rates = fast(t, x, u, p)
    slopes = fast.jacobian().call([t, x, u, p, rates])
    return ca.Function("ours", [t, x, u, p], [rates, slopes[1], slopes[2]]), at_once


def theirs(panda: Panda, base: Path) -> dict[str, ca.Function]:
    """Pinocchio's, with everyday flags and with all of ours."""
    found = {}
    flags = {"-O2": PLAIN, "our flags": (*compiler.FLAGS, *compiler.probe(("gcc",))[0])}
    for source in pinocchio.slopes(panda.tree):
        for name, options in flags.items():
            library = base / f"{source.stem}-{len(found)}.so"
            asked = ["gcc", *options, "-fPIC", "-shared", str(source), "-lm", "-o", str(library)]
            subprocess.run(asked, check=True)
            found[f"{source.stem}, {name}"] = ca.external(source.stem, str(library))
    return found


def external(panda: Panda) -> float:
    """Our time in terms of the fastest of theirs. Raises ValueError where they disagree."""
    with tempfile.TemporaryDirectory() as base:
        (mine, at_once), peers = ours(panda, Path(base)), theirs(panda, Path(base))
        x, order = np.vstack([panda.q, panda.v]), panda.columns
        time_and_p = np.zeros((1, STATES)), np.zeros((mine.size1_in(3), STATES))
        given = [ca.DM(part) for part in (time_and_p[0], x, panda.u, time_and_p[1])]
        own = [ca.DM(part) for part in (panda.pin_q, panda.v[order], panda.u[order])]
        wide, whole = mine.map(STATES), at_once.map(STATES)
        mapped = {name: peer.map(STATES) for name, peer in peers.items()}
        error = max(_error(wide.call(given), peer.call(own), panda) for peer in mapped.values())
        if not error <= CLOSE:
            raise ValueError(f"they differ by {error:.1g}")
        calls: list[Callable[[], object]] = [lambda: wide.call(given), lambda: whole.call(given)]
        calls += [lambda peer=peer: peer.call(own) for peer in mapped.values()]
        times = [1e9 * t / STATES for t in least(*calls, turns=TURNS)]
    for name, ns in zip(("ours", "ours, in one call", *mapped), times):
        print(f"  {name:28} {ns:8.0f} ns")
    return times[0] / min(times[2:])


def main() -> int:
    """0 where both ratios are within their limits."""
    panda = Panda()
    found = {EXTERNAL: external(panda), INSTRUCTIONS: instructions(panda)}
    rows = [{"what": what, "ratio": found[what], "most": most} for what, most in LIMITS.items()]
    for what, ratio in found.items():
        word = "within" if ratio <= LIMITS[what] else "above"
        print(f"{what:60} {ratio:6.3f}  {word} {LIMITS[what]:g}")
    place = Path("build/panda_targets.json")
    place.parent.mkdir(exist_ok=True)
    place.write_text(json.dumps(rows, indent=1) + "\n")
    return 0 if all(found[what] <= most for what, most in LIMITS.items()) else 4


def instructions(panda: Panda) -> float:
    """Of `dynamics` in float32, per operation and load; loads are those of the machine code, of
    arguments and of numbers. Straight-line code: each of its instructions runs once."""
    options = BuildOptions(functions=("dynamics",), targets=("cortex-m",), real="float32")
    equations = equations_of(panda.file, constants="all")
    program = program_for(equations, options)
    with target_subject(equations, program, 1, 0) as subject:
        count, _ = cortex_m.measured(subject, PROCESSOR).cost["dynamics"]
        loads = _loads(subject.folder / "cortex-m", f"{program.name}_dynamics")
    operations = program.kernel("dynamics").operations["total"]
    return count / (operations + loads)


def _loads(folder: Path, function: str) -> int:
    """How many numbers the function loads, by its disassembly."""
    image = f"check-{PROCESSOR}.elf"
    subprocess.run(["make", "-s", image, f"CPU={PROCESSOR}"], cwd=folder, check=True)
    asked = [
        "arm-none-eabi-objdump",
        "-d",
        "--no-show-raw-insn",
        f"--disassemble={function}",
        image,
    ]
    done = subprocess.run(asked, cwd=folder, check=True, capture_output=True, text=True)
    words = [line.split()[1] for line in done.stdout.splitlines() if line.startswith("  ")]
    multiple = re.findall(r"vldmia\S*\s+\S+, {s(\d+)-s(\d+)}", done.stdout)
    several = sum(int(last) - int(first) for first, last in multiple)
    return several + sum(word.startswith(("vldr", "ldr", "vldmia")) for word in words)


def _error(mine: Sequence[ca.DM], peer: Sequence[ca.DM], panda: Panda) -> float:
    """The largest difference of v̇ and of its Jacobians, relative to the largest entry."""
    nv, order = panda.v.shape[0], panda.columns
    rates, by_x, by_u = (np.asarray(ca.densify(part)) for part in mine)
    blocks = by_x.reshape(2 * nv, STATES, 2 * nv)[nv:][order]
    drives = by_u.reshape(2 * nv, STATES, nv)[nv:][order]
    parts = [
        rates[nv:][order],
        blocks[:, :, :nv][:, :, order].reshape(nv, -1),
        blocks[:, :, nv:][:, :, order].reshape(nv, -1),
        drives[:, :, order].reshape(nv, -1),
    ]
    pairs = [(part, np.asarray(ca.densify(other))) for part, other in zip(parts, peer)]
    return max(float(np.max(np.abs(a - b)) / np.max(np.abs(b))) for a, b in pairs)


if __name__ == "__main__":
    sys.exit(main())
