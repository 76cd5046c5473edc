"""Which runs nobody beats, and what it takes to reach an error."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from codegen.integrators import INTEGRATORS
from hamel.study.limits import NOISE, SMALL

Row = Mapping[str, Any]
LEVELS = (1e-4, 1e-6, 1e-8, 1e-10)
OWN = {method.name for method in INTEGRATORS}
MULTIPLIERS = (
    "augmented",
    "udwadia_kalaba",
    "udwadia_phohomsiri",
)  # traditional: all of v, with λ or a pseudo-inverse


def good(rows: Iterable[Row]) -> list[Row]:
    """Rows with a result that can be judged."""
    return [
        row
        for row in rows
        if row["status"] == "ok" and row["error"] is not None and row["ms"] is not None
    ]


def is_library(row: Row) -> bool:
    """Is it integrated by somebody else's solver, such as SciPy's or SUNDIALS'?"""
    return row["integrator"] not in OWN


def is_traditional(row: Row) -> bool:
    """All of v with multipliers or a pseudo-inverse, and one of our own integrators: what
    quasi-velocities are compared with."""
    return row["formulation"] in MULTIPLIERS and not is_library(row)


def front(rows: Iterable[Row]) -> list[Row]:
    """The runs that no other one beats in both error and time, fastest first."""
    best: list[Row] = []
    for row in sorted(good(rows), key=lambda row: (row["ms"], row["error"])):
        if not best or row["error"] < best[-1]["error"]:
            best.append(row)
    return best


def cheapest(rows: Iterable[Row], level: float) -> Row | None:
    """The fastest run with an error of at most `level`; of those as fast, for all one can tell, the
    one that drifts least."""
    reached = [row for row in good(rows) if row["error"] <= level]
    least = min((row["ms"] for row in reached), default=0.0)
    return min((row for row in reached if row["ms"] <= NOISE * least), key=_merit, default=None)


def _merit(row: Row) -> tuple[float, ...]:
    """The decade of the drift, then the size of the equations."""
    return (
        round(math.log10(max(row["phi"] + row["velocity"], SMALL))),
        row["operations"] or math.inf,
        row["ms"],
    )


def families(rows: Sequence[Row], *names: str) -> dict[tuple[str, ...], list[Row]]:
    """Rows that have the same values of `names`, in the order of the first of each."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(str(row[name]) for name in names), []).append(row)
    return groups


def method(row: Row) -> str:
    """A run's method in words."""
    choice = f" ({row['choice']})" if row["choice"] else ""
    enforcement = (
        "" if row["enforcement"] == "none" and is_library(row) else f", {row['enforcement']}"
    )
    return f"{row['formulation']}{choice}{enforcement}, {row['integrator']}"


def accuracy(row: Row) -> str:
    """What was asked of the run, in words: a relative tolerance, or the length of equal steps."""
    return f"rtol {row['rtol']:.0e}" if row["rtol"] else f"steps of {row['step']:.2g} s"
