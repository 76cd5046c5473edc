"""Two methods side by side: what each takes to reach an error, and which to take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hamel.study.front import LEVELS, NOISE, Row, accuracy, cheapest, method


@dataclass(frozen=True)
class Reached:
    """The fastest run of each of the two methods with an error of at most `error`; None where there
    is none."""

    error: float
    runs: tuple[Row | None, Row | None]

    @property
    def ratio(self) -> float | None:
        """Milliseconds of the second over those of the first."""
        first, second = self.runs
        return second["ms"] / first["ms"] if first and second else None


def answers_to(row: Row, name: str) -> bool:
    """Whether a run is of the method that is called so: a formulation, a choice of
    quasi-velocities, or an enforcement."""
    return name in (row["formulation"], row["choice"], row["enforcement"])


def compared(rows: Sequence[Row], names: Sequence[str]) -> list[Reached]:
    """The two methods at every level of error, loosest first, everything else at its best."""
    groups = [[row for row in rows if answers_to(row, name)] for name in names]
    return [
        Reached(level, (cheapest(groups[0], level), cheapest(groups[1], level))) for level in LEVELS
    ]


def verdict(rows: Sequence[Row], names: Sequence[str]) -> list[str]:
    """A sentence for every level of error that one of the two reaches; one that says so where there
    is none."""
    lines = [_sentence(each, names) for each in compared(rows, names) if any(each.runs)]
    return lines or [f"Neither {names[0]} nor {names[1]} reached a usable error."]


def _sentence(reached: Reached, names: Sequence[str]) -> str:
    at = f"For an error of {reached.error:.0e}"
    if reached.ratio is None:
        k = 0 if reached.runs[0] else 1
        return f"{at} take {names[k]} ({_told(reached.runs[k])}): {names[1 - k]} did not reach it."
    text = f"{_told(reached.runs[0])} against {_told(reached.runs[1])}"
    if max(reached.ratio, 1 / reached.ratio) < NOISE:
        return f"{at} {names[0]} and {names[1]} take as long: {text}."
    k = 0 if reached.ratio > 1 else 1
    times = max(reached.ratio, 1 / reached.ratio)
    return f"{at} take {names[k]}, {times:.3g} times as fast as {names[1 - k]}: {text}."


def _told(row: Row | None) -> str:
    assert row is not None
    return f"{row['ms']:.3g} ms with {method(row)}, {accuracy(row)}"
