"""make bench: our generated C beside its peers, in compiled loops without Python, into build/bench.json.

    python benchmarks/bench.py [MODEL …]

Every contender is checked to agree with ours to 1e-9 before it is timed; all contenders of a model run in turn in one process.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from peers import peak, python_call
from peers.contest import AGREEMENT, Contender, Time, Unavailable, difference, pinned, times
from scenes import SCENES, Scene
from targets import BEST, CHAINS, PEAK, TARGETS

from hamel.plot import Curve, Panel, draw

OUT, PLOT = Path("build/bench.json"), Path("build/bench_chains.svg")
WRONG = "differs from ours by"
Row = dict[str, Any]


def rows(scene: Scene) -> Iterator[Row]:
    """One row per peer; a peer that cannot be had says so in `note`."""
    if scene.called:
        yield _called(scene)
        return
    own, found, missing = list(scene.own()), {}, {}
    for name, made in scene.peers.items():
        try:
            found[name] = list(made())
        except Unavailable as error:
            missing[name] = str(error)
    chains = peak.contenders(scene.peak) if scene.peak else []
    everyone = [*own, *(contender for several in found.values() for contender in several), *chains]
    measured = dict(zip(everyone, times(everyone)))
    ours = min(measured[c].ns for c in own)
    made = [_contested(scene, name, ours, several, measured) for name, several in found.items()]
    made += [_timed(scene, name, ours, measured[own[0]]) for name in scene.timed]
    made += [_row(scene, name, ours, None, note=note) for name, note in missing.items()]
    if scene.best:
        best = min((row for row in made if row["peer_ns"]), key=lambda row: row["peer_ns"])
        made.append(_row(scene, BEST, ours, best["peer_ns"], variant=f"{best['peer']} {best['variant']}"))
    if chains:
        made.append(_share(scene, own[0], ours, max(peak.flop(c) / measured[c].ns for c in chains)))
    yield from made


def _contested(scene: Scene, peer: str, ours: float, theirs: Sequence[Contender], measured: dict[Contender, Time]) -> Row:
    agreeing = [c for c in theirs if not measured[c].wrong]
    if not agreeing:
        return _row(scene, peer, ours, None, note=f"{WRONG} {measured[theirs[0]].wrong:.1e}")
    best = min(agreeing, key=lambda c: measured[c].ns)
    return _row(scene, peer, ours, measured[best].ns, variant=best.variant)


def _timed(scene: Scene, peer: str, ours: float, own: Time) -> Row:
    try:
        ns, results = scene.timed[peer]()
    except Unavailable as error:
        return _row(scene, peer, ours, None, note=str(error))
    wrong = difference(results, own.results)
    if wrong > AGREEMENT:
        return _row(scene, peer, ours, None, note=f"{WRONG} {wrong:.1e}")
    return _row(scene, peer, ours, ns)


def _share(scene: Scene, own: Contender, ours: float, most: float) -> Row:
    """What the same additions and multiplications would take at the peak; a sine with its cosine counts as its polynomials."""
    turns = sum(scene.operations[kind] for kind in ("sin", "cos")) / 2
    flop = scene.operations["add"] + scene.operations["multiply"] + turns * own.turn
    note = f"{flop:.0f} flop, peak {most:.1f} flop/ns, share {flop / most / ours:.0%}"
    return _row(scene, PEAK, ours, flop / most, variant=note)


def _called(scene: Scene) -> Row:
    assert scene.called
    ours, c = scene.called()
    allowed = python_call.WITHIN if "10,000" in scene.function else 1 + python_call.ALLOWED / c
    return _row(scene, "its own C loop", ours, c, target=allowed)


def _row(
    scene: Scene, peer: str, ours: float, theirs: float | None, variant: str = "", note: str = "", target: float | None = None
) -> Row:
    found = next((t.ratio for t in TARGETS if (t.function, t.model, t.peer) == (scene.function, scene.model, peer)), target)
    ratio = ours / theirs if theirs else None
    return {
        "function": scene.function,
        "model": scene.model,
        "peer": peer,
        "ours_ns": ours,
        "peer_ns": theirs,
        "ratio": ratio,
        "target": found,
        "met": None if found is None or ratio is None else ratio <= found,
        "variant": variant,
        "operations": dict(scene.operations),
        "note": note,
    }


def line(row: Row) -> str:
    """One row of the table."""
    numbers = f"{_number(row['ours_ns'])}{_number(row['peer_ns'])}{_number(row['ratio'], 3)}{_number(row['target'], 3)}"
    met = {True: "met", False: "MISSED", None: ""}[row["met"]]
    return f"{row['function']:24}{row['model']:13}{row['peer']:27}{numbers}  {met:7}{row['note'] or row['variant']}"


def _number(value: float | None, digits: int = 1) -> str:
    return f"{'–':>10}" if value is None else f"{value:10.{digits}f}"


def _keep(found: Sequence[Row]) -> None:
    """Into the file and the plot; models that were not run now keep their rows."""
    fresh = {row["model"] for row in found}
    kept = json.loads(OUT.read_text()) if OUT.exists() else []
    everything = [row for row in kept if row["model"] not in fresh] + list(found)
    OUT.parent.mkdir(exist_ok=True)
    OUT.write_text(json.dumps(everything, indent=1, ensure_ascii=False) + "\n")
    if all(any(row["model"] == f"chain{n}" for row in everything) for n in CHAINS):
        PLOT.write_text(chains(everything))


def chains(everything: Sequence[Row]) -> str:
    """Time over the number of links, ours and the peers that have them all."""
    of = {n: [row for row in everything if row["model"] == f"chain{n}"] for n in CHAINS}
    curves = [Curve("hamel", [of[n][0]["ours_ns"] for n in CHAINS])]
    for peer in [row["peer"] for row in of[CHAINS[0]] if row["peer"] != BEST]:
        times = [next((row["peer_ns"] for row in of[n] if row["peer"] == peer), None) for n in CHAINS]
        if all(times):
            curves.append(Curve(peer, [time for time in times if time]))
    return draw("Planar pendulum chains", "links", CHAINS, [Panel("forward dynamics, ns", tuple(curves), log=True)])


def main(chosen: Sequence[str]) -> int:
    unknown = [name for name in chosen if name not in SCENES]
    if unknown:
        print(f"bench: no model {unknown[0]!r}; there are {', '.join(SCENES)}", file=sys.stderr)
        return 2
    pinned()
    found, start = [], time.monotonic()
    print(f"{'function':24}{'model':13}{'peer':27}{'ours, ns':>10}{'peer, ns':>10}{'ratio':>10}{'at most':>10}")
    for name in chosen or SCENES:
        for scene in SCENES[name]():
            for row in rows(scene):
                found.append(row)
                print(line(row), flush=True)
    _keep(found)
    missed = sum(row["met"] is False for row in found)
    met = sum(row["met"] is True for row in found)
    print(f"{met} targets met, {missed} missed, {time.monotonic() - start:.0f} s; see {OUT} and {PLOT}")
    return int(any(row["note"].startswith(WRONG) for row in found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
