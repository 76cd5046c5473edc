"""The road from a model file to a verified module on one page; every stage is timed, and imported
when it is reached.

model.yaml → derive.model → derive.mechanics → derive.formulations → codegen.passes → codegen.build
→ hamel.verify
"""

from __future__ import annotations

import sys
import tempfile
import time
import warnings
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import TYPE_CHECKING, Literal

from hamel.meanwhile import meanwhile

if TYPE_CHECKING:
    from codegen.build import Built as MadeFolder
    from codegen.build import Draft
    from codegen.program import Program
    from derive.formulations.records import Equations
    from derive.mechanics.records import System
    from derive.model.records import Model

MARK = "manifest.json"  # a folder with this file is one that hamel made
Constants = Collection[str] | Literal["all"]
Fixed = Mapping[str, float | str]  # inputs and parameters that become numbers


@dataclass
class Clock:
    """Seconds per stage, in the order the stages ran."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - start


def equations_of(
    path: str | PathLike[str],
    choice: str | None = None,
    constants: Constants = (),
    formulation: str = "quasi_velocities",
    clock: Clock | None = None,
    fix: Fixed = MappingProxyType({}),
) -> Equations:
    """Model file → Equations of one formulation and choice; the first choice of the file when none
    is named."""
    clock = clock or Clock()
    with clock("model"):
        model, constants = _read(path, constants, fix)
    with clock("mechanics"):
        mechanics = mechanics_of(model, constants)
    with clock("formulation"):
        from derive.formulations import equations
        from derive.linearize.minimal import with_linearization

        return with_linearization(
            equations(mechanics, choice, formulation, charts=True, moving=True)
        )


def _read(path: str | PathLike[str], constants: Constants, fix: Fixed) -> tuple[Model, Constants]:
    """The model, read in a copy of this process while this one imports what comes next, where it is
    not imported yet."""

    def read() -> tuple[Model, Constants]:
        from derive.robots import load
        from hamel.fixing import fixed

        return fixed(load(path), constants, fix)

    if "casadi" in sys.modules or Path(path).suffix not in (
        ".yaml",
        ".yml",
    ):  # robots warn of what is left out, here
        return read()
    with meanwhile(read, niceness=0) as received:
        import derive.formulations
        import derive.linearize.minimal  # noqa: F401

        return received()


def mechanics_of(model: Model, constants: Constants = ()) -> System:
    """Model → System; ModelError where a constant is no parameter."""
    from derive.states import system

    known = [parameter.name for parameter in model.parameters]
    unknown = [name for name in (() if constants == "all" else constants) if name not in known]
    if unknown:
        from derive.diagnostics import ModelError, did_you_mean, listed

        near = did_you_mean(unknown[0], known) or f"it has {listed(known)}"
        raise ModelError(
            f"'{unknown[0]}' is to be a constant, but {model.name} has no such parameter; {near}"
        )
    return system(model, constants)


def usable_choices(
    mechanics: System, formulation: str = "quasi_velocities"
) -> tuple[dict[str, Equations], dict[str, str]]:
    """Equations of every choice of the file, and why the others are refused. The first has to be a
    choice: it is the default.

    A formulation in the generalized velocities makes no choice: its equations stand alone, under
    its own name.
    """
    from derive.diagnostics import AssumptionError
    from derive.formulations import equations

    usable, refused = {}, {}
    for number, choice in enumerate(mechanics.model.choices):
        try:
            found = equations(mechanics, choice.name, formulation, moving=True)
        except AssumptionError as error:
            if number == 0:
                raise
            refused[choice.name] = str(error)
            continue
        usable[found.choice] = found
        if found.generalized_velocities:
            break
    return usable, refused


def program_of(
    equations: Equations,
    functions: Collection[str] | None = None,
    clock: Clock | None = None,
    integrators: Collection[str] = (),
    enforcements: Collection[str] | None = None,
    real: str = "float64",
) -> Program:
    """Equations → Program: the straight-line statements of each function, counted. `integrators`:
    the default one when empty."""
    with (clock or Clock())("passes"):
        from codegen.integrators import INTEGRATORS
        from codegen.passes import in_precision, program

        chosen = tuple(integrators) or (INTEGRATORS[0].name,)
        made = program(
            equations,
            None if functions is None else tuple(functions),
            chosen,
            None if enforcements is None else tuple(enforcements),
        )
        return in_precision(made, real)


def emit(
    program: Program, folder: Path, extra: dict[str, str], clock: Clock | None = None
) -> MadeFolder:
    """Program → folder: text of all targets, compiled."""
    with (clock or Clock())("code"):
        from codegen.build import build

        return build(program, folder, extra=extra)


@contextmanager
def drafted(program: Program, folder: Path, clock: Clock) -> Iterator[Draft]:
    """The text of all targets beside `folder`, not compiled yet; gone at the end of the block
    unless published."""
    with ExitStack() as stack:
        with clock("code"):
            from codegen.build import draft

            made = stack.enter_context(draft(program, folder))
        yield made


def load_module(folder: Path) -> ModuleType:
    """The generated module in `folder`."""
    from codegen.loader import load

    return load(folder)


def load_quietly(made: MadeFolder) -> ModuleType:
    """The module that was just made; says what to install, instead of what to run in a folder that
    will be gone."""
    if made.message:
        warnings.warn(made.message, RuntimeWarning, stacklevel=3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return load_module(made.folder)


@contextmanager
def temporary_module(
    equations: Equations,
    integrators: Collection[str] = (),
    enforcements: Collection[str] | None = None,
    functions: Collection[str] | None = None,
    real: str = "float64",
) -> Iterator[ModuleType]:
    """A module that is needed for the length of a command; codegen's cache keeps what was
    compiled."""
    with tempfile.TemporaryDirectory(prefix="hamel-", ignore_cleanup_errors=True) as folder:
        place = Path(folder) / equations.system.model.name
        yield load_quietly(
            emit(
                program_of(
                    equations,
                    functions,
                    integrators=integrators,
                    enforcements=enforcements,
                    real=real,
                ),
                place,
                {},
            )
        )
