"""One model: what is planned is built, run by worker processes, and judged by a reference solution
that two tight runs agree on."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from codegen.integrators import INTEGRATORS
from derive.formulations.charts import BETWEEN
from derive.robots import File
from hamel.build.clock import Clock
from hamel.engines import Engine
from hamel.study import libraries, modules, plan, runs
from hamel.study.judgement import Judge, Reference, agreed
from hamel.study.limits import (
    BUILT,
    EXACT_LIMIT,
    EXACT_PARTS,
    EXACT_SHARE,
    GRACE,
    MEASURED_SHARE,
    RAN,
    TRACK_LIMIT,
    TRACKED,
)
from hamel.study.plan import DEFAULT, Excluded, Restrictions, Unit
from hamel.study.progress import (
    TIGHT,
    Case,
    Progress,
    Wanted,
    buildable,
    built_name,
    ensure,
    name_of,
    note_late,
    ready_of,
    show,
    simulation,
    used_up,
    why_none,
)
from hamel.study.results import Results
from hamel.study.runs import TOO_LONG
from hamel.study.series import Outcome, Task

GOES_ANYWHERE = "orthonormal"  # the choice that is regular wherever the constraint rows are


@dataclass(frozen=True)
class Study:
    """Everything found about a model; of rows that stopped, status and time are apart."""

    model: str
    file: File
    span: float
    reference: Reference
    rows: tuple[dict[str, Any], ...]
    excluded: tuple[Excluded, ...]
    tracks: tuple[dict[str, Any], ...]
    planned: int  # runs, made or not
    unmade: str  # why there is none, where none was made
    seconds: float


def study(
    case: Case,
    asked: Restrictions,
    workers: Engine,
    folder: Path,
    advance: Callable[[float, float], None],
) -> Study:
    """All of it; what was found before is not computed again. `folder` is for the modules."""
    before = time.monotonic()
    start = modules.start_now(case.path, case.values)
    planned = plan.plan(start.system, asked)
    options = {"report": 1, "values": sorted(case.values.items()), "span": case.span}
    so_far = Progress(
        case, asked, workers, Results(case.path, options), folder, advance, [*planned.excluded]
    )
    name, clock = start.system.model.name, Clock()
    with clock("modules", f"{name}: {len(planned.units)}"):
        units = buildable(so_far, planned.units)
        units += buildable(so_far, _charts(so_far, units))
    with clock("reference"):
        judge = Judge(start.system, _reference(so_far, units), case.span)
    wanted = _runs(so_far, units, judge.reference.scale)
    with clock("runs", str(len(wanted))):
        _measure(so_far, wanted, MEASURED_SHARE)
    with clock("violations", "over time"):
        tracks = _tracks(so_far, units)
    with clock("libraries"):
        libraries = _library_rows(so_far, units)
    with clock("runs", "the rest, where there is time"):
        _measure(so_far, wanted)
    measured = _collected(so_far, wanted) + libraries
    rows = judge.rows(name, measured)
    return Study(
        model=name,
        file=case.path,
        span=case.span,
        reference=judge.confirmed(measured),
        rows=tuple(rows),
        excluded=tuple(so_far.excluded),
        tracks=tuple(tracks),
        planned=len(rows) + so_far.late,
        unmade="" if rows else why_none(so_far),
        seconds=time.monotonic() - before,
    )


# ---- reference


def _charts(so_far: Progress, units: Sequence[Unit]) -> list[Unit]:
    """The default choice with the orthonormal one as its other chart, as `hamel simulate` goes on,
    where the motion leaves the default choice alone at a singular position."""
    alone = [unit for unit in units if unit.formulation == DEFAULT and not unit.own]
    if so_far.asked.choices or not alone or GOES_ANYWHERE not in {unit.choice for unit in alone}:
        return []
    default = alone[0]
    if default.choice == GOES_ANYWHERE or _exact(so_far, [default], *TIGHT[0][0]):
        return []
    return [Unit(DEFAULT, BETWEEN.join((default.choice, GOES_ANYWHERE)))]


def _reference(so_far: Progress, units: Sequence[Unit]) -> Reference:
    """Two tight runs of different formulations where there are two, else of different choices or
    integrators."""
    plain = [unit for unit in units if not unit.own]
    others = [unit for unit in plain if not unit.choice]
    own = [unit for unit in plain if unit.choice]
    references: list[tuple[str, dict[str, Any]]] = []
    for first, second in TIGHT:
        references = _first_exact(so_far, own or others, *first)
        used = [unit for unit in plain if references and references[0][0].startswith(_title(unit))]
        rest = [unit for unit in (*others, *own) if unit not in used]
        references += _first_exact(so_far, rest or plain, *second)
        if len(references) == 2:
            break
    reference = agreed(references)
    late = so_far.budget.runs < (1.0 - EXACT_SHARE) * so_far.budget.seconds
    return replace(reference, doubt=used_up(so_far)) if reference.doubt and late else reference


def _first_exact(
    so_far: Progress, units: Sequence[Unit], integrator: str, rtol: float
) -> list[tuple[str, dict[str, Any]]]:
    """The first unit's run that comes to its end."""
    for unit in units:
        if so_far.budget.runs < (1.0 - EXACT_SHARE) * so_far.budget.seconds:
            break
        exact = _exact(so_far, [unit], integrator, rtol)
        if exact:
            return exact
    return []


def _exact(
    so_far: Progress, units: Sequence[Unit], integrator: str, rtol: float
) -> list[tuple[str, dict[str, Any]]]:
    names = {unit: name_of(unit, "exact", integrator, f"{rtol:.0e}") for unit in units}
    limit = min(EXACT_LIMIT, so_far.asked.budget / EXACT_PARTS)
    missing = [unit for unit in units if not _is_tried(so_far.results.get(names[unit]), limit)]
    ensure(so_far, missing, needed=True)
    series = []
    for unit in missing:
        run = {"enforcement": _usual(so_far, unit), "integrator": integrator, "rtol": rtol}
        arguments = {**simulation(so_far, unit, run), "limit": limit}
        series.append([Task(runs.exact, arguments, EXACT_LIMIT + GRACE, unit)])
    for outcome in so_far.budget.ran(so_far.workers, series, share=0.0):
        if outcome.status in ("done", "refused"):
            value = outcome.value or {"failed": outcome.reason}
            so_far.results.put(names[outcome.task.subject], {**value, "limit": limit})
    ends = [(unit, so_far.results.get(names[unit]) or {}) for unit in units]
    return [
        (f"{_title(unit)}, {integrator} at {rtol:.0e}", end) for unit, end in ends if "sizes" in end
    ]


def _is_tried(end: Mapping[str, Any] | None, limit: float) -> bool:
    """A tight run that took too long may do with more time."""
    if end is None or end.get("failed") != TOO_LONG:
        return end is not None
    return end.get("limit", EXACT_LIMIT) >= 0.99 * limit


def _title(unit: Unit) -> str:
    return f"{unit.formulation} ({unit.choice})" if unit.choice else unit.formulation


def _usual(so_far: Progress, unit: Unit) -> str:
    return so_far.results[built_name(so_far, unit)]["enforcements"][0]


# ---- rows

Made = list[tuple[Unit, dict[str, Any], dict[str, Any]]]


def _runs(so_far: Progress, units: Sequence[Unit], scale: int) -> Wanted:
    """Every run of every unit; those of the first integrator come first, then those that are
    compared with every enforcement."""
    asked, wanted = so_far.asked, []
    compared = (
        {units[0], *(unit for unit in units if unit.formulation == "augmented")} if units else set()
    )
    for unit in units:
        built = so_far.results[built_name(so_far, unit)]
        planned = plan.runs(asked, built["enforcements"], unit in compared, scale)
        wanted += [(unit, run) for run in planned if run["integrator"] in built["integrators"]]
    return sorted(
        wanted,
        key=lambda item: (item[1]["integrator"] != INTEGRATORS[0].name, item[0] not in compared),
    )


def _measure(so_far: Progress, wanted: Wanted, part: float = 1.0) -> None:
    """Makes the rows of all runs that are not known, in that part of the time that is left."""
    each = so_far.workers.width() * so_far.asked.budget / max(1, len(wanted))
    limit, share = min(30.0, max(0.3, 20 * each)), min(0.05, max(0.002, each / 4))
    missing = [
        (unit, run)
        for unit, run in wanted
        if not _is_known(so_far.results.get(name_of(unit, run["key"])), limit)
    ]
    done = len(wanted) - len(missing)
    series = _families(so_far, ready_of(so_far, missing), limit, share)
    with closing(so_far.budget.ran(so_far.workers, series, _is_hopeless, part)) as finished:
        for outcome in finished:
            done += _put(so_far, outcome, limit)
            show(so_far, BUILT, RAN, done / len(wanted))


def _is_known(row: Mapping[str, Any] | None, limit: float) -> bool:
    """A run that took too long may do with more time."""
    return row is not None and (row["status"] != TOO_LONG or row.get("limit", 0.0) >= 0.99 * limit)


def _families(so_far: Progress, missing: Wanted, limit: float, share: float) -> list[list[Task]]:
    """The runs of a unit with one enforcement and one integrator follow each other, loose
    tolerances first. Each knows the keys of those behind it."""
    families: dict[tuple[Unit, str, str], list[dict[str, Any]]] = {}
    for unit, run in missing:
        family = (unit, run["enforcement"], run["integrator"])
        families.setdefault(family, []).append(run)
    series = []
    for (unit, _, _), members in families.items():
        keys, tasks = [run["key"] for run in members], []
        for number, run in enumerate(members):
            arguments = {**simulation(so_far, unit, run), "limit": limit, "share": share}
            tasks.append(Task(runs.row, arguments, GRACE + 10 * limit, (unit, keys[number:])))
        series.append(tasks)
    return series


def _is_hopeless(outcome: Outcome) -> bool:
    """After it tighter runs of its family are not tried."""
    return _row(outcome)["status"] == TOO_LONG or outcome.status != "done"


def _row(outcome: Outcome) -> dict[str, Any]:
    if outcome.status == "done":
        return outcome.value
    return {"status": outcome.reason or TOO_LONG}


def _put(so_far: Progress, outcome: Outcome, limit: float) -> int:
    """Stores the row of a run, and of those of its family that are not tried after it; how many."""
    unit, keys = outcome.task.subject
    row = _row(outcome)
    if not _is_hopeless(outcome):
        so_far.results.put(name_of(unit, keys[0]), row)
        return 1
    rest = {"status": row["status"]}
    for key, value in zip(keys, [row, *[rest] * (len(keys) - 1)]):
        late = {"limit": limit} if row["status"] == TOO_LONG else {}
        so_far.results.put(name_of(unit, key), {**value, **late})
    return len(keys)


def _collected(so_far: Progress, wanted: Wanted) -> Made:
    """The rows of all runs; those that there was no time for are noted."""
    results: Made = []
    late: dict[Unit, int] = {}
    for unit, run in wanted:
        row = so_far.results.get(name_of(unit, run["key"]))
        if row is None:
            late[unit] = late.get(unit, 0) + 1
            continue
        operations = so_far.results[built_name(so_far, unit)]["operations"]
        results.append((unit, run, {**row, "operations": operations}))
    note_late(so_far, late)
    return results


def _library_rows(so_far: Progress, units: Sequence[Unit]) -> Made:
    """CVODES, IDAS, and SciPy's solvers on the default choice and on the augmented equations."""
    if so_far.asked.integrators and plan.LIBRARIES not in so_far.asked.integrators:
        return []
    so_far.excluded += plan.without_libraries(units)
    missing, wanted = plan.missing_libraries(), []
    for formulation, solvers in plan.SOLVERS:
        fitting = (unit for unit in units if unit.formulation == formulation and not unit.own)
        unit = next(fitting, None)
        for solver in solvers if unit is not None else ():
            assert unit is not None
            if solver in missing:
                reason = missing[solver]
                so_far.excluded.append(Excluded(formulation, unit.choice, "", solver, reason))
            else:
                tolerances = so_far.asked.tolerances
                wanted += [(unit, run) for run in plan.library_runs(solver, tolerances)]
    _run_libraries(
        so_far, [(u, r) for u, r in wanted if name_of(u, r["key"]) not in so_far.results]
    )
    late: dict[str, dict[Unit, int]] = {}
    for unit, run in wanted:
        if name_of(unit, run["key"]) not in so_far.results:
            counts = late.setdefault(run["integrator"], {})
            counts[unit] = counts.get(unit, 0) + 1
    for solver, counts in late.items():
        note_late(so_far, counts, solver)
    return [
        (unit, run, so_far.results[name_of(unit, run["key"])])
        for unit, run in wanted
        if name_of(unit, run["key"]) in so_far.results
    ]


def _run_libraries(so_far: Progress, missing: Wanted) -> None:
    """One solver on one unit's equations after the other, loose tolerances first."""
    families: dict[tuple[Unit, str], list[dict[str, Any]]] = {}
    for unit, run in ready_of(so_far, missing):
        families.setdefault((unit, run["integrator"]), []).append(run)
    series = []
    for (unit, _), members in families.items():
        keys, tasks = [run["key"] for run in members], []
        for number, run in enumerate(members):
            arguments = {**simulation(so_far, unit, run), "unit": unit.about}
            tasks.append(Task(libraries.row, arguments, GRACE, (unit, keys[number:])))
        series.append(tasks)
    finished = so_far.budget.ran(so_far.workers, series, _is_slow)
    for done, outcome in enumerate(finished, 1):
        show(so_far, RAN, 1.0, done / len(missing))
        unit, (key, *rest) = outcome.task.subject
        so_far.results.put(name_of(unit, key), _row(outcome))
        for other in rest if _is_slow(outcome) else ():
            status = TOO_LONG if outcome.status == "done" else _row(outcome)["status"]
            so_far.results.put(name_of(unit, other), {"status": status})


def _is_slow(outcome: Outcome) -> bool:
    return outcome.status != "done" or outcome.value["slow"]


# ---- over time


def _tracks(so_far: Progress, units: Sequence[Unit]) -> list[dict[str, Any]]:
    """Violations over time: the default unit with every enforcement, the other formulations without
    any."""
    wanted = []
    for unit in units:
        known = so_far.results[built_name(so_far, unit)]["enforcements"]
        enforcements = [
            enforcement
            for enforcement in known
            if not so_far.asked.enforcements or enforcement in so_far.asked.enforcements
        ]
        if unit == units[0] or unit.own:
            wanted += [(unit, enforcement) for enforcement in enforcements]
        elif unit.formulation == "augmented":
            wanted += [(unit, enforcement) for enforcement in enforcements if enforcement == "none"]
    names = {key: name_of(key[0], "track", key[1]) for key in wanted}
    _track(so_far, {key: name for key, name in names.items() if name not in so_far.results})
    known = [
        (unit, enforcement, so_far.results.get(name)) for (unit, enforcement), name in names.items()
    ]
    return [
        {**track, "about": _label(unit, enforcement)}
        for unit, enforcement, track in known
        if track and "t" in track
    ]


def _track(so_far: Progress, missing: Mapping[tuple[Unit, str], str]) -> None:
    """Those of these units and enforcements, under their names; what there is no time for is
    noted."""
    ensure(so_far, [unit for unit, _ in missing])
    late, series = dict(missing), []
    for key, name in missing.items():
        unit, enforcement = key
        if unit not in so_far.ready:
            continue
        run = {"enforcement": enforcement, "integrator": INTEGRATORS[0].name, "rtol": TRACKED}
        arguments = {**simulation(so_far, unit, run), "limit": TRACK_LIMIT}
        series.append([Task(runs.track, arguments, GRACE, (key, name))])
    for outcome in so_far.budget.ran(so_far.workers, series):
        key, name = outcome.task.subject
        late.pop(key)
        if outcome.status == "done":
            so_far.results.put(name, outcome.value)
    reason = f"violations over time not drawn: {used_up(so_far)}"
    so_far.excluded += [
        Excluded(unit.formulation, unit.choice, enforcement, "", reason)
        for unit, enforcement in late
    ]


def _label(unit: Unit, enforcement: str) -> str:
    return (
        f"{'' if unit.formulation == DEFAULT else unit.formulation + ', '}{unit.own or enforcement}"
    )
