"""The rows of one scene: everybody's contenders, timed in turn and compared with ours."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from peers import peak, python_call
from peers.contest import (
    AGREEMENT,
    CORES,
    Contender,
    Time,
    Unavailable,
    difference,
    measured,
    processor,
    version,
)
from scenes import Scene
from targets import BEST, PEAK, TARGETS

WRONG = "differs from ours by"
OURS = "hamel"  # the peer of a row that says why there is nothing of ours
Row = dict[str, Any]


@dataclass
class Entry:
    """A scene with everything compiled, ours among the peers; `missing`: what cannot be had, and
    why."""

    scene: Scene
    found: dict[str, list[Contender]] = field(default_factory=dict)
    missing: dict[str, str] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """Equal where the same binaries would be timed again; empty where none are known before."""
        everyone = [c for several in self.found.values() for c in several]
        said = [
            self.scene.function,
            self.scene.model,
            *sorted(f"{c.library.name} {c.argument}" for c in everyone),
        ]
        return (
            hashlib.sha256("\n".join([*said, *self.missing]).encode()).hexdigest()[:16]
            if self.found.get(OURS)
            else ""
        )


def rows(entry: Entry) -> Iterator[Row]:
    """One row per peer; what cannot be had or does not run says so in `note`."""
    scene = entry.scene
    try:
        yield from _called(scene) if scene.called else _rows(entry)
    except Exception as error:  # the other scenes are to be measured
        yield _row(scene, OURS, None, None, note=reason(error))


def reason(error: Exception) -> str:
    """In one line."""
    said = str(error) if isinstance(error, Unavailable) else f"{type(error).__name__}: {error}"
    return " ".join(said.split())[:200]


def _rows(entry: Entry) -> Iterator[Row]:
    if OURS in entry.missing:
        raise Unavailable(entry.missing[OURS])
    scene, own = entry.scene, entry.found[OURS]
    peers = {name: several for name, several in entry.found.items() if name != OURS}
    chains = peak.contenders(scene.peak) if scene.peak else []
    times, failing = measured([*own, *(c for several in peers.values() for c in several), *chains])
    ours = min(times[c].ns for c in own)
    contested = [
        _contested(scene, name, ours, several, times, failing) for name, several in peers.items()
    ]
    yield from contested
    if scene.best:
        best = min((row for row in contested if row["peer_ns"]), key=lambda row: row["peer_ns"])
        yield _row(scene, BEST, ours, best["peer_ns"], variant=f"{best['peer']} {best['variant']}")
    if chains:
        yield _share(scene, own[0], ours, max(peak.flop(c) / times[c].ns for c in chains))
    for name, note in entry.missing.items():
        yield _row(scene, name, ours, None, note=note)
    for name in scene.timed:
        yield _timed(scene, name, ours, times[own[0]])


def _contested(
    scene: Scene,
    peer: str,
    ours: float,
    theirs: Sequence[Contender],
    times: dict[Contender, Time],
    failing: dict[Contender, str],
) -> Row:
    running = [c for c in theirs if c in times]
    agreeing = [c for c in running if not times[c].wrong]
    if agreeing:
        best = min(agreeing, key=lambda c: times[c].ns)
        return _row(scene, peer, ours, times[best].ns, variant=best.variant)
    note = (
        f"{WRONG} {times[running[0]].wrong:.1e}"
        if running
        else failing[theirs[0]]
        if theirs
        else "nothing made"
    )
    return _row(scene, peer, ours, None, note=note)


def _timed(scene: Scene, peer: str, ours: float, own: Time) -> Row:
    try:
        ns, results = scene.timed[peer]()
    except Exception as error:
        return _row(scene, peer, ours, None, note=reason(error))
    wrong = difference(results, own.results)
    if wrong > AGREEMENT:
        return _row(scene, peer, ours, None, note=f"{WRONG} {wrong:.1e}")
    return _row(scene, peer, ours, ns)


def _share(scene: Scene, own: Contender, ours: float, most: float) -> Row:
    """What the same additions and multiplications would take at the peak; a sine with its cosine
    counts as its polynomials."""
    turns = sum(scene.operations[kind] for kind in ("sin", "cos")) / 2
    flop = scene.operations["add"] + scene.operations["multiply"] + turns * own.turn
    note = f"{flop:.0f} flop, peak {most:.1f} flop/ns, share {flop / most / ours:.0%}"
    return _row(scene, PEAK, ours, flop / most, variant=note)


def _called(scene: Scene) -> Iterator[Row]:
    assert scene.called
    ours, c = scene.called()
    allowed = python_call.WITHIN if "10,000" in scene.function else 1 + python_call.ALLOWED / c
    yield _row(scene, "its own C loop", ours, c, target=allowed)


def _row(
    scene: Scene,
    peer: str,
    ours: float | None,
    theirs: float | None,
    variant: str = "",
    note: str = "",
    target: float | None = None,
) -> Row:
    found = next(
        (
            t.ratio
            for t in TARGETS
            if (t.function, t.model, t.peer) == (scene.function, scene.model, peer)
        ),
        target,
    )
    ratio = ours / theirs if ours and theirs else None
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
        "measured": datetime.now(UTC).isoformat(timespec="minutes"),
        "machine": f"{processor()}, {CORES} cores, {version('gcc')}",
        "load": round(os.getloadavg()[0], 1),
    }
