"""The build on one page: from a model file to a verified module in its place.

    file        → Model       the text is read and checked          derive.robots, hamel.build.fix
    Model       → System      mechanics in named terms              derive.states
    System      → Equations   one formulation, one choice           derive.formulations
    Equations   → Program     straight-line statements, counted     codegen.passes
    Program     → texts       every target                          codegen.emit
    texts       → binaries    the compiler, or the store            hamel.build.module
    binaries    → verified    against the independent reference     hamel.verify
    Equations   → pages       the derivation to read                derive.textbook
    verified    → folder      everything appears at once            hamel.build.folder

The compiler works while the derivation is verified. Nothing is written to the place of the module
before all of it went well. `-v` shows every stage with its seconds.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict, replace
from os import PathLike
from pathlib import Path
from types import ModuleType
from typing import Any

from codegen.compiler import shared_library
from codegen.emit import emit, on_request, sealed
from codegen.passes.folding.roll import check_roll
from codegen.program import Program
from codegen.seal import DERIVATION, VERIFICATION
from derive.diagnostics import ToolchainError
from derive.formulations.charts import BETWEEN
from derive.formulations.records import Equations
from derive.textbook import html
from hamel.build.assurance import check_all
from hamel.build.clock import LOG, Clock
from hamel.build.folder import check_place, publish, resolved
from hamel.build.keys import file_key
from hamel.build.module import Compiled, compiling, drafted
from hamel.build.options import BuildOptions, affordable
from hamel.build.reuse import remember
from hamel.build.stages import equations_of, program_for, with_emitted
from hamel.build.targets import UNCHECKED, checked_targets, subject_of
from hamel.build.tune import fastest, with_fastest_flags
from hamel.draw.mechanism import picture, svg
from hamel.records import Built
from hamel.verify import Verification, quick_verification
from hamel.verify.shipped import FOR_TARGETS, shipped
from hamel.verify.stored import stored


def build(
    path: str | PathLike[str], out: str | Path | None = None, options: BuildOptions | None = None
) -> Built:
    """Derive, emit, compile, compare with the independent derivation, and only then publish.

    `out` is the folder of the module, generated/<model> when None. Raises ModelError,
    AssumptionError, ToolchainError and VerificationError.
    """
    options = options or BuildOptions()
    on_request(options.targets)  # a name that is none is said before anything is derived
    check_roll(options.roll)
    clock = Clock()
    key = file_key(path, options.said())

    equations, program = _program(path, options, clock)
    place = Path(out) if out else Path("generated") / program.name
    check_place(resolved(place))

    with clock("code", "Program → texts"):
        texts = emit(program)
    with drafted(program.name, texts) as draft, compiling(draft, options.numpy) as finished:
        if not (draft.command or options.numpy):
            raise _without_compiler(finished())
        # the compiler works meanwhile, so that page and reference take hardly any time of their own
        with clock("textbook", "Equations → derivation"):
            derivation = _page(equations)
        with clock("verify", "binaries → verified, at random states"):
            checked = with_emitted(equations, program)
            emitted = {kernel.name for kernel in program.kernels}
            verification = _verification(
                checked, _waiting(finished, clock), options.states, emitted
            )
            seed, module = verification.seed, finished().module
            rows = shipped(checked, emitted, seed, module=module, real=program.real)
            states = stored(verification, equations, rows)
        compiled = finished()
        if compiled.message:
            warnings.warn(compiled.message, RuntimeWarning, stacklevel=2)
        targets = _targets(checked, program, compiled, rows, clock)

    with clock("publish", f"verified → {place}"):
        pages = {DERIVATION: derivation, VERIFICATION: states}
        files = {**compiled.files, **_bytes(sealed(texts, pages, targets))}
        publish(place, files)
    record = _record(program, place, compiled, files, clock)
    record = replace(record, targets=targets)
    waits = any(how.startswith(UNCHECKED) for how in targets.values())
    unloaded = draft.command and not compiled.compiled  # perhaps for a reason that passes
    # it was not edited meanwhile, and nothing of it waits for a tool
    if key == file_key(path, options.said()) and not waits and not unloaded:
        remember(key, record, files)
    return record


def _program(
    path: str | PathLike[str], options: BuildOptions, clock: Clock
) -> tuple[Equations, Program]:
    """File → Equations → Program; with `tune` of the choice and formulation fastest here."""
    times: dict[str, float] = {}
    if options.tune:
        equations, times = fastest(path, options, clock)
    else:
        equations = equations_of(
            path, options.choice, options.constants, options.formulation, clock, options.fix
        )
    with clock("passes", "Equations → Program"):
        program = program_for(equations, options)
    for name, how in program.rolling:
        LOG.info("%-12s %s", name, how)
    if options.tune:
        with clock("tune", "Program → Program with the fastest flags"):
            program = with_fastest_flags(program, times)
    return equations, program


def _page(equations: Equations) -> str:
    """The derivation, opened by a figure of the mechanism where there is one."""
    drawing = picture(equations.system)
    return html(equations, svg(drawing) if drawing else "")


def _targets(
    equations: Equations,
    program: Program,
    compiled: Compiled,
    rows: Mapping[str, Any],
    clock: Clock,
) -> dict[str, str]:
    """Target on request → how it was verified: at the states that are shipped, and where those of
    a large model leave functions out, at one state of all."""
    if not program.targets:
        return {}
    with clock("targets", "binaries → targets verified, by their tools"):
        emitted = [kernel.name for kernel in program.kernels]
        if not rows.keys() >= set(emitted):
            rows = shipped(equations, emitted, 0, 1, FOR_TARGETS, real=program.real) | dict(rows)
        return checked_targets(program, subject_of(program, compiled.module, rows))


def _waiting(finished: Callable[[], Compiled], clock: Clock) -> Callable[[], ModuleType]:
    """The compiled module, when it is needed; the time until it is there is the compiler's."""

    def module() -> ModuleType:
        with clock("compile", "texts → binaries, waited for"):
            return finished().module

    return module


def _without_compiler(compiled: Compiled) -> ToolchainError:
    hint = "or build with --numpy: the module then runs on NumPy until it is compiled"
    return ToolchainError(compiled.message.replace(", so the module runs on NumPy", ""), hint)


def _verification(
    equations: Equations, module: Callable[[], ModuleType], states: int, emitted: Collection[str]
) -> Verification:
    """Raises VerificationError unless equations and module agree with the independent
    derivation."""
    model, states = equations.system.model, affordable(equations, states)
    verification = quick_verification(model, equations, module, states, functions=emitted)
    check_all(equations, verification.checks, "nothing is written", verification.where)
    return verification


def _bytes(texts: Mapping[str, str]) -> dict[str, bytes]:
    return {name: text.encode() for name, text in texts.items()}


def _record(
    program: Program, place: Path, compiled: Compiled, files: Mapping[str, bytes], clock: Clock
) -> Built:
    return Built(
        model=program.name,
        choice=BETWEEN.join(chart.choice for chart in program.charts) or program.choice,
        reason=program.reason,
        folder=place,
        verified=True,
        operations={kernel.name: kernel.operations["total"] for kernel in program.kernels},
        seconds=clock.seconds,
        quasi_velocities=program.quasi_velocities,
        left_out=program.left_out,
        ledger=tuple(asdict(entry) for entry in program.ledger),
        rolling=dict(program.rolling),
        compiled=compiled.compiled,
        size=len(files.get(shared_library(program.name), b"")),
        tuned=dict(program.timings),
        real=program.real.name,
    )
