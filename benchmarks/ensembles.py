"""make whole, third part: thousands of motions at a time, each to three errors at its end, beside
heyoka's batch mode, our own Taylor series, our own scalar loop, diffrax, SciPy and MuJoCo; what
threads and the estimate of the error cost. Into build/whole.json, and what each took for each error
into build/whole_curves.json.

    python benchmarks/ensembles.py [MODEL …]

Everybody gets the tolerance that meets the error in the least time. The error is that of the states
at the end of the first motions against solutions of many digits, relative to the largest coordinate
or velocity, and to one at least. Processor time of one core, but where threads are compared: there
the clock on the wall.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import json
import os
import resource
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import trajectories
from peers import ensembles, series
from peers.contest import BUILD, CORES, Unavailable, pinned
from peers.ensembles import Ensemble
from trajectories import ERRORS, OUT, OWN, Scene, Site

import hamel
from codegen import compiler
from codegen.passes import program
from hamel.simulate.exact import Problem, solution

CURVES = OUT.with_name("whole_curves.json")
MANY, CHECKED, TRIED = 4096, 3, 256  # motions; those compared with many digits; for the settings
ROUNDS = 5
INTEGRATORS = ("dop853", "verner9")
SERIES = ("taylor",)
LANES, SCALAR = "heyoka, batch mode", "our scalar loop"
WHY = {
    "heyoka": "right-hand side and sums over stages are as fast as the multiplications in them: "
    "docs/methods.md, Many motions at a time",
    "our scalar loop": "the scalar loop has four lanes, too, in its sines and sums: docs/methods.md, "
    "Many motions at a time",
    "threads": "two threads share a clock and a cache, or a busy machine: run alone",
    "estimate": "a second motion at another tolerance goes beside each: docs/methods.md, Many motions at "
    "a time",
    "projection": "a Newton step and two sets of constraints at the end of each step: docs/methods.md, Many "
    "motions at a time",
    "diffrax": "XLA makes vector instructions of the batch, too: docs/methods.md, Many motions at a "
    "time",
    "MuJoCo": "docs/methods.md, Many motions at a time",
}
COMPILING = "compiling"
COMPILED = 3.0  # s that the loop over lanes of the four-bar may take
LIBRARIES = ("heyoka", "diffrax", "jax", "scipy", "mujoco")
MORE = 1.25  # at most, with all that a prototype left out
FAR = 'events: {far: "q0 + q1 - 50 rad", beyond: "q0 + 60 rad"}'
PYTHON = 1e-8  # the error at which peers from Python are compared


@dataclass(frozen=True)
class Many:
    """A scene for many motions, and the most that ours may take of each peer's time."""

    scene: Scene
    targets: dict[str, tuple[float, float, float]]


SCENES = tuple(
    Many(scene, targets)
    for scene, targets in (
        (Scene("chain2", 5.0, {}, {}, 2), {OWN: (0.30, 0.30, 0.30), "program": (0.4, 0.4, 0.4)}),
        (Scene("chain5", 2.0, {}, {}, 5), {OWN: (0.11, 0.11, 0.11), "program": (0.2, 0.2, 0.2)}),
        (replace(trajectories.SCENES[2], span=5.0), {"program": (0.22, 0.22, 0.22)}),
        (replace(trajectories.SCENES[3], span=2.0), {"program": (0.32, 0.32, 0.32)}),
        (Scene("andrews", 0.03, {}, {}), {}),
        (Scene("bicycle", 1.0, {}, {}), {}),
    )
)


class Place:
    """A scene with its module and the starts of its motions: the scene's own, and others around."""

    def __init__(self, many: Many) -> None:
        self.many, self.site = many, Site(many.scene)
        self.tried: dict[str, list[tuple[float, float]]] = {}  # by peer, µs a motion and the error
        self.folder = built(trajectories._file(many.scene), self.site, many.scene.name)
        self.module: ModuleType = hamel.load(self.folder)
        self.starts = self._starts()
        self.ends = np.array([self._end(x) for x in self.starts[:CHECKED]])

    def _starts(self) -> np.ndarray:
        """Other velocities; other positions where nothing ties them."""
        random, nq = np.random.default_rng(0), self.site.mechanics.q.numel()
        starts = np.tile(self.site.x, (MANY, 1))
        tied = self.site.mechanics.phi.numel() > 0
        spread = random.uniform(-0.02, 0.02, starts.shape)
        spread[0] = 0.0
        if tied:
            spread[:, :nq] = 0.0
        return starts + spread

    def _end(self, x: np.ndarray) -> np.ndarray:
        site = self.site
        held = tuple(c.name for c in site.mechanics.model.coordinates)
        found = solution(
            Problem(site.equations, tuple(x), tuple(map(float, site.u)), (), held),
            [site.scene.span],
            18,
        ).at(0)
        model = site.mechanics.model
        q = np.array([float(found[c.name]) for c in model.coordinates])
        v = np.array([float(found[c.name]) for c in model.velocities])
        return np.ravel(self.module.state(site.scene.span, np.hstack([q, v]), site.u))

    def error(self, ends: np.ndarray) -> float:
        return float(np.max(np.abs(ends[:CHECKED] - self.ends) / self.site.scales))

    def ours(self, integrators: Sequence[str] = INTEGRATORS, **more: Any) -> Iterator[Ensemble]:
        return ours(self.site, self.module, integrators, **more)

    def heyoka(self) -> Iterator[tuple[str, Ensemble]]:
        site, span = self.site, self.site.scene.span
        made = program(site.equations, ("dynamics",), ("verner9",))
        ours = series.of_program(made, site.u)
        yield "program", ensembles.taylor(f"{LANES}, our program", ours, span, _same, _same)
        if n := site.scene.links:
            own = series.of_chain(n)
            yield OWN, ensembles.taylor(f"{LANES}, {OWN}", own, span, _from_level, _relative)

    def others(self) -> Iterator[Ensemble]:
        """From Python; each may raise Unavailable."""
        module, u, span = self.module, self.site.u, self.site.scene.span
        makers: list[Callable[[], Ensemble]] = [
            lambda: ensembles.vmapped(self.folder, module, u, span),
            lambda: ensembles.one_by_one(self.folder, u, span),
        ]
        if links := self.site.scene.links:
            makers.append(lambda: ensembles.rolled_out(links, span))
        for make in makers:
            try:
                yield make()
            except Unavailable as error:
                print(f"{self.site.scene.name:10}{error}", file=sys.stderr)


def built(model: Path, site: Site, name: str) -> Path:
    """The folder of its module, in the choice of the site, with all numbers folded in."""
    return hamel.build(
        model,
        choice=site.equations.choice,
        out=BUILD / "ensembles" / name,
        constants="all",
        integrators=(*INTEGRATORS, *SERIES),
    ).folder


def ours(
    site: Site, module: ModuleType, integrators: Sequence[str] = INTEGRATORS, **more: Any
) -> Iterator[Ensemble]:
    """By each of the integrators and enforcements of the module."""
    span, u = site.scene.span, site.u
    for integrator in integrators:
        for enforcement in module.enforcements or (None,):

            def run(
                setting: float, x: np.ndarray, integrator: str = integrator,
                enforcement: str | None = enforcement,
            ) -> tuple[float, np.ndarray]:  # fmt: skip
                how = {"rtol": 10.0**setting, "atol": 10.0**setting / 100, **more}
                return ensembles.timed(
                    lambda: module.simulate(
                        (0.0, span), x, u, times=[span], integrator=integrator,
                        enforcement=enforcement, **how,
                    ).x[:, -1],
                    time.perf_counter if "threads" in more else time.process_time,
                )  # fmt: skip

            yield Ensemble(f"{integrator}, {enforcement}", run)


def _same(rows: np.ndarray) -> np.ndarray:
    return rows


def _from_level(rows: np.ndarray) -> np.ndarray:
    """Angles and rates of the links from those between them."""
    q, v = np.split(rows, 2, axis=1)
    return np.hstack([np.cumsum(q, axis=1), np.cumsum(v, axis=1)])


def _relative(rows: np.ndarray) -> np.ndarray:
    q, v = np.split(rows, 2, axis=1)
    return np.hstack([np.diff(q, axis=1, prepend=0.0), np.diff(v, axis=1, prepend=0.0)])


@dataclass(frozen=True)
class Chosen:
    ensemble: Ensemble
    setting: float
    seconds: float  # of a motion


def tuned(of: Ensemble, place: Place, count: int = TRIED) -> dict[float, Chosen]:
    """For each error the setting that meets it in the least time; what each took is kept for the
    plot."""
    best: dict[float, Chosen] = {}
    for setting in of.settings:
        seconds, ends = of.run(setting, place.starts[:count])
        wrong = place.error(ends)
        place.tried.setdefault(of.peer, []).append((1e6 * seconds / count, wrong))
        for most in ERRORS:
            if wrong <= most and (most not in best or seconds / count < best[most].seconds):
                best[most] = Chosen(of, setting, seconds / count)
        if len(best) == len(ERRORS) and seconds / count > 2.0 * best[ERRORS[-1]].seconds:
            break
    return best


def fastest(choices: Sequence[dict[float, Chosen]], most: float) -> Chosen | None:
    fit = [each[most] for each in choices if most in each]
    return min(fit, key=lambda chosen: chosen.seconds) if fit else None


def in_turn(chosen: Sequence[tuple[Chosen, int]], place: Place) -> list[float]:
    """The least seconds a motion takes, each with as many motions as is said, all in turn."""
    least = [np.inf] * len(chosen)
    for _ in range(ROUNDS):
        for i, (each, count) in enumerate(chosen):
            seconds, _ends = each.ensemble.run(each.setting, place.starts[:count])
            least[i] = min(least[i], seconds / count)
    return least


Row = dict[str, Any]


def rows(place: Place) -> Iterator[Row]:
    many = place.many
    own = [tuned(each, place) for each in place.ours()]
    series_of_ours = ((f"our {each.peer}", each) for each in place.ours(SERIES))
    peers = {key: tuned(each, place) for key, each in (*_taylor(place), *series_of_ours)}
    yield from _compilations(place, peers)
    for k, most in enumerate(ERRORS):
        mine = fastest(own, most)
        if mine is None:
            continue
        beside = {key: found[most] for key, found in peers.items() if most in found}
        times = in_turn([(each, MANY) for each in (mine, *beside.values())], place)
        for (key, each), seconds in zip(beside.items(), times[1:]):
            target = many.targets.get(key, (None,) * len(ERRORS))[k]
            peer = key if key.startswith("our ") else each.ensemble.peer
            yield _row(many, most, peer, (mine, times[0]), seconds, target)
    mine = fastest(own, PYTHON)
    if mine is not None:
        yield from _scalar(many, place, mine)
        yield from _beside(many, place, mine)
        yield from _costs(many, place, mine)


def _compilations(place: Place, peers: dict[str, dict[float, Chosen]]) -> Iterator[Row]:
    """Of our loop over lanes with both integrators and the series, beside what heyoka takes for
    the longest of its series; of the four-bar beside what it may take."""
    many, seconds = place.many, _compilation(place)
    others = {
        chosen.ensemble.peer: max(chosen.ensemble.compiled)
        for found in peers.values()
        for chosen in found.values()
        if chosen.ensemble.compiled
    }
    for peer, theirs in others.items():
        yield _compiled(many, peer, seconds, theirs, None)
    if many.scene.name == "four_bar":
        yield _compiled(many, f"{COMPILED:g} s", seconds, COMPILED, 1.0)


def _compilation(place: Place) -> float:
    """Seconds of a processor that the compiler takes for NAME_simulate.c; the least of three."""
    command, name, least = compiler.find_compiler() or [], place.many.scene.name, np.inf
    stem = f"{name}_simulate"
    flags = [*compiler.FLAGS, *compiler.flags_of(command, name, stem)]
    for _ in range(3):
        begin = _of_children()
        compiler.run(Path(place.folder), [*command, *flags, "-c", f"{stem}.c", "-o", os.devnull])
        least = min(least, _of_children() - begin)
    return float(least)


def _of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _compiled(many: Many, peer: str, ours: float, theirs: float, target: float | None) -> Row:
    return {
        "function": f"{MANY} motions, {COMPILING}",
        "model": many.scene.name,
        "peer": peer,
        "ours_ns": 1e9 * ours,
        "peer_ns": 1e9 * theirs,
        "ratio": ours / theirs,
        "target": target,
        "met": None if target is None else ours / theirs <= target,
        "ours": "the loop over lanes",
    }


def _taylor(place: Place) -> list[tuple[str, Ensemble]]:
    """heyoka, but for models with functions that it does not have: the bicycle's sign."""
    try:
        return list(place.heyoka())
    except Unavailable as error:
        print(f"{place.site.scene.name:10}{error}", file=sys.stderr)
        return []


def _scalar(many: Many, place: Place, mine: Chosen) -> Iterator[Row]:
    """Our own loop for one motion at a time, compiled, without Python in between."""
    found = [trajectories.tuned(each, place.site.error) for each in trajectories.ours(place.site)]
    fit = [
        each[PYTHON]
        for each in found
        if PYTHON in each and "verner9" in each[PYTHON].simulation.variant
    ]
    if not fit:
        return
    (seconds,) = in_turn([(mine, MANY)], place)
    scalar = min(each.ms for each in fit) * 1e-3
    yield _row(many, PYTHON, SCALAR, (mine, seconds), scalar, _width() if many.targets else None)


def _width() -> float:
    """The most of the scalar loop's time: with eight lanes, with four."""
    command = compiler.find_compiler() or []
    return 0.08 if "__AVX512F__" in compiler.probe(tuple(command))[1] else 0.16


def _beside(many: Many, place: Place, mine: Chosen) -> Iterator[Row]:
    """Peers that are called from Python, with fewer motions where each takes long."""
    for peer in place.others():
        count = 16 if peer.peer.startswith(("SciPy", "MuJoCo")) else TRIED
        best = tuned(peer, place, count).get(PYTHON)
        if best is None:
            print(f"{many.scene.name:10}{peer.peer} does not come to {PYTHON:g}", file=sys.stderr)
            continue
        count = count if count < TRIED else MANY
        ours, theirs = in_turn([(mine, MANY), (best, count)], place)
        yield _row(many, PYTHON, peer.peer, (mine, ours), theirs, 0.02)


def _costs(many: Many, place: Place, mine: Chosen) -> Iterator[Row]:
    """Threads beside one, and the estimate of the error, projection and events beside none, with the
    same setting."""
    name = mine.ensemble.peer
    for what, more, target in (
        (f"{CORES} threads beside one", {"threads": CORES}, 0.55 if CORES == 2 else None),
        ("with the estimate of the error beside without", {"error": True}, 1.6),
    ):
        less = {"threads": 1} if "threads" in more else {}
        with_it, without = (
            Chosen(_named(place.ours(**given), name), mine.setting, mine.seconds)
            for given in (more, less)
        )
        if "threads" in more:
            pinned(CORES)
        plain, seconds = in_turn([(without, MANY), (with_it, MANY)], place)
        if "threads" in more:
            pinned()
        yield _row(many, PYTHON, what, (with_it, seconds), plain, target)
    if name.endswith(", none") and "projection" in place.module.enforcements:
        projected = _named(place.ours(), name.replace(", none", ", projection"))
        yield _dearer(many, place, mine, projected, "with projection and guards beside none")
    if many.scene.links:
        watched = _named(ours(place.site, _watched(place)), name)
        yield _dearer(many, place, mine, watched, "with two far events beside none")


def _dearer(many: Many, place: Place, mine: Chosen, dear: Ensemble, what: str) -> Row:
    chosen = Chosen(dear, mine.setting, mine.seconds)
    plain, seconds = in_turn([(mine, MANY), (chosen, MANY)], place)
    return _row(many, PYTHON, what, (chosen, seconds), plain, MORE)


def _watched(place: Place) -> ModuleType:
    """The module of the same chain with events that do not happen."""
    scene = place.many.scene
    name = f"{scene.name}_watched"
    text = trajectories._file(scene).read_text().replace(f"model: {scene.name}", f"model: {name}")
    model = BUILD / "ensembles" / f"{name}.yaml"
    model.write_text(text.replace("initial:", f"{FAR}\ninitial:"))
    return hamel.load(built(model, place.site, name))


def _named(found: Iterator[Ensemble], name: str) -> Ensemble:
    return next(each for each in found if each.peer == name)


def _row(
    many: Many,
    most: float,
    peer: str,
    mine: tuple[Chosen, float],
    theirs: float,
    target: float | None,
) -> Row:
    ratio = mine[1] / theirs
    missed = target is not None and ratio > target
    return {
        "function": f"{MANY} motions to {most:.0e}",
        "model": many.scene.name,
        "peer": peer,
        "ours_ns": 1e9 * mine[1],
        "peer_ns": 1e9 * theirs,
        "ratio": ratio,
        "target": target,
        "met": None if target is None else ratio <= target,
        "ours": mine[0].ensemble.peer,
        **({"why": why(peer)} if missed else {}),
    }


def why(peer: str) -> str:
    """Why a target is missed, in a few words; docs/methods.md has the figures."""
    return next((text for part, text in WHY.items() if part in peer), "")


def line(row: Row) -> str:
    target = f"{row['target']:.2f}" if row["target"] else "–"
    met = {True: "met", False: "MISSED", None: ""}[row["met"]]
    unit = 1e9 if row["function"].endswith(COMPILING) else 1e3  # s, or µs
    times = (
        f"{row['ours_ns'] / unit:9.2f}{row['peer_ns'] / unit:10.2f}{row['ratio']:9.3f}{target:>7}"
    )
    return f"{row['model']:10}{row['function']:24}{row['peer']:48}{times}  {met:7}{row['ours']}"


def versions() -> str:
    """Of the peers that are installed."""
    there = [name for name in LIBRARIES if importlib.util.find_spec(name)]
    return ", ".join(f"{name} {importlib.metadata.version(name)}" for name in there)


def main(names: Sequence[str]) -> int:
    known = [many.scene.name for many in SCENES]
    unknown = [name for name in names if name not in known]
    if unknown:
        print(f"ensembles: no model {unknown[0]!r}; there are {', '.join(known)}", file=sys.stderr)
        return 2
    print(f"{versions()}; µs a motion, the least of {ROUNDS} rounds side by side; compiling in s")
    pinned()
    for many in SCENES:
        if names and many.scene.name not in names:
            continue
        place = Place(many)
        found: list[Row] = []
        for row in rows(place):
            found.append(row)
            print(line(row), flush=True)
        _kept(many.scene.name, found)
        _plotted(many.scene.name, place.tried)
    return 0


def _plotted(model: str, tried: dict[str, list[tuple[float, float]]]) -> None:
    """What each contender took for each error, beside other models, for the plot."""
    before = json.loads(CURVES.read_text()) if CURVES.exists() else {}
    CURVES.write_text(json.dumps({**before, model: tried}, indent=1, ensure_ascii=False) + "\n")


def _kept(model: str, found: Sequence[Row]) -> None:
    """Beside the other rows of build/whole.json."""
    before = json.loads(OUT.read_text()) if OUT.exists() else []
    mine = f"{MANY} motions"
    others = [
        row
        for row in before
        if row["model"] != model or not row.get("function", "").startswith(mine)
    ]
    OUT.parent.mkdir(exist_ok=True)
    OUT.write_text(json.dumps([*others, *found], indent=1, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except Unavailable as error:
        sys.exit(f"ensembles: {error}")
