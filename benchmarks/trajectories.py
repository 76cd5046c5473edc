"""make whole, second part: one motion to three errors at the end, beside heyoka, into
build/whole.json.

    python benchmarks/trajectories.py [MODEL …]

Everybody gets the tolerance that meets the error in the least time. The error is that of the state
at the end against a solution of many digits, relative to the largest coordinate or velocity, and to
one at least.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from peers import series, simulations
from peers.contest import BUILD, Unavailable, pinned
from peers.simulations import Chosen, Simulation, in_turn

from codegen.passes import program
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.mechanics.records import System
from derive.model import load
from derive.states import system
from derive.states.initial import Initial, initial_state
from hamel.settings import settings
from hamel.simulate.exact import Problem, solution, state_of

OUT = Path("build/whole.json")
ERRORS = (1e-8, 1e-10, 1e-13)
ROUNDS, ROUND = 40, 2.0  # how often each is timed in turn, and for how many ms
OWN, OURS = "its own equations", "our program"
WHY = "in one motion each operation waits for the one before: docs/methods.md, Taylor series"


@dataclass(frozen=True)
class Scene:
    name: str
    span: float
    values: dict[str, float]
    targets: dict[str, tuple[float, float, float]]  # by the peer's equations, for each error
    links: int = 0  # of a chain that is made here


SCENES = (
    Scene("chain2", 5.0, {}, {OWN: (0.6, 0.5, 0.4)}, 2),
    Scene("chain5", 2.0, {}, {OWN: (0.25, 0.25, 0.25)}, 5),
    Scene(
        "snake3", 1.0, {"tau1": 0.01, "tau2": -0.02, "base.vx": 0.3}, {OURS: (0.4, 0.4, 0.4)}
    ),
    Scene("four_bar", 1.0, {}, {OURS: (0.45, 0.45, 0.45)}),
)  # fmt: skip


class Site:
    """A scene with its equations, all numbers folded in, its start, and where it ends."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.mechanics: System = system(load(_file(scene)), "all")
        given = settings(self.mechanics.model, dict(scene.values))
        self.u = np.array([*given.inputs.values()])
        self.initial = initial_state(self.mechanics, given.initial)
        self.equations: Equations = equations(self.mechanics)
        self.x = self._state(self.initial)
        self.end = self._end(tuple(given.initial))
        nq = self.mechanics.q.numel()
        q, v = np.abs(self.end[:nq]).max(), np.abs(self.end[nq:]).max()
        self.scales = np.repeat([max(1.0, q), max(1.0, v)], [nq, len(self.end) - nq])

    def error(self, end: np.ndarray) -> float:
        return float(np.max(np.abs(end - self.end) / self.scales))

    def _state(self, initial: Initial) -> np.ndarray:
        return np.array(state_of(self.equations, initial, np.zeros(0)), dtype=float)

    def _end(self, held: tuple[str, ...]) -> np.ndarray:
        problem = Problem(self.equations, tuple(self.x), tuple(map(float, self.u)), (), held)
        found = solution(problem, [self.scene.span], 18).at(0)
        model = self.mechanics.model
        q = np.array([float(found[c.name]) for c in model.coordinates])
        v = np.array([float(found[c.name]) for c in model.velocities])
        return self._state(replace(self.initial, q=q, v=v))


def _file(scene: Scene) -> Path:
    return _chain(scene.links) if scene.links else Path("models") / f"{scene.name}.yaml"


def _chain(n: int) -> Path:
    """n rods that start at rest, the first near the horizontal."""
    lines = [f"model: chain{n}", "plane: xy", "gravity: [0, -9.81 m/s^2]", "bodies:"]
    lines += [f"  b{i}: {{mass: 1 kg, com: [0.5 m, 0], inertia: 0.08 kg*m^2}}" for i in range(n)]
    lines.append("joints:")
    for i in range(n):
        parent, at = (f"b{i - 1}", "1 m") if i else ("ground", "0")
        place = f"parent: {parent}, child: b{i}, at: [{at}, 0]"
        lines.append(f"  j{i}: {{type: revolute, {place}, coordinate: q{i}}}")
    angles = ", ".join(f"q{i}: {0.2 if i else -0.5} rad, der(q{i}): 0 rad/s" for i in range(n))
    lines.append(f"initial: {{{angles}}}")
    place = BUILD / "whole" / f"chain{n}.yaml"
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_text("\n".join(lines) + "\n")
    return place


def ours(site: Site) -> Iterator[Simulation]:
    """With nothing to watch, by each integrator."""
    span = site.scene.span
    for each in simulations.ours(site.equations, site.x, site.u, lambda x: x, span):
        if each.variant.endswith("lean"):
            yield each


def theirs(site: Site) -> Iterator[Simulation]:
    """On our program; on its own equations where it can derive them."""
    made, span = program(site.equations, ("dynamics",), ("verner9",)), site.scene.span
    yield series.simulation(OURS, series.of_program(made, site.u), site.x, span, lambda x: x)
    n = site.scene.links
    if n:
        turned = np.concatenate([np.cumsum(site.x[:n]), np.cumsum(site.x[n:])])
        yield series.simulation(OWN, series.of_chain(n), turned, span, _relative)


def _relative(end: np.ndarray) -> np.ndarray:
    """Angles and rates between the links from those of the links."""
    q, v = np.split(end, 2)
    return np.concatenate([np.diff(q, prepend=0.0), np.diff(v, prepend=0.0)])


def tuned(of: Simulation, error: Callable[[np.ndarray], float]) -> dict[float, Chosen]:
    """For each error the setting that meets it in the least time."""
    best: dict[float, Chosen] = {}
    for setting in of.settings:
        made = of.run(setting, 3)
        if made is None:
            continue
        wrong = error(made[1])
        for most in ERRORS:
            if wrong <= most and (most not in best or made[0] < best[most].ms):
                best[most] = Chosen(of, setting, made[0], wrong)
        if len(best) == len(ERRORS) and made[0] > 2.0 * best[ERRORS[-1]].ms:
            break
    return best


def rows(scene: Scene) -> Iterator[dict[str, Any]]:
    site = Site(scene)
    own = [tuned(each, site.error) for each in ours(site)]
    other = [tuned(each, site.error) for each in theirs(site)]
    for k, most in enumerate(ERRORS):
        mine, peers = ([c[most] for c in found if most in c] for found in (own, other))
        ms = in_turn([*mine, *peers], ROUNDS, ROUND)
        if not mine:
            continue
        fastest = min(range(len(mine)), key=lambda i: ms[i])
        for c, peer_ms in zip(peers, ms[len(mine) :]):
            yield _row(scene, k, (mine[fastest], ms[fastest]), (c, peer_ms))


def _row(
    scene: Scene, k: int, mine: tuple[Chosen, float], peer: tuple[Chosen, float]
) -> dict[str, Any]:
    ratio = mine[1] / peer[1]
    target = scene.targets.get(peer[0].simulation.variant, (None,) * len(ERRORS))[k]
    missed = target is not None and ratio > target
    return {
        "function": f"one motion to {ERRORS[k]:.0e}",
        "model": scene.name,
        "peer": f"{series.PEER}, {peer[0].simulation.variant}",
        "ours_ns": 1e6 * mine[1],
        "peer_ns": 1e6 * peer[1],
        "ratio": ratio,
        "target": target,
        "met": None if target is None else ratio <= target,
        "ours": mine[0].simulation.variant,
        **({"why": WHY} if missed else {}),
    }


def line(row: dict[str, Any]) -> str:
    target = f"{row['target']:.2f}" if row["target"] else "–"
    met = {True: "met", False: "MISSED", None: ""}[row["met"]]
    times = f"{row['ours_ns'] / 1e3:9.1f}{row['peer_ns'] / 1e3:9.1f}{row['ratio']:8.2f}{target:>8}"
    return f"{row['model']:10}{row['function']:22}{row['peer']:40}{times}  {met:7}{row['ours']}"


def main(names: Sequence[str]) -> int:
    unknown = [name for name in names if name not in [scene.name for scene in SCENES]]
    if unknown:
        known = ", ".join(scene.name for scene in SCENES)
        print(f"trajectories: no model {unknown[0]!r}; there are {known}", file=sys.stderr)
        return 2
    print(f"heyoka {series.version()}; times in µs, the least of {ROUNDS} rounds side by side")
    pinned()
    for scene in SCENES:
        if names and scene.name not in names:
            continue
        found = list(rows(scene))
        for row in found:
            print(line(row), flush=True)
        _kept(scene, found)
    return 0


def _kept(scene: Scene, found: Sequence[dict[str, Any]]) -> None:
    """Beside the other rows of build/whole.json."""
    before = json.loads(OUT.read_text()) if OUT.exists() else []
    others = [
        row
        for row in before
        if row["model"] != scene.name or not row.get("function", "").startswith("one motion")
    ]
    OUT.parent.mkdir(exist_ok=True)
    OUT.write_text(json.dumps([*others, *found], indent=1, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except Unavailable as error:
        sys.exit(f"trajectories: {error}")
