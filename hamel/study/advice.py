"""What to use for a model, and why, in sentences that follow from the rows."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence

from codegen.runtime.simulation import Status
from derive.diagnostics import counted
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
from hamel.study.limits import FAR, MOST, MOST_BROKEN, NEARBY, WORTH
from hamel.study.runs import TOO_LONG

ALONE = (
    "singular for this choice of quasi-velocities alone, which is compared by itself here "
    "(`hamel simulate` takes a new base or another choice there and goes on)"
)
NUMBER = re.compile(r"[-+.\de]*\d")  # in a reason


def advice(rows: Sequence[Row], reference: Reference, unmade: str = "") -> list[str]:
    """Sentences: the method to take, what the others cost, what holds the constraints, what broke,
    what to believe. `unmade`: why no run was made at all."""
    if unmade:
        return [f"No run was made: {unmade}."]
    own = [row for row in rows if not is_library(row)]
    judged = own or rows  # where libraries alone were asked for, they are what there is
    levels = (WORTH, *reversed(LEVELS), MOST)
    level = next((x for x in levels if x <= MOST and cheapest(judged, x)), None)
    if reference.doubt:
        lines = [f"No error can be given: {reference.doubt}. {_remedy(reference)}".strip()]
    elif level is None:
        lines = [_none_usable(judged)]
    else:
        lines = [
            *_recommended(judged, level),
            *_others(rows, judged, level),
            *_enforcement_lines(judged, level),
        ]
    return [*lines, *broken(own)]


def _none_usable(rows: Sequence[Row]) -> str:
    """How runs ended none of which is good enough; of those that broke there is more to say."""
    of_each = Counter(row["status"] for row in rows)
    told = {
        TOO_LONG: "took too long",
        "too coarse": f"had an error above {FAR:g}",
        "ok": f"had an error above {MOST:g}",
    }
    parts = [f"{of_each[status]} {words}" for status, words in told.items() if of_each[status]]
    rest = sum(count for status, count in of_each.items() if status not in told)
    parts += [f"{rest} broke off or {'was' if rest == 1 else 'were'} wrong"] if rest else []
    return f"No run reached a usable error: of {counted(len(rows), 'run')} {', '.join(parts)}."


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


def _others(rows: Sequence[Row], judged: Sequence[Row], level: float) -> list[str]:
    own = [row for row in rows if not is_library(row)]
    best = cheapest(judged, level)
    groups = {
        "the quasi-velocity equations": [r for r in own if not is_traditional(r)],
        "the traditional equations": [r for r in own if is_traditional(r)],
        "the best library solver": [r for r in rows if is_library(r)],
    }
    parts = [
        f"{name} {_against(group, judged, level)}"
        for name, group in groups.items()
        if group and not any(row is best for row in group)
    ]
    text = "; ".join(parts)
    return [f"{text[0].upper()}{text[1:]}."] if parts else []


def _against(group: Sequence[Row], judged: Sequence[Row], level: float) -> str:
    """What the methods of a group take, in words, at an error that they came to themselves: with
    few tolerances one that just misses a level would be blamed for all that the next one takes."""
    pair = rivals(group, judged, level)
    if pair is None:
        return "reached no usable error" if not good(group) else "had no run to compare with"
    row, fastest = pair
    ratio, error = _slower(row["ms"] / fastest["ms"]), f"an error of {row['error']:.1e}"
    if row["error"] > NEARBY * level:
        return f"came no nearer than {error}, for which it {ratio} ({method(row)})"
    return f"{ratio} at {error} ({method(row)})"


def rivals(group: Sequence[Row], judged: Sequence[Row], level: float) -> tuple[Row, Row] | None:
    """Of the best method of a group the run whose error is nearest to the level, and the fastest
    run of all that is as exact; None where no run is."""
    pairs: list[tuple[Row, Row]] = []
    for rows in families(
        good(group), "formulation", "choice", "enforcement", "integrator"
    ).values():
        matched = [row for row in rows if cheapest(judged, row["error"])]
        if matched:
            row = min(matched, key=lambda each: _decades(each, level))
            fastest = cheapest(judged, row["error"])
            assert fastest is not None  # or it would not be matched
            pairs.append((row, fastest))
    return min(pairs, key=lambda pair: _rank(pair[0], pair[1], level), default=None)


def _rank(row: Row, fastest: Row, level: float) -> tuple[bool, float]:
    """Those near the level first, then the faster ones."""
    return _decades(row, level) > math.log10(NEARBY), row["ms"] / fastest["ms"]


def _decades(row: Row, level: float) -> float:
    """Between the error of a run and a level."""
    return abs(math.log10(row["error"] / level))


def _slower(ratio: float) -> str:
    """Times that differ by less than noise are the same; the advice takes the run that drifts less
    of them."""
    if ratio < NOISE:
        return "took as long (for all one can tell)"
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
        lines.append(
            (len(rows), f"{rows[0]['cause']}: {len(rows)} of {counted(total, 'run')}: {which}.")
        )
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
    if status == Status.SINGULAR_CHOICE.cause:
        return ALONE
    return status


def _ms(row: Row) -> str:
    return f"{row['ms']:.3g}"
