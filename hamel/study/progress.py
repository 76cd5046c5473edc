"""What is known so far of a model's study: modules, results, what was left out, and the time that
remains."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from codegen.integrators import INTEGRATORS
from derive.diagnostics import counted
from derive.robots import File
from hamel.engines import Engine
from hamel.study import modules, plan
from hamel.study.budget import Budget, budget_of
from hamel.study.limits import BUILD_LIMIT, BUILT, GRACE
from hamel.study.plan import Excluded, Restrictions, Unit
from hamel.study.results import Results
from hamel.study.series import Task

# Of the two runs of the reference: two integrators on two formulations, so that they share no error
# of discretisation. The second pair is tried where the first takes too long.
TIGHT = ((("dop853", 1e-14), ("dopri5", 1e-14)), (("radau", 1e-11), ("dop853", 1e-11)))


@dataclass(frozen=True)
class Case:
    """A model file with its settings, over `span` seconds."""

    path: File
    values: Mapping[str, float | str]
    span: float

    @property
    def start(self) -> dict[str, Any]:
        """What a worker process needs to read the model again: the path and the settings."""
        return {"path": self.path, "values": dict(self.values)}


@dataclass
class Progress:
    """What is known so far of a model's units."""

    case: Case
    asked: Restrictions
    workers: Engine
    results: Results
    folder: Path
    advance: Callable[[float, float], None]  # done, of
    excluded: list[Excluded] = field(default_factory=list)
    late: int = 0  # runs that there was no time for
    shown: float = 0.0  # the share of the whole that `advance` was told last
    budget: Budget = field(init=False)
    ready: dict[Unit, str] = field(default_factory=dict)  # folders of modules
    places: Iterator[int] = field(default_factory=itertools.count)  # each folder is used once

    def __post_init__(self) -> None:
        self.budget = budget_of(self.asked.budget)


def show(so_far: Progress, begin: float, end: float, done: float) -> None:
    """How far it is, where `done` of 1 is done of what takes it from begin to end; never back."""
    so_far.shown = max(so_far.shown, begin + (end - begin) * done)
    so_far.advance(so_far.shown, 1.0)


def name_of(unit: Unit, *more: str) -> str:
    """What results of a unit are stored under."""
    return "|".join((unit.formulation, unit.choice, unit.own, *more))


def _integrators(asked: Restrictions) -> list[str]:
    """What modules are built with: the integrators asked for, those of the reference solution, and
    the first, which shows violations over time."""
    exact = [name for pair in TIGHT for name, _ in pair]
    wanted = {*asked.integrators, INTEGRATORS[0].name, *exact}
    return [x.name for x in INTEGRATORS if not asked.integrators or x.name in wanted]


def built_name(so_far: Progress, unit: Unit) -> str:
    """Of what is known of a unit's module: another one with other integrators in it."""
    return name_of(unit, "built", *(_integrators(so_far.asked) if so_far.asked.integrators else ()))


def buildable(so_far: Progress, units: Sequence[Unit]) -> list[Unit]:
    """The units that can be built, known or built now; the others are noted with their reasons."""
    ensure(
        so_far,
        [unit for unit in units if built_name(so_far, unit) not in so_far.results],
    )
    good = []
    for unit in units:
        late = {
            "refused": f"not built: the {so_far.asked.budget:g} s for modules were used up; "
            "the same command goes on"
        }
        about: dict[str, Any] = so_far.results.get(built_name(so_far, unit)) or late
        if "refused" in about:
            so_far.excluded.append(
                Excluded(unit.formulation, unit.choice, unit.own, "", about["refused"])
            )
        else:
            good.append(unit)
            so_far.excluded += [
                Excluded(unit.formulation, unit.choice, k, "", why)
                for k, why in about["misfits"].items()
            ]
            so_far.excluded += [
                Excluded(unit.formulation, unit.choice, "", integrator, why)
                for integrator, why in about["unfit"].items()
            ]
    return good


def ensure(so_far: Progress, units: Sequence[Unit], needed: bool = False) -> None:
    """Modules on disk for these units; those that are not ready when the seconds for them are over
    are left, but for two, unless they are `needed`."""
    missing = [unit for unit in dict.fromkeys(units) if unit not in so_far.ready]
    series = [[_building(so_far, unit)] for unit in missing]

    def ready() -> float:
        return 0 if needed else len(so_far.ready)

    with closing(so_far.budget.built(so_far.workers, series, ready)) as finished:
        for number, outcome in enumerate(finished, 1):
            show(so_far, 0.0, BUILT, number / len(series))
            unit = outcome.task.subject
            name = built_name(so_far, unit)
            if outcome.status == "done":
                so_far.ready[unit] = outcome.task.arguments["folder"]
                so_far.results.put(name, outcome.value)
            elif outcome.reason:
                so_far.results.put(name, {"refused": outcome.reason})


Wanted = list[tuple[Unit, dict[str, Any]]]


def ready_of(so_far: Progress, missing: Wanted) -> Wanted:
    """Of runs that are missing those whose modules are on disk, built now where there is time."""
    ensure(so_far, [unit for unit, _ in missing])
    return [(unit, run) for unit, run in missing if unit in so_far.ready]


def _building(so_far: Progress, unit: Unit) -> Task:
    """Builds the module of a unit, in a folder of its own."""
    place = str(so_far.folder / f"unit{next(so_far.places)}" / "module")
    case = so_far.case
    arguments = {
        **case.start,
        "unit": unit.about,
        "span": case.span,
        "folder": place,
        "integrators": _integrators(so_far.asked),
    }
    return Task(modules.module, arguments, BUILD_LIMIT + GRACE, unit)


def simulation(so_far: Progress, unit: Unit, run: Mapping[str, Any]) -> dict[str, Any]:
    """What every run of a unit's module is told."""
    case = so_far.case
    return {**case.start, "folder": so_far.ready[unit], "span": case.span, "run": run}


def note_late(so_far: Progress, late: Mapping[Unit, int], integrator: str = "") -> None:
    """Runs of units that there was no time for."""
    for unit, count in late.items():
        so_far.late += count
        reason = f"{counted(count, 'run')} not done: {used_up(so_far)}"
        names = (unit.formulation, unit.choice, unit.own, integrator)
        so_far.excluded.append(Excluded(*names, reason))


def why_none(so_far: Progress) -> str:
    """Of runs none of which was made: the time, or what does not fit of what was asked for."""
    if so_far.late:
        return f"{counted(so_far.late, 'run')} not done: {used_up(so_far)}"
    fitting = [each for each in so_far.excluded if _is_asked(each, so_far.asked)]
    reasons = dict.fromkeys(f"{_titled(each)}: {each.reason}" for each in fitting)
    return "; ".join(reasons) or "the enforcements and integrators do not go together"


def _is_asked(each: Excluded, asked: Restrictions) -> bool:
    """Whether something that was left out was asked for: by its name, or with all others."""
    by_choice = each.choice != "" and each.choice in asked.choices
    by_formulation = not asked.formulations or each.formulation in asked.formulations
    return (
        each.formulation != ""
        and (by_choice or by_formulation)
        and each.enforcement in ("", *asked.enforcements)
        and each.integrator in ("", plan.LIBRARIES, *asked.integrators)
    )


def _titled(each: Excluded) -> str:
    choice = f" ({each.choice})" if each.choice else ""
    return f"{each.formulation}{choice}{f', {each.enforcement}' if each.enforcement else ''}"


def used_up(so_far: Progress) -> str:
    """Why something was not done, where the seconds were too few."""
    return f"the {so_far.asked.budget:g} s for this model were used up; the same command goes on"
