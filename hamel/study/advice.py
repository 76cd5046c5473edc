"""What to use for a model, and why, in sentences that follow from the rows."""

from __future__ import annotations

import re
from collections.abc import Sequence

from hamel.study.front import (
    LEVELS,
    NOISE,
    Row,
    accuracy,
    cheapest,
    families,
    good,
    is_library,
    is_traditional,
    method,
)
from hamel.study.judgement import Reference
from hamel.study.limits import MOST_BROKEN, WORTH
from hamel.study.runs import TOO_LONG

NUMBER = re.compile(r"[-+.\de]*\d")  # in a reason


def advice(rows: Sequence[Row], reference: Reference) -> list[str]:
    """Sentences: the method to take, what the others cost, what holds the constraints, what broke,
    what to believe."""
    own = [row for row in rows if not is_library(row)]
    level = next(
        (x for x in (WORTH, *reversed(LEVELS), 1e-2) if x <= 1e-2 and cheapest(own, x)), None
    )
    if reference.doubt:
        lines = [f"No error can be given: {reference.doubt}. {_remedy(reference)}".strip()]
    elif level is None:
        lines = ["No run reached a usable error; the reasons are in the table of what broke."]
    else:
        lines = [*_recommended(own, level), *_others(rows, level), *_enforcement_lines(own, level)]
    return [*lines, *broken(own)]


def _remedy(reference: Reference) -> str:
    if reference.end is not None:
        return "Do not use this report before the cause is known."
    if reference.bound is not None:
        return "A shorter time (--time) helps where the motion is chaotic."
    return "Another initial state (--set) or a shorter time (--time) may help."


def _recommended(own: Sequence[Row], level: float) -> list[str]:
    best, loose = cheapest(own, level), cheapest(own, 1e-4)
    assert best is not None
    lines = [
        f"Use {method(best)}: it reaches an error of {level:.0e} in {_ms(best)} ms "
        f"at {accuracy(best)}."
    ]
    if loose is not None and method(loose) != method(best):
        lines.append(f"For an error of 1e-04 {method(loose)} does with {_ms(loose)} ms.")
    return lines


def _others(rows: Sequence[Row], level: float) -> list[str]:
    own = [row for row in rows if not is_library(row)]
    best = cheapest(own, level)
    groups = {
        "the quasi-velocity equations": [r for r in own if not is_traditional(r)],
        "the traditional equations": [r for r in own if is_traditional(r)],
        "the best library solver": [r for r in rows if is_library(r)],
    }
    parts = []
    for name, group in groups.items():
        other = cheapest(group, level)
        if best is None or other is best or not group:
            continue
        if other is None:
            parts.append(f"{name} did not reach that error")
        else:
            parts.append(f"{name} {_slower(other['ms'] / best['ms'])} ({method(other)})")
    text = "; ".join(parts)
    return [f"{text[0].upper()}{text[1:]}."] if parts else []


def _slower(ratio: float) -> str:
    """Times that differ by less than noise are the same; the advice takes the run that drifts less
    of them."""
    if ratio < NOISE:
        return "took as long, for all one can tell"
    return f"took {ratio:,.0f} times as long" if ratio >= 100 else f"took {ratio:.3g} times as long"


def _enforcement_lines(own: Sequence[Row], level: float) -> list[str]:
    best = cheapest(own, level)
    assert best is not None
    if best["phi"] is None or not any(row["phi"] or row["velocity"] for row in good(own)):
        return []
    sizes = {
        name: best[key]
        for name, key in (("positions", "phi"), ("velocities", "velocity"))
        if any(r[key] for r in good(own))
    }
    lines = [
        f"It holds {' and '.join(f'{name} within {size:.1e}' for name, size in sizes.items())}."
    ]
    same = [
        r
        for r in good(own)
        if all(r[n] == best[n] for n in ("formulation", "choice", "integrator", "rtol", "step"))
    ]
    drifting = next(
        (r for r in same if r["enforcement"] == "none" and r["enforcement"] != best["enforcement"]),
        None,
    )
    if drifting is not None:
        lines.append(
            f"With no enforcement at all positions drift by {drifting['phi']:.1e} "
            f"(error {drifting['error']:.1e})."
        )
    return lines


def broken(own: Sequence[Row]) -> list[str]:
    """A line for every reason for which methods stop, give wrong results or take too long: how
    often, and which. Reasons that differ in numbers only are one."""
    lines = []
    for rows in _causes(own).values():
        methods = families(rows, "formulation", "choice").values()
        total = sum(len(_alike(own, group)) for group in methods)
        which = ", ".join(_where(own, group) for group in methods)
        lines.append((len(rows), f"{rows[0]['cause']}: {len(rows)} of {total} runs: {which}."))
    lines.sort(key=lambda line: -line[0])
    more = (
        [f"{len(lines) - MOST_BROKEN} more kinds of failures are in the tables."]
        if len(lines) > MOST_BROKEN
        else []
    )
    return [f"{line[0].upper()}{line[1:]}" for _, line in lines[:MOST_BROKEN]] + more


def _alike(own: Sequence[Row], group: Sequence[Row]) -> list[Row]:
    """All runs of the method and the enforcements of these."""
    names, enforcements = ("formulation", "choice"), {row["enforcement"] for row in group}
    same = [row for row in own if all(row[name] == group[0][name] for name in names)]
    return [row for row in same if row["enforcement"] in enforcements]


def _where(own: Sequence[Row], group: Sequence[Row]) -> str:
    """The method, with its enforcements where others of it went well."""
    formulation, choice = group[0]["formulation"], group[0]["choice"]
    where = f"{formulation} ({choice})" if choice else formulation
    same = [r for r in own if r["formulation"] == formulation and r["choice"] == choice]
    enforcements = dict.fromkeys(row["enforcement"] for row in group)
    all_of_them = len(_alike(own, group)) == len(same)
    return where if all_of_them else f"{where} with {' and '.join(enforcements)}"


def _causes(own: Sequence[Row]) -> dict[tuple[str, ...], list[Row]]:
    failed = []
    for row in own:
        if row["status"] not in ("ok", TOO_LONG, "too coarse"):
            cause = _cause(row["status"])
            failed.append({**row, "cause": cause, "reason": NUMBER.sub("", cause)})
    return families(failed, "reason")


def _cause(status: str) -> str:
    """What to say of all runs that ended like this."""
    if status == "wrong":
        return "wrong: an error above 0.1 where others with the same tolerance are right"
    return status


def _ms(row: Row) -> str:
    return f"{row['ms']:.3g}"
