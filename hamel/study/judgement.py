"""Errors against a reference solution, and whether that one can be believed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from derive.mechanics.records import System
from hamel.study.limits import AGREE, CLOSER, CONTRADICTED, FAR, LEAST, NEAR
from hamel.study.plan import Unit

COLUMNS = (
    *("model", "formulation", "choice", "enforcement", "integrator", "rtol", "step", "error"),
    *("phi", "velocity", "energy"),
    *("ms", "steps", "rejected", "calls", "operations", "estimate", "error_of_q", "status"),
)  # fmt: skip


@dataclass(frozen=True)
class Reference:
    """(q, v) at the end with the largest error it can have (twice what two runs differ by), None
    where they do not agree.

    `sizes`: the largest |q| and |v| on the way; `exchanged`: the largest energy; `scale`: steps of
    a loose run.
    """

    by: tuple[str, ...]
    end: tuple[float, ...] | None
    other: tuple[float, ...]
    sizes: tuple[float, ...]
    exchanged: float
    scale: int
    bound: float | None
    doubt: str = ""  # why there is none, or why this one is wrong

    @property
    def contradicted(self) -> bool:
        """Two tight runs agreed on an end, and yet other runs speak against it."""
        return bool(self.doubt) and self.end is not None


def agreed(found: Sequence[tuple[str, Mapping[str, Any]]]) -> Reference:
    """The first of two runs; whether they agree is for the judge to say, who knows the scales."""
    if not found:
        return Reference((), None, (), (), 0.0, 100, None, "no tight run came to its end")
    by, first = tuple(name for name, _ in found), found[0][1]
    other = tuple(found[-1][1]["end"]) if len(found) > 1 else ()
    scale = max(10, round(first["steps"] / 8))
    doubt = "" if other else "only one tight run came to its end, so that nothing confirms it"
    return Reference(
        by,
        tuple(first["end"]),
        other,
        tuple(first["sizes"]),
        first["exchanged"],
        scale,
        None,
        doubt,
    )


class Judge:
    """Knows the scales of a motion: 1 for angles and plain numbers, else the largest value of the
    same unit on the way."""

    def __init__(self, system: System, reference: Reference, span: float) -> None:
        self.system = system
        self.span = span
        self.scales = _scales(system, reference.sizes)
        self.reference = self._compared(reference)

    def _compared(self, reference: Reference) -> Reference:
        if reference.end is None or not reference.other:
            return replace(reference, end=None)
        apart = self._distance(reference.other, reference.end)
        if apart > AGREE:
            return replace(
                reference,
                end=None,
                bound=apart,
                doubt=f"the two reference runs differ by {apart:.1e}",
            )
        # each of the two may be as far off as they are apart; twice that is on the safe side
        return replace(reference, bound=max(2 * apart, LEAST))

    def _distance(self, end: Sequence[float], wanted: Sequence[float]) -> float:
        """The largest difference relative to the scales; a quaternion and its negative are the
        same."""
        place, target = np.array(end, dtype=float), np.array(wanted)
        for i in self.system.quaternions:
            # both turn a body alike: the nearer of the two is compared
            if place[i : i + 4] @ target[i : i + 4] < 0:
                place[i : i + 4] *= -1
        return float(np.max(np.abs(place - target) / self.scales, initial=0.0))

    def confirmed(
        self, made: Sequence[tuple[Unit, Mapping[str, Any], Mapping[str, Any]]]
    ) -> Reference:
        """The reference, doubted where runs of different formulations agree with each other on
        another end."""
        best = _tightest(made)
        if self.reference.end is None or self.reference.bound is None or len(best) < 2:
            return self.reference
        off = [self._distance(ends[0], self.reference.end) for ends in best]
        apart = max(self._distance(best[0][0], other) for other in (*best[0][1:], *best[1]))
        if min(off) > CONTRADICTED * (self.reference.bound + apart):
            agreement = f"runs that agree with each other within {apart:.1e}"
            doubt = f"{agreement} are {min(off):.1e} away from it"
            return replace(self.reference, doubt=doubt)
        return self.reference

    def rows(
        self, model: str, made: Sequence[tuple[Unit, Mapping[str, Any], Mapping[str, Any]]]
    ) -> list[dict[str, Any]]:
        """Rows of the report, one per run, with errors relative to the scales.

        An error above FAR is no result: the status says "wrong" where another method of the same
        integrator and tolerance came near, so that the tolerance cannot be to blame, else "too
        coarse".
        """
        rows = [self._row(model, unit, run, row) for unit, run, row in made]
        best: dict[tuple[Any, ...], float] = {}
        for row in rows:
            if row["error"] is not None:
                best[_effort(row)] = min(best.get(_effort(row), np.inf), row["error"])
        for row in rows:
            if row["error"] is not None and row["error"] > FAR:
                row["status"] = (
                    "wrong"
                    if best[_effort(row)] < min(NEAR, row["error"] / CLOSER)
                    else "too coarse"
                )
        return rows

    def _row(
        self, model: str, unit: Unit, run: Mapping[str, Any], row: Mapping[str, Any]
    ) -> dict[str, Any]:
        error = self._error(row)
        balance, exchanged = row.get("balance"), self.reference.exchanged
        given = {
            "model": model,
            "formulation": unit.formulation,
            "choice": unit.choice,
            "enforcement": unit.own or run["enforcement"],
            "integrator": run["integrator"],
            "rtol": run.get("rtol"),
            "step": self.span / run["count"] if "count" in run else None,
            "error": error,
            "estimate": self._estimate(row),
            "error_of_q": self._error_of_q(row),
            "energy": None
            if balance is None
            else abs(balance) / exchanged
            if exchanged > 0
            else abs(balance),
        }
        names = (*COLUMNS, "stopped")  # the time at which it did
        return {name: given[name] if name in given else row.get(name) for name in names}

    def _error(self, row: Mapping[str, Any]) -> float | None:
        if row.get("end") is None or self.reference.end is None:
            return None
        return max(self._distance(row["end"], self.reference.end), self.reference.bound or LEAST)

    def _estimate(self, row: Mapping[str, Any]) -> float | None:
        """What the motion says of its own error: of the coordinates, relative to the scales."""
        if row.get("estimate") is None:
            return None
        own = np.array(row["estimate"])
        return float(np.max(own / self.scales[: len(own)], initial=0.0))

    def _error_of_q(self, row: Mapping[str, Any]) -> float | None:
        """The error of the coordinates alone, as the estimate is one of these."""
        if row.get("end") is None or self.reference.end is None:
            return None
        nq, target = self.system.q.numel(), self.reference.end
        apart = self._distance([*row["end"][:nq], *target[nq:]], target)
        return max(apart, self.reference.bound or LEAST)


def _effort(row: Mapping[str, Any]) -> tuple[Any, ...]:
    return row["integrator"], row["rtol"], row["step"]


def told(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row as people read it: why it stopped, and when, in one text."""
    stopped = row["stopped"]
    when = "" if stopped is None else f" (at {stopped:.4g} s)"
    return {name: row[name] for name in COLUMNS} | {"status": row["status"] + when}


def _scales(system: System, sizes: Sequence[float]) -> np.ndarray:
    model = system.model
    groups = [("q", c.unit) for c in model.coordinates] + [("v", v.unit) for v in model.velocities]
    if not sizes:
        return np.ones(len(groups))
    largest: dict[tuple[str, str], float] = {}
    for group, size in zip(groups, sizes):
        largest[group] = max(largest.get(group, 0.0), size)
    plain = ("q", "rad"), ("q", ""), ("q", "1")
    return np.array([1.0 if group in plain else largest[group] or 1.0 for group in groups])


def _tightest(
    made: Sequence[tuple[Unit, Mapping[str, Any], Mapping[str, Any]]],
) -> list[list[Sequence[float]]]:
    """Per family that ran at two tolerances or more the ends of its two tightest runs; of each unit
    the best family."""
    families: dict[tuple[Unit, str, str], list[tuple[float, Sequence[float]]]] = {}
    for unit, run, row in made:
        if row.get("end") is not None and run.get("rtol"):
            families.setdefault((unit, run["enforcement"], run["integrator"]), []).append(
                (run["rtol"], row["end"])
            )
    best: dict[Unit, list[tuple[float, Sequence[float]]]] = {}
    for (unit, _, _), ends in families.items():
        two = sorted(ends, key=lambda item: item[0])[:2]
        if len(two) == 2 and (unit not in best or two[0][0] < best[unit][0][0]):
            best[unit] = two
    return [[end for _, end in two] for two in sorted(best.values(), key=lambda two: two[0][0])]
