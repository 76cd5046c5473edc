"""Sines and cosines as lines of C: those of an angle together, of several angles at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from codegen import text
from codegen.passes.folding.split import names
from codegen.passes.schedule import TURNS
from codegen.program import Expression, Section, Statement


@dataclass(frozen=True)
class Step:
    """Lines that belong together, the locals that they read and those that they make."""

    lines: Sequence[str]
    reads: Sequence[str]
    makes: Sequence[str]


def by_lanes(prefix: str, section: Section, taken: set[str], bad: str = "bad") -> dict[str, Step]:
    """A step for the sine and the cosine of an angle, at the first of them; `bad` counts angles
    that are too large."""
    steps: dict[str, Step] = {}
    for angle, pairs in angles_of(section).items():
        first = next(iter(pairs.values()))
        sin, cos = (pairs.get(name) or fresh(f"{first}_{name}", taken) for name in ("sin", "cos"))
        call = f"{bad} += {prefix}_sincos({text.expression(angle, text.LANES)}, &{sin}, &{cos});"
        steps[first] = Step([f"double {sin}, {cos};", call], list(names(angle)), [sin, cos])
    return steps


def by_fours(prefix: str, section: Section, taken: set[str]) -> dict[str, Step]:
    """At the last sine or cosine a step for all, four angles at a time; where one needs
    another, one by one."""
    angles = list(angles_of(section).items())
    groups = (
        [angles[i : i + 4] for i in range(0, len(angles), 4)]
        if section.title == TURNS
        else [[item] for item in angles]
    )
    steps: dict[str, Step] = {}
    for group in groups:
        last = [
            s.name
            for s in section.statements
            if any(s.name in pairs.values() for _, pairs in group)
        ]
        sines, cosines = fresh("sines", taken), fresh("cosines", taken)
        values = [*(text.expression(angle, text.C) for angle, _ in group), "0.0", "0.0", "0.0"][:4]
        calls = [
            f"double {sines}[4], {cosines}[4];",
            f"{prefix}_turns({', '.join(values)}, {sines}, {cosines});",
        ]
        for k, (_, pairs) in enumerate(group):
            calls += [
                f"const double {local} = {sines if name == 'sin' else cosines}[{k}];"
                for name, local in pairs.items()
            ]
        reads = [name for angle, _ in group for name in names(angle)]
        step = Step(calls, reads, [local for _, pairs in group for local in pairs.values()])
        steps[last[-1] if section.title == TURNS else last[0]] = step
    return steps


def is_turn(statement: Statement) -> bool:
    """A sine or a cosine."""
    return isinstance(statement.value, tuple) and statement.value[0] in ("sin", "cos")


def angles_of(section: Section) -> dict[Expression, dict[str, str]]:
    """Which locals are the sine and the cosine of an angle."""
    pairs: dict[Expression, dict[str, str]] = {}
    for statement in section.statements:
        if isinstance(statement.value, tuple) and is_turn(statement):
            pairs.setdefault(statement.value[1], {})[statement.value[0]] = statement.name
    return pairs


def fresh(wanted: str, taken: set[str]) -> str:
    """The name, with lines under it until nothing else is called so."""
    while wanted in taken:
        wanted += "_"
    taken.add(wanted)
    return wanted
