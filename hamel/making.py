"""making: a verified module from a model file; the folder appears only when all of it went well."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, replace
from os import PathLike
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from codegen import cache
from derive.diagnostics import ToolchainError, VerificationError
from hamel.built import Built
from hamel.meanwhile import meanwhile
from hamel.pipeline import Clock, Constants, Fixed, drafted, equations_of, load_quietly, program_of

FEWEST = 2  # states a build looks at
MANY = 2000  # bodies, over all states

if TYPE_CHECKING:
    from codegen.build import Draft
    from codegen.program import Program
    from derive.formulations.records import Equations
    from hamel.verify import Verification


@contextmanager
def _preparing() -> Iterator[None]:
    """The first build of all: the templates are prepared in a process of their own until they are
    needed."""
    with ExitStack() as stack:
        if cache.bare("templates"):
            stack.enter_context(meanwhile(_prepare, niceness=4))
        yield


def _prepare() -> None:
    from codegen.text import prepare

    prepare()


@_preparing()
def made(
    path: str | PathLike[str],
    out: str | Path | None,
    choice: str | None,
    constants: Constants,
    functions: Collection[str] | None,
    formulation: str,
    integrators: Collection[str],
    states: int,
    numpy: bool,
    tune: bool,
    header: bool,
    fix: Fixed,
    real: str,
) -> Built:
    """Derive, emit, compile, compare with the independent derivation, and only then publish."""
    clock = Clock()
    times: dict[str, float] = {}
    if tune:
        from hamel.tuning import fastest

        equations, times = fastest(path, choice, constants, fix, real, clock)
    else:
        equations = equations_of(path, choice, constants, formulation, clock, fix)
    with clock("code"):
        import codegen.build  # noqa: F401  (it brings Jinja along, which the page needs, too)
    with meanwhile(lambda: _page(equations)) as page:
        program = replace(
            program_of(equations, functions, clock, integrators, real=real), inline=header
        )
        if tune:
            from hamel.tuning import tuned

            program = tuned(program, times, clock)
        folder = Path(out) if out else Path("generated") / program.name
        with drafted(program, folder, clock) as draft:
            found = _confirmed(_with_requested(equations, program), draft, states, numpy, clock)
            from codegen.build import VERIFICATION
            from hamel.verify.stored import stored

            with clock("textbook"):
                pages = {"derivation.html": page(), VERIFICATION: stored(found, equations)}
            _publish(draft, pages, clock)
            compiled = bool(draft.command)
    return _record(program, folder, compiled, clock)


def _page(equations: Equations) -> str:
    from derive.textbook import html

    return html(equations)


def _with_requested(equations: Equations, program: Program) -> Equations:
    """What was emitted on request is verified like the rest, in every chart."""
    emitted = {kernel.name for kernel in program.kernels}
    charts = tuple(
        _with_emitted(chart, emitted, f"_chart{number}")
        for number, chart in enumerate(equations.charts, 1)
    )
    return replace(_with_emitted(equations, emitted, ""), charts=charts)


def _with_emitted(equations: Equations, emitted: Collection[str], suffix: str) -> Equations:
    requested = tuple(
        request.make() for request in equations.requests if f"{request.name}{suffix}" in emitted
    )
    return replace(equations, functions=(*equations.functions, *requested))


def _confirmed(
    equations: Equations, draft: Draft, states: int, numpy: bool, clock: Clock
) -> Verification:
    """Compile out of sight, and raise unless the module agrees with the independent derivation."""
    with ThreadPoolExecutor(1) as compiling:  # the derivation is checked while the compiler works
        module = compiling.submit(_compiled, draft, numpy, clock)
        with clock("verify"):
            from hamel.verify import quick_verification  # imported while the compiler works, too

            found = quick_verification(
                equations.system.model, equations, module.result, _affordable(equations, states)
            )
    failed = [check for check in found.checks if not check.passed]
    if failed:
        from derive.formulations.charts import together

        lines = "; ".join(
            f"{check.name}: {check.value:.2g} exceeds {check.tolerance:.2g}" for check in failed
        )
        where = f"; {found.hardest}" if found.hardest else ""
        raise VerificationError(
            f"{draft.name}, choice {together(equations)}: "
            f"verification failed, nothing is written: {lines}{where}"
        )
    return found


def _affordable(equations: Equations, states: int) -> int:
    """Fewer states where there are many bodies: the reference is not made for speed."""
    return max(FEWEST, min(states, MANY // max(1, len(equations.system.model.bodies))))


def _compiled(draft: Draft, numpy: bool, clock: Clock) -> ModuleType:
    from codegen.build import compiled
    from codegen.compiler import INSTALL

    with clock("compile"):
        found = compiled(draft)
    if not (found.compiled or numpy):
        hint = "or build with --numpy: the module then runs on NumPy until it is compiled"
        raise ToolchainError(f"no C compiler found: {INSTALL}", hint)
    return load_quietly(found)


def _publish(draft: Draft, pages: dict[str, str], clock: Clock) -> None:
    from codegen.build import publish

    with clock("code"):
        publish(draft, pages)


def _record(program: Program, folder: Path, compiled: bool, clock: Clock) -> Built:
    from derive.formulations.charts import BETWEEN

    return Built(
        model=program.name,
        choice=BETWEEN.join(chart.choice for chart in program.charts) or program.choice,
        reason=program.reason,
        folder=folder,
        verified=True,
        operations={kernel.name: kernel.operations["total"] for kernel in program.kernels},
        seconds=clock.seconds,
        quasi_velocities=program.quasi_velocities,
        left_out=program.left_out,
        ledger=tuple(asdict(entry) for entry in program.ledger),
        compiled=compiled,
        size=_size(folder, program.name),
        tuned=dict(program.timings),
        real=program.real.name,
    )


def _size(folder: Path, name: str) -> int:
    """Bytes of the library for C."""
    return sum(path.stat().st_size for path in folder.glob(f"lib{name}.*"))
