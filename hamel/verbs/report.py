"""report: which method reaches which error at which cost, for one model or several, as a page, a
table and JSON."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Collection, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import hamel
from codegen.compiler import INSTALL, find_compiler
from codegen.integrators import INTEGRATORS
from derive.choices.named import declared
from derive.diagnostics import (
    AssumptionError,
    Diagnostic,
    ModelError,
    ToolchainError,
    counted,
    did_you_mean,
    listed,
)
from derive.enforcement import ENFORCEMENTS
from derive.formulations import FORMULATIONS
from derive.formulations.charts import BETWEEN
from derive.mechanics.records import System
from derive.model.records import CHOICE_KINDS, Extreme
from derive.robots import RobotFile
from derive.robots.reading import load
from hamel.build.files import write_text
from hamel.build.stages import mechanics_of
from hamel.draw.mechanism import picture, svg
from hamel.engines import PROCESSES, engine
from hamel.records import ExtremeRow, Reported, as_json
from hamel.settings import settings, units
from hamel.study import page
from hamel.study.extremes import files, judgements
from hamel.study.judgement import told
from hamel.study.plan import LIBRARIES, Restrictions
from hamel.study.study import Case, Study, study

if TYPE_CHECKING:
    from rich.console import Console


def run(
    paths: Sequence[str | PathLike[str]],
    out: str | Path,
    time: float,
    values: Mapping[str, float | str],
    asked: Restrictions,
    extremes: Sequence[str | PathLike[str]],
    progress: Callable[[float], None] | None,
) -> Reported:
    """Every model studied for `time` seconds of its motion, extreme cases judged, and report.html,
    report.csv and report.json written to `out`.

    Models are studied one after the other, the runs of each in as many processes as there are
    cores; `progress` gets the share of the whole from 0 to 1. What is wrong with a model, a setting
    or a name is raised as ModelError before anything is run, ToolchainError where nothing can be
    written.
    """
    _check((*paths, *extremes), time, asked)
    cases = _cases(paths, time, values)
    _check_choices(asked.choices, paths)
    _check_methods(asked.compare, paths)
    studies = []
    with (
        engine(PROCESSES) as processes,
        tempfile.TemporaryDirectory(prefix="hamel-", ignore_cleanup_errors=True) as folder,
    ):
        for number, case in enumerate(cases):

            def advance(done: float, of: float, number: int = number) -> None:
                if progress is not None:
                    progress((number + done / of) / len(cases))

            studies.append(study(case, asked, processes, Path(folder) / f"model{number}", advance))
    _check_runs(studies, extremes)
    return _written(studies, _extremes(extremes), Path(out), asked.compare)


def _check_runs(studies: Sequence[Study], extremes: Sequence[str | PathLike[str]]) -> None:
    """Of what does not go together nothing is written."""
    if not extremes and not any(each.planned for each in studies):
        raise AssumptionError(
            [
                Diagnostic(message=f"{each.model}: nothing asked for can be run: {each.unmade}")
                for each in studies
            ]
        )


def _figures(studies: Sequence[Study]) -> list[str]:
    """The mechanism of each model; names of its parts differ between figures of one page."""
    drawings = [picture(mechanics_of(load(study.file))) for study in studies]
    return [svg(x, f"mechanism-{k}") if x else "" for k, x in enumerate(drawings, 1)]


def _check(paths: Sequence[str | PathLike[str]], time: float, asked: Restrictions) -> None:
    floating = next((path for path in paths if isinstance(path, RobotFile)), None)
    if floating is not None:
        raise ModelError(
            f"a report is about files as they are: {floating}",
            "the model that `hamel import --floating` writes",
        )
    if not paths:
        raise ModelError("no model is named", "hamel report models/four_bar.yaml")
    for name, value in (
        ("time", time),
        ("budget", asked.budget),
        *(("rtol", rtol) for rtol in asked.tolerances),
    ):
        if not 0 < value < float("inf"):
            raise ModelError(f"{name} is {value}, which is not a positive number")
    _check_names(
        "formulation", asked.formulations, [formulation.name for formulation in FORMULATIONS]
    )
    _check_names(
        "enforcement", asked.enforcements, [enforcement.name for enforcement in ENFORCEMENTS]
    )
    _check_names(
        "integrator", asked.integrators, [*(method.name for method in INTEGRATORS), LIBRARIES]
    )
    if find_compiler() is None:
        raise ToolchainError(
            "no C compiler found, and run times without one say nothing", hint=INSTALL
        )


def _check_choices(names: Collection[str], paths: Sequence[str | PathLike[str]]) -> None:
    """Of each choice some model has to know what it is: one of its file, a kind, or a partition."""
    systems = [mechanics_of(load(path)) for path in paths]
    for name in names:
        problems = [problem for each in systems if (problem := _no_choice(each, name))]
        if problems and len(problems) == len(systems):
            raise problems[0]


def _no_choice(system: System, name: str) -> ModelError | None:
    """Why a name is of no choice of this model."""
    try:
        for part in name.split(BETWEEN):
            declared(system, part.strip())
    except ModelError as problem:
        return problem
    return None


def _check_methods(names: Sequence[str], paths: Sequence[str | PathLike[str]]) -> None:
    """Two different names that can be a formulation, a choice or an enforcement."""
    if not names:
        return
    if len(names) != 2 or names[0] == names[1]:
        raise ModelError(
            "two different methods are compared", "--compare quasi_velocities augmented"
        )
    known = [*(x.name for x in FORMULATIONS), *(x.name for x in ENFORCEMENTS), *CHOICE_KINDS]
    known += [choice.name for path in paths for choice in load(path).choices]
    _check_names("method", names, known)


def _check_names(kind: str, names: Collection[str], known: Sequence[str]) -> None:
    for name in names:
        if name not in known:
            raise ModelError(
                f"unknown {kind} '{name}'; {did_you_mean(name, known) or listed(known)}"
            )


def _cases(
    paths: Sequence[str | PathLike[str]], time: float, values: Mapping[str, float | str]
) -> list[Case]:
    """A setting goes to every model that has the name; one that no model has is refused."""
    models = [load(path) for path in paths]
    cases, used = [], set()
    for path, model in zip(paths, models):
        known = units(model)
        own = {
            name: value
            for name, value in values.items()
            if "".join(name.split()) in known or len(paths) == 1
        }
        settings(model, own)
        used |= own.keys()
        mechanics_of(model)  # what is wrong with a model is said before anything is run
        cases.append(Case(path, own, time))
    unknown = [name for name in values if name not in used]
    if unknown:
        raise ModelError(f"'{unknown[0]}' is set, but none of the models has such a value")
    return cases


def _extremes(paths: Sequence[str | PathLike[str]]) -> tuple[ExtremeRow, ...]:
    """All cases; one that nothing can judge is a row that did not pass, and hides no other."""
    rows: list[ExtremeRow] = []
    cases = [(model, case) for model in map(load, files(paths)) for case in model.extremes]
    for (model, case), (_, judge) in zip(cases, judgements(paths)):
        try:
            rows.append(judge())
        except ModelError as error:
            rows.append(_unjudged(model.name, case, error.diagnostics[0].message))
    return tuple(rows)


def _unjudged(model: str, case: Extreme, why: str) -> ExtremeRow:
    expected = "refused" if case.refused else "survived"
    entries = (
        model,
        case.name,
        case.about,
        "",
        "not judged",
        None,
        case.tolerance,
        why,
        expected,
        False,
        "",
    )
    return ExtremeRow(*entries, 0, 0.0, 0.0, 0.0, 0.0)


def _written(
    studies: Sequence[Study], extremes: tuple[ExtremeRow, ...], out: Path, compare: Sequence[str]
) -> Reported:
    rows = tuple(told(row) for study in studies for row in study.rows)
    record = Reported(
        model=", ".join(study.model for study in studies),
        passed=all(row.passed for row in extremes)
        and not any(study.reference.contradicted for study in studies),
        rows=rows,
        models=tuple(page.summary(study, compare) for study in studies),
        extremes=extremes,
        html=out / "report.html",
        csv=out / "report.csv",
        json=out / "report.json",
    )
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ToolchainError(
            f"cannot write {out}: {error.strerror or error}", hint="choose another folder with -o"
        ) from error
    text = page.page(studies, extremes, hamel.__version__, _figures(studies), compare)
    write_text(record.html, text)
    write_text(record.csv, page.as_csv(rows))
    write_text(record.json, json.dumps(as_json(record), allow_nan=False, ensure_ascii=False) + "\n")
    return record


def show(record: Reported, console: Console) -> None:
    """The advice for each model, the extreme cases, and where the files are."""
    for model in record.models:
        console.print(f"{model['model']}, {model['time']:g} s:")
        for line in (*model["compared"], *model["advice"]):
            console.print(f"  {line}")
    if record.extremes:
        console.print(page.outcomes(record.extremes))
    complete = sum(row["status"] == "ok" for row in record.rows)
    runs = f"{counted(len(record.rows), 'run')}, {complete} to the end; " if record.rows else ""
    console.print(f"{runs}wrote {record.html}, {record.csv.name} and {record.json.name}")
