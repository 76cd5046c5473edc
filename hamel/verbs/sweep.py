"""sweep: many motions of one model, here or on a cluster, and what is known of them."""

from __future__ import annotations

import math
import os
import shlex
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from derive.diagnostics import ModelError, counted
from derive.robots import RobotFile
from hamel.engines import check_engine, engine
from hamel.optional import library
from hamel.records import KeptColumn, MovedStart, Swept
from hamel.show import number, table
from hamel.sweep.chunk import cause
from hamel.sweep.drive import driven
from hamel.sweep.folder import Folder
from hamel.sweep.limits import BARS
from hamel.sweep.page import PAGE, elsewhere, page
from hamel.sweep.plan import Asked, Plan, planned
from hamel.sweep.result import columns_of, dataset, held_of_rows, sensitivities
from hamel.sweep.summary import QUANTILES, of_json
from hamel.sweep.work import Held, all_of

if TYPE_CHECKING:
    from rich.console import Console


METHOD = (
    *("formulation", "choice", "enforcement", "alpha", "integrator", "step_size", "rtol", "atol"),
    "real",
)
USUAL = {"formulation": "quasi_velocities", "real": "float64"}  # what need not be said
FLAGS = {"floating": "--floating", "exact": "--exact", "unphysical": "--allow-unphysical"}


@dataclass(frozen=True)
class Running:
    """Where a sweep is written, what runs it, and which part of its motions may fail."""

    out: str | Path | None = None
    scheduler: str | None = None
    workers: int | None = None
    failures: float = 0.1
    progress: Callable[[Any], None] | None = None


def run(path: str | PathLike[str], asked: Asked, by: Running) -> Swept:
    """All motions that are missing in the folder, then the page. Raises ModelError for what is
    wrong with the question, AssumptionError where too many motions fail, ToolchainError where a
    library or the scheduler is missing or nothing can be written."""
    if not 0.0 <= by.failures <= 1.0:
        raise ModelError(f"failures is {by.failures}", "a part from 0 to 1")
    check_engine(by.scheduler, by.workers)
    if not asked.reduce:
        library("pyarrow", "keeping rows")
    begin = time.perf_counter()
    plan = planned(path, asked)
    place = str(by.out) if by.out else os.path.join("sweep", plan.model.name)
    folder = Folder(place, not asked.reduce)
    report = by.progress or (lambda progress: None)
    with engine(by.scheduler, by.workers) as result:
        folder.enter(dict(plan.about))  # of an engine that does not answer nothing is left there
        start = time.perf_counter()
        progress = driven(plan, result, folder, int(by.failures * plan.design.size), report)
        took = time.perf_counter() - start
    known = all_of(folder.summaries(plan.chunks, held_of_rows(plan)))
    indices, without = sensitivities(plan, folder)
    record = Swept(
        model=plan.model.name,
        folder=place,
        motions=plan.design.size,
        failed=sum(n for status, n in known["statuses"] if status not in (0, 11)),
        statuses={cause(status): n for status, n in known["statuses"]},
        reasons=tuple((k, cause(status)) for k, status in known["failures"]),
        moved=int(known["moved"]),
        moves=tuple(
            MovedStart(k, name, plan.units.get(name, ""), given, used)
            for k, name, given, used in known["moves"]
        ),
        kept=_columns(plan, known),
        sensitivities=indices,
        engine=result.about,
        made=progress.chunks,
        chunks=plan.chunks,
        lost=progress.lost,
        seconds=time.perf_counter() - begin,
        running=took,
        rate=progress.motions / took if progress.chunks else 0.0,
        notes=(*sorted(progress.notes), *without),
        page=f"{place}/{PAGE}",
        commands=_commands(path, plan, known),
        data=lambda: dataset(plan, folder),
    )
    folder.write(PAGE, page(plan, record, columns_of(plan, folder)).encode())
    return record


def _columns(plan: Plan, known: Held) -> tuple[KeptColumn, ...]:
    columns = []
    for each in plan.kept:
        of = of_json(known["columns"][each.label])
        quantiles = dict(zip(map(str, QUANTILES), of.quantiles(QUANTILES)))
        mean = of.mean if of.count else math.nan
        ends, histogram = (of.lowest, of.highest), of.histogram(BARS)
        columns.append(
            KeptColumn(
                each.label, each.unit, of.count, mean, of.deviation, quantiles, *ends, histogram
            )
        )
    return tuple(columns)


def _commands(path: str | PathLike[str], plan: Plan, known: Held) -> dict[str, str]:
    """By number: what makes the motions at the ends, and the first of those that failed or begin
    elsewhere, again."""
    numbers = {k for k, *_ in (*known["failures"], *known["moves"])}
    for each in plan.kept:
        of = of_json(known["columns"][each.label])
        numbers |= {k for _, k in (*of.lowest[:3], *of.highest[:3])}
    return {str(k): command(path, plan, k) for k in sorted(numbers)}


def command(path: str | PathLike[str], plan: Plan, k: int) -> str:
    """The command that makes motion k again, alone."""
    asked, design = plan.asked, plan.design
    values = {n: f"{float(c[0])!r}" for n, c in design.values(k, k + 1).items()}
    named = {n: f"{v} {plan.units.get(n, '')}".strip() for n, v in values.items()}
    held = {n: str(v) for n, v in asked.values.items()}
    sets = [f"--set={n}={v}" for n, v in {**held, **named}.items()]
    method = {**vars(asked.method), **design.method(k // design.per_method)}
    of_modes = any(each.how == "mode" for each in plan.kept)
    names = ("choice",) if of_modes else METHOD
    said = [n for n in names if method[n] not in (None, USUAL.get(n))]
    options = [f"--{n.replace('_', '-')}={method[n]}" for n in said]
    file = [str(path), *_of_robot(path)]
    if of_modes:
        at = [f"--at={asked.at}"] if asked.at else []
        return shlex.join(["hamel", "linearize", *file, *at, *options, *sets])
    fed = [f"--input={n}={v}" for n, v in asked.inputs.items()]
    span = [f"--time={asked.rows.time!r}"]
    span += [f"--start={asked.rows.start!r}"] if asked.rows.start else []
    return shlex.join(["hamel", "simulate", *file, *options, *span, *sets, *fed])


def _of_robot(path: str | PathLike[str]) -> list[str]:
    """How a URDF or MJCF file was read, as options."""
    if not isinstance(path, RobotFile):
        return []
    said = [option for name, option in FLAGS.items() if getattr(path, name)]
    said += [f"--include={folder}" for folder in path.include]
    return said + ([f"--parameters={path.parameters}"] if path.parameters else [])


def show(record: Swept, console: Console) -> None:
    """How many, how fast, what is known of each kept quantity, and what failed."""
    there = record.chunks - record.made
    again = f", {there} of {record.chunks} chunks were there" if there else ""
    console.print(
        f"{record.model}: {counted(record.motions, 'motion')} in {record.seconds:.3g} s by "
        f"{record.engine}{_rate(record)}{again}"
    )
    if record.lost:
        console.print(
            f"  {counted(record.lost, 'time')} a worker was lost, and its chunk made again"
        )
    for note in record.notes:
        console.print(f"  {note}")
    rows = [
        (
            f"{each.name} ({each.unit})" if each.unit else each.name,
            *(f"{x:.6g}" for x in (each.mean, each.deviation)),
            *(f"{end[0][0]:.6g}" if end else "–" for end in (each.lowest, each.highest)),
            *(f"{each.quantiles[q]:.4g}" for q in ("0.05", "0.5", "0.95")),
        )
        for each in record.kept
    ]
    head = ("kept", "mean", "deviation", "lowest", "highest", "5 %", "median", "95 %")
    table(console, head, rows, right=range(1, len(head)))
    for name, indices in record.sensitivities.items():
        order = sorted(
            zip(indices["names"], indices["first"], indices["total"]), key=lambda x: -x[2]
        )
        shown = ", ".join(f"{n} {number(f)} (total {number(t)})" for n, f, t in order)
        console.print(f"Sobol indices of {name}: {shown}")
    if record.moved:
        console.print(f"  {elsewhere(record)}")
    if record.failed:
        console.print(f"  {counted(record.failed, 'motion')} failed:")
        for status, count in _failed(record.statuses).items():
            console.print(f"    {count}: {status}")
        for k, _ in record.reasons[:1]:
            console.print(f"    {record.commands[str(k)]}")
    console.print(f"  results {record.folder}, read {record.page}")


def _rate(record: Swept) -> str:
    """Of the seconds that motions took; before and after them there is more to do."""
    if not record.made:
        return ""
    motions = round(record.rate * record.running)
    return f"; {motions} made in {record.running:.3g} s, {record.rate:.4g} a second"


def _failed(statuses: Mapping[str, int]) -> dict[str, int]:
    return {name: n for name, n in statuses.items() if name not in ("ok", "stopped by an event")}
