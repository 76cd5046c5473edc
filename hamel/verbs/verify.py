"""verify: compare the compiled module of each choice with an independent derivation, at random
admissible states."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from codegen.emit import emit, on_request
from codegen.loader import load
from derive.diagnostics import ModelError, listed
from derive.formulations import equations
from derive.formulations.charts import together
from derive.linearize.minimal import with_linearization
from derive.robots.reading import load as load_model
from hamel.build.folder import differences, manifest
from hamel.build.module import compiled, temporary_module
from hamel.build.options import BuildOptions
from hamel.build.stages import (
    equations_of,
    mechanics_of,
    program_for,
    program_of,
    usable_choices,
    with_emitted,
)
from hamel.build.targets import subject_of, target_checks
from hamel.records import CheckLine, Mutations, Verified
from hamel.show import number, refusals, table
from hamel.verify import Verification, verification
from hamel.verify.mutation.mutations import mutations
from hamel.verify.published import INTEGRATOR, published_checks
from hamel.verify.shipped import FOR_TARGETS, shipped, shipped_checks

if TYPE_CHECKING:
    from rich.console import Console

    from codegen.program import Program
    from derive.formulations.records import Equations
    from hamel.verify.targets import Subject

SHOWN = 5  # files that are named at once


def run(
    path: str | PathLike[str], options: BuildOptions, states: int, seed: int, mutate: bool = False
) -> Verified:
    """Checks of each usable choice, or of the options' alone, at `states` random admissible states
    drawn from `seed`. Each choice is compiled for it. Without a choice what `build` makes by itself
    is among them, where that is several charts.

    Functions on request that the options name are compared as well. With `mutate` errors are
    planted too: passed then means that each was caught. Raises ModelError for a count below one or
    a negative seed, HamelError for a name that is no function.
    """
    for name, value, least in (("states", states, 1), ("seed", seed, 0)):
        if value < least:
            raise ModelError(f"{name} is {value}, which is less than {least}")
    choice, formulation = options.choice, options.formulation
    functions = options.functions or ()
    model = load_model(path)
    mechanics = mechanics_of(model, options.constants)
    asked: dict[str, Equations] = {}
    if choice is not None:
        one = with_linearization(equations(mechanics, choice, formulation, moving=True))
        asked[together(one)] = one
    usable, refused = usable_choices(mechanics, formulation)
    built = with_linearization(
        equations(mechanics, choice, formulation, charts=True, moving=True)
    )  # what `build` makes of the same options
    wanted = asked or (usable | {together(built): built} if built.charts else usable)
    full = {name: _with_functions(e, functions) for name, e in wanted.items()}
    verifications = {
        name: _verification(name, usable | full, functions, states, seed) for name in wanted
    }
    checks = [line for name, one in verifications.items() for line in _lines(name, one)]
    checks += _published(next(iter(wanted.values())))
    varied = dict.fromkeys(name for one in verifications.values() for name in one.varied)
    planted = mutations(model, next(iter(full.values())), seed) if mutate else None
    passed = all(check.passed for check in checks) and (
        planted is None or planted.caught == planted.planted
    )
    return Verified(
        model.name, passed, tuple(checks), refused, states, seed, tuple(varied), planted
    )


def run_targets(
    path: str | PathLike[str], options: BuildOptions, states: int, seed: int
) -> Verified:
    """Each target of the options against the module, at `states` random admissible states drawn
    from `seed`. Raises HamelError for a name that is no target, AssumptionError for one that does
    not fit, ToolchainError where its tool is missing."""
    on_request(options.targets)
    equations = equations_of(path, options.choice, options.constants, options.formulation)
    program = program_for(equations, options)
    with target_subject(equations, program, states, seed) as subject:
        lines = [
            CheckLine(f"{check.target}: {c.name}", float(c.value), float(c.tolerance), c.passed)
            for check in target_checks(options.targets)
            for c in check.run(subject)
        ]
    passed = all(line.passed for line in lines)
    return Verified(program.name, passed, tuple(lines), {}, states, seed)


@contextmanager
def target_subject(
    equations: Equations, program: Program, states: int, seed: int
) -> Iterator[Subject]:
    """The module with the files of its targets, compiled in a folder for the time being, and
    arguments at random admissible states. Raises AssumptionError for a target that does not
    fit."""
    emitted = [kernel.name for kernel in program.kernels]
    with compiled(program.name, emit(program)) as made:
        checked = with_emitted(equations, program)
        rows = shipped(checked, emitted, seed, states, FOR_TARGETS, real=program.real)
        yield subject_of(program, made.module, rows)


def is_module(path: str | PathLike[str]) -> bool:
    """Whether this is the folder of a built module, and no model file."""
    return os.path.isdir(path) and bool(manifest(Path(path)))


def run_folder(folder: str | PathLike[str], options: Mapping[str, Any]) -> Verified:
    """Every file against the manifest, and every backend against the values that were stored when
    the module was verified. Code that is not what was verified is not run."""
    for name, value in options.items():
        if value:
            raise ModelError(f"{name} is for model files; {folder} is a module that was built")
    place = Path(folder)
    lines = differences(place)
    about = "; ".join(lines[:SHOWN]) or "every file is the one that was built"
    files = CheckLine(f"files: {about}", float(len(lines)), 0.0, not lines)
    checks = () if lines else shipped_checks(place, load(place))
    values = [
        CheckLine(f"shipped: {c.name}", float(c.value), float(c.tolerance), bool(c.passed))
        for c in checks
    ]
    passed = files.passed and all(check.passed for check in values)
    said = manifest(place)
    states = int(said.get("verification", {}).get("states", 0))
    return Verified(str(said.get("model")), passed, (files, *values), {}, states, 0)


def _with_functions(equations: Equations, functions: Collection[str]) -> Equations:
    """With what a build would emit of these names, so that checks look at it and errors are planted
    in it."""
    if not functions:
        return equations
    return with_emitted(equations, program_of(equations, ("default", *functions)))


def _verification(
    name: str,
    candidates: dict[str, Equations],
    functions: Collection[str],
    states: int,
    seed: int,
) -> Verification:
    chosen = candidates[name]
    others = tuple(other for key, other in candidates.items() if key != name)
    with temporary_module(chosen, functions=("default", *functions)) as module:
        return verification(
            chosen.system.model, chosen, module, states=states, seed=seed, others=others
        )


def _lines(name: str, found: Verification) -> list[CheckLine]:
    return [
        CheckLine(f"{name}: {c.name}", float(c.value), float(c.tolerance), bool(c.passed))
        for c in found.checks
    ]


def _published(equations: Equations) -> list[CheckLine]:
    """The values that the file quotes, by the first choice."""
    if not equations.system.model.published:
        return []
    equations = replace(equations, charts=())
    with temporary_module(equations, (INTEGRATOR,)) as module:
        checks = published_checks(equations, module)
    return [
        CheckLine(
            f"{equations.choice}: {c.name}", float(c.value), float(c.tolerance), bool(c.passed)
        )
        for c in checks
    ]


def show(record: Verified, console: Console) -> None:
    """One row per check, one column per choice: the worst relative error met."""
    values = {tuple(check.name.split(": ", 1)): check for check in record.checks}
    choices, names = (list(dict.fromkeys(key[i] for key in values)) for i in (0, 1))
    rows = []
    for name in names:
        results = [values.get((choice, name)) for choice in choices]
        limit = next(check.tolerance for check in results if check)
        rows.append((name, *(_cell(check) for check in results), number(limit)))
    table(console, ("check", *choices, "tolerance"), rows, right=range(1, len(choices) + 2))
    refusals(record.refused, console)
    good = sum(check.passed for check in record.checks)
    console.print(
        f"{record.model}: {good} of {len(record.checks)} checks passed at {record.states} "
        "random states per choice"
    )
    if record.varied:
        console.print(f"varied with the states: {listed(record.varied)}")
    if record.mutations is not None:
        _show_mutations(record.mutations, console)


def _show_mutations(found: Mutations, console: Console) -> None:
    """Each check with the number of planted errors it saw, then what none saw."""
    seen = Counter(name for mutation in found.list for name in mutation.caught_by)
    table(
        console,
        ("check", "planted errors it saw"),
        [(name, str(count)) for name, count in seen.most_common()],
        right=range(1, 2),
    )
    for mutation in found.list:
        if not mutation.caught_by:
            console.print(f"  NOT SEEN  {mutation.where}, {mutation.what}")
    left = f"; {found.equivalent} more changes altered no number" if found.equivalent else ""
    console.print(
        f"planted errors, choice {found.choice}: {found.caught} of {found.planted} caught{left}"
    )


def _cell(check: CheckLine | None) -> str:
    if check is None:
        return "–"
    return number(check.value) if check.passed else f"FAILED {number(check.value)}"
