"""One model: what is planned is built, run by the workers, and judged by a reference solution that
two tight runs agree on."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from codegen.integrators import INTEGRATORS
from hamel.study import building, plan
from hamel.study.crew import Crew, Message, Task
from hamel.study.judging import Judge, Reference, agreed
from hamel.study.libraries import LIBRARY_LIMIT
from hamel.study.plan import DEFAULT, Asked, Excluded, Unit
from hamel.study.running import TOO_LONG
from hamel.study.storage import Found

# Of the two runs of the reference: two integrators on two formulations, so that they share no error
# of discretisation. The second pair is tried where the first takes too long.
TIGHT = ((("dop853", 1e-14), ("dopri5", 1e-14)), (("radau", 1e-11), ("dop853", 1e-11)))
EXACT_LIMIT = 20.0  # seconds of a tight run
BUILD_LIMIT = 120.0
GRACE = 60.0  # seconds on top of what a message should take, for machines that are busy otherwise
TRACKED = 1e-8  # tolerance of the motions whose violations are drawn over time


@dataclass(frozen=True)
class Case:
    """A model file with its settings, over `span` seconds."""

    path: str
    values: Mapping[str, float | str]
    span: float

    @property
    def start(self) -> dict[str, Any]:
        return {"path": self.path, "values": dict(self.values)}


@dataclass(frozen=True)
class Study:
    """Everything found about a model; rows as the report has them."""

    model: str
    file: str
    span: float
    reference: Reference
    rows: tuple[dict[str, Any], ...]
    excluded: tuple[Excluded, ...]
    tracks: tuple[dict[str, Any], ...]
    seconds: float


@dataclass
class Worksite:
    """What is known so far of a model's units."""

    case: Case
    asked: Asked
    crew: Crew
    found: Found
    folder: Path
    advance: Callable[[float, float], None]  # done, of
    excluded: list[Excluded] = field(default_factory=list)
    ready: dict[Unit, str] = field(default_factory=dict)  # folders of modules
    places: Iterator[int] = field(default_factory=itertools.count)  # each folder is used once


def studied(
    case: Case, asked: Asked, crew: Crew, folder: Path, advance: Callable[[float, float], None]
) -> Study:
    """All of it; what was found before is not computed again. `folder` is for the modules."""
    begin = time.monotonic()
    started = building.start(case.path, case.values)
    planned = plan.plan(started.system, asked)
    options = {"report": 1, "values": sorted(case.values.items()), "span": case.span}
    site = Worksite(
        case, asked, crew, Found(case.path, options), folder, advance, [*planned.excluded]
    )
    units = _built(site, planned.units)
    judge = Judge(started.system, _reference(site, units), case.span)
    made = _measured(site, units, _runs(site, units, judge.reference.scale))
    made += _library_rows(site, units)
    rows = judge.rows(started.system.model.name, made)
    return Study(
        model=started.system.model.name,
        file=case.path,
        span=case.span,
        reference=judge.confirmed(made),
        rows=tuple(rows),
        excluded=tuple(site.excluded),
        tracks=tuple(_tracks(site, units)),
        seconds=time.monotonic() - begin,
    )


# ---- modules


def _name(unit: Unit, *more: str) -> str:
    return "|".join((unit.formulation, unit.choice, unit.own, *more))


def _built(site: Worksite, units: Sequence[Unit]) -> list[Unit]:
    """The units that can be built, known or built now; the others are noted with their reasons."""
    _ensure(
        site,
        [unit for unit in units if _name(unit, "built") not in site.found],
        time.monotonic() + site.asked.budget,
    )
    good = []
    for unit in units:
        late = {
            "refused": f"not built: the {site.asked.budget:g} s for modules were used up; "
            "the same command goes on"
        }
        about: dict[str, Any] = site.found.get(_name(unit, "built")) or late
        if "refused" in about:
            site.excluded.append(
                Excluded(unit.formulation, unit.choice, unit.own, "", about["refused"])
            )
        else:
            good.append(unit)
            site.excluded += [
                Excluded(unit.formulation, unit.choice, k, "", why)
                for k, why in about["misfits"].items()
            ]
    return good


def _ensure(site: Worksite, units: Sequence[Unit], end: float = math.inf) -> None:
    """Modules on disk for these units; those that are not ready at the time `end` are left, but for
    two."""
    missing = [unit for unit in dict.fromkeys(units) if unit not in site.ready]
    tasks = []
    for unit in missing:
        place = str(site.folder / f"unit{next(site.places)}" / "module")
        arguments = {**site.case.start, "unit": unit.about, "span": site.case.span, "folder": place}
        tasks.append(Task("build", arguments, BUILD_LIMIT + GRACE, unit))
    for task, message in site.crew.answers(tasks):
        if "operations" in message:
            site.ready[task.about] = task.arguments["folder"]
            site.found.put(_name(task.about, "built"), message)
        elif "error" in message:
            site.found.put(_name(task.about, "built"), {"refused": message["error"]})
        if time.monotonic() > end and len(site.ready) >= 2:
            break


# ---- reference


def _reference(site: Worksite, units: Sequence[Unit]) -> Reference:
    """Two tight runs of different formulations where there are two, else of different choices or
    integrators."""
    plain = [unit for unit in units if not unit.own]
    others = [unit for unit in plain if not unit.choice]
    own = [unit for unit in plain if unit.choice]
    found: list[tuple[str, dict[str, Any]]] = []
    for first, second in TIGHT:
        found = _first_exact(site, own or others, *first)
        used = [unit for unit in plain if found and found[0][0].startswith(_title(unit))]
        rest = [unit for unit in (*others, *own) if unit not in used]
        found += _first_exact(site, rest or plain, *second)
        if len(found) == 2:
            break
    return agreed(found)


def _first_exact(
    site: Worksite, units: Sequence[Unit], integrator: str, rtol: float
) -> list[tuple[str, dict[str, Any]]]:
    """The first unit's run that comes to its end."""
    for unit in units:
        found = _exact(site, [unit], integrator, rtol)
        if found:
            return found
    return []


def _exact(
    site: Worksite, units: Sequence[Unit], integrator: str, rtol: float
) -> list[tuple[str, dict[str, Any]]]:
    names = {unit: _name(unit, "exact", integrator, f"{rtol:.0e}") for unit in units}
    missing = [unit for unit in units if names[unit] not in site.found]
    _ensure(site, missing)
    tasks = []
    for unit in missing:
        run = {"enforcement": _usual(site, unit), "integrator": integrator, "rtol": rtol}
        arguments = {
            **site.case.start,
            "folder": site.ready[unit],
            "span": site.case.span,
            "run": run,
            "limit": EXACT_LIMIT,
        }
        tasks.append(Task("exact", arguments, EXACT_LIMIT + GRACE, unit))
    for task, message in site.crew.answers(tasks):
        if "over" not in message:
            site.found.put(names[task.about], message)
    answers = [(unit, site.found.get(names[unit]) or {}) for unit in units]
    return [
        (f"{_title(unit)}, {integrator} at {rtol:.0e}", answer)
        for unit, answer in answers
        if answer.get("sizes")
    ]


def _title(unit: Unit) -> str:
    return f"{unit.formulation} ({unit.choice})" if unit.choice else unit.formulation


def _usual(site: Worksite, unit: Unit) -> str:
    return site.found[_name(unit, "built")]["enforcements"][0]


# ---- rows

Wanted = list[tuple[Unit, dict[str, Any]]]
Made = list[tuple[Unit, dict[str, Any], dict[str, Any]]]


def _runs(site: Worksite, units: Sequence[Unit], scale: int) -> Wanted:
    """Every run of every unit; those of the first integrator come first, then those that are
    compared with every enforcement."""
    asked, wanted = site.asked, []
    compared = (
        {units[0], *(unit for unit in units if unit.formulation == "augmented")} if units else set()
    )
    for unit in units:
        enforcements = site.found[_name(unit, "built")]["enforcements"]
        wanted += [(unit, run) for run in plan.runs(asked, enforcements, unit in compared, scale)]
    return sorted(
        wanted,
        key=lambda item: (item[1]["integrator"] != INTEGRATORS[0].name, item[0] not in compared),
    )


def _measured(site: Worksite, units: Sequence[Unit], wanted: Wanted) -> Made:
    """The rows of all runs, from the cache or made now; those the budget has no time for are
    noted."""
    each = site.crew.size * site.asked.budget / max(1, len(wanted))
    limit, share = min(30.0, max(0.3, 20 * each)), min(0.05, max(0.002, each / 4))
    missing = [
        (unit, run)
        for unit, run in wanted
        if not _is_known(site.found.get(_name(unit, run["key"])), limit)
    ]
    _ensure(site, [unit for unit, _ in missing])
    done, end = len(wanted) - len(missing), time.monotonic() + site.asked.budget
    tasks = list(_tasks(site, missing, limit, share))
    while tasks and time.monotonic() < end:
        late = []
        for task, message in site.crew.answers(tasks):
            if "run" in message:
                _put(site, task.about[0], message, limit)
                done += 1
                site.advance(done, len(wanted))
            else:
                late += _left(site, task, message, limit)
            if time.monotonic() > end:
                break
        tasks = list(_tasks(site, late, limit, share))
    return _collected(site, wanted)


def _is_known(row: Mapping[str, Any] | None, limit: float) -> bool:
    """A run that took too long may do with more time."""
    return row is not None and (row["status"] != TOO_LONG or row.get("limit", 0.0) >= 0.99 * limit)


def _tasks(site: Worksite, missing: Wanted, limit: float, share: float) -> Iterator[Task]:
    """One for the runs of a unit by the first integrator, one for those by the others."""
    groups: dict[tuple[Unit, bool], list[dict[str, Any]]] = {}
    for unit, run in missing:
        groups.setdefault((unit, run["integrator"] == INTEGRATORS[0].name), []).append(run)
    for (unit, _), runs in groups.items():
        about = {
            "span": site.case.span,
            "folder": site.ready[unit],
            "runs": runs,
            "limit": limit,
            "share": share,
        }
        yield Task("run", {**site.case.start, **about}, GRACE + 10 * limit, (unit, runs))


def _put(site: Worksite, unit: Unit, message: Message, limit: float) -> None:
    row = message["row"]
    site.found.put(
        _name(unit, message["run"]), {**row, "limit": limit} if row["status"] == TOO_LONG else row
    )


def _left(site: Worksite, task: Task, message: Message, limit: float) -> Wanted:
    """What is left of a task that came to its end: nothing, unless its worker was killed in the
    middle of a run."""
    unit, runs = task.about
    left = [run for run in runs if _name(unit, run["key"]) not in site.found]
    if message.get("over") == "done" or not left:
        return []
    status = TOO_LONG if "over" in message else message["error"]
    family = (left[0]["enforcement"], left[0]["integrator"])
    lost = [run for run in left if (run["enforcement"], run["integrator"]) == family]
    for run in lost:
        _put(site, unit, {"run": run["key"], "row": {"status": status}}, limit)
    return [(unit, run) for run in left if run not in lost]


def _collected(site: Worksite, wanted: Wanted) -> Made:
    made: Made = []
    late: dict[Unit, int] = {}
    for unit, run in wanted:
        row = site.found.get(_name(unit, run["key"]))
        if row is None:
            late[unit] = late.get(unit, 0) + 1
            continue
        operations = site.found[_name(unit, "built")]["operations"]
        made.append((unit, run, {**row, "operations": operations}))
    for unit, count in late.items():
        budget = f"the {site.asked.budget:g} s for this model were used up"
        reason = f"{count} runs not done: {budget}; the same command goes on"
        site.excluded.append(Excluded(unit.formulation, unit.choice, unit.own, "", reason))
    return made


def _library_rows(site: Worksite, units: Sequence[Unit]) -> Made:
    """CVODES, IDAS, and SciPy's solvers on the default choice and on the augmented equations."""
    if site.asked.integrators and "libraries" not in site.asked.integrators:
        return []
    missing, wanted, tasks = plan.missing_libraries(), [], []
    for formulation, solvers in plan.SOLVERS:
        unit = next(
            (unit for unit in units if unit.formulation == formulation and not unit.own), None
        )
        for solver in solvers if unit is not None else ():
            assert unit is not None
            if solver in missing:
                site.excluded.append(
                    Excluded(formulation, unit.choice, "", solver, missing[solver])
                )
                continue
            own = [(unit, run) for run in plan.library_runs(solver, site.asked.tolerances)]
            wanted += own
            late = [run for _, run in own if _name(unit, run["key"]) not in site.found]
            if late:
                tasks.append((unit, solver, late))
    _ensure(site, [unit for unit, _, _ in tasks])
    _run_libraries(site, tasks)
    return [
        (unit, run, site.found[_name(unit, run["key"])])
        for unit, run in wanted
        if _name(unit, run["key"]) in site.found
    ]


def _run_libraries(
    site: Worksite, groups: Sequence[tuple[Unit, str, list[dict[str, Any]]]]
) -> None:
    tasks = []
    for unit, solver, runs in groups:
        how = {
            "span": site.case.span,
            "unit": unit.about,
            "solver": solver,
            "runs": runs,
        }
        arguments = {**site.case.start, "folder": site.ready[unit], **how}
        tasks.append(Task("library", arguments, GRACE, (unit, runs)))
    for task, message in site.crew.answers(tasks):
        if "run" in message:
            _put(site, task.about[0], message, LIBRARY_LIMIT)
        elif "ready" not in message:
            unit, runs = task.about
            for run in [run for run in runs if _name(unit, run["key"]) not in site.found]:
                status = (
                    TOO_LONG if message.get("over") == "killed" else message.get("error", "not run")
                )
                _put(site, unit, {"run": run["key"], "row": {"status": status}}, LIBRARY_LIMIT)


# ---- over time


def _tracks(site: Worksite, units: Sequence[Unit]) -> list[dict[str, Any]]:
    """Violations over time: the default unit with every enforcement, the other formulations without
    any."""
    wanted = []
    for unit in units:
        known = site.found[_name(unit, "built")]["enforcements"]
        enforcements = [
            enforcement
            for enforcement in known
            if not site.asked.enforcements or enforcement in site.asked.enforcements
        ]
        if unit == units[0] or unit.own:
            wanted += [(unit, enforcement) for enforcement in enforcements]
        elif unit.formulation == "augmented":
            wanted += [(unit, enforcement) for enforcement in enforcements if enforcement == "none"]
    made = {(unit, enforcement): _name(unit, "track", enforcement) for unit, enforcement in wanted}
    missing: dict[Unit, list[dict[str, Any]]] = {}
    for (unit, enforcement), name in made.items():
        if name not in site.found:
            run = {
                "enforcement": enforcement,
                "integrator": INTEGRATORS[0].name,
                "rtol": TRACKED,
                "key": name,
            }
            missing.setdefault(unit, []).append(run)
    _ensure(site, [*missing])
    tasks = [
        Task(
            "track",
            {
                **site.case.start,
                "folder": site.ready[unit],
                "span": site.case.span,
                "runs": runs,
                "limit": 5.0,
            },
            GRACE,
        )
        for unit, runs in missing.items()
    ]
    for _, message in site.crew.answers(tasks):
        if "track" in message:
            site.found.put(message["track"], message)
    known = [
        (unit, enforcement, site.found.get(name)) for (unit, enforcement), name in made.items()
    ]
    return [
        {**track, "about": _label(unit, enforcement)}
        for unit, enforcement, track in known
        if track and "t" in track
    ]


def _label(unit: Unit, enforcement: str) -> str:
    return (
        f"{'' if unit.formulation == DEFAULT else unit.formulation + ', '}{unit.own or enforcement}"
    )
