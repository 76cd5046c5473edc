"""The CPython extension around the C source: FASTCALL functions for one state, a gufunc for
many."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from codegen import text
from codegen.passes.lanes import is_batched
from codegen.program import Program
from codegen.reals import recast
from codegen.targets.records import Target

# The extension as far as it does not depend on a model; the last one is for modules that simulate.
FOLDER = Path(__file__).parents[1] / "runtime"
RUNTIME = tuple(sorted(FOLDER.glob("runtime_module*.h")))
SIMULATION = "runtime_module_simulate.h"


def files(program: Program) -> dict[str, str]:
    """NAME_module.c and the runtime that it includes."""
    batched = [kernel.name for kernel in program.kernels if is_batched(kernel)]
    data: dict[str, Any] = {
        "batched": batched,
        "widths": _widths(program),
        "program": program,
        "prefix": program.name,
        "PREFIX": program.name.upper(),
    }
    runtime = [path for path in RUNTIME if program.simulates or path.name != SIMULATION]
    return {
        f"{program.name}_module.c": text.render("module.c.j2", **data),
        **{path.name: recast(path.read_text("utf-8"), program.real) for path in runtime},
    }


def _widths(program: Program) -> list[int]:
    """Of the rows of a motion: x and work, then what there is of v, chart, reduced and frame."""
    nx = len(program.argument("x").names)
    widths = [nx, 1]
    if program.charts:
        widths += [program.kernel("velocity").size, 1]
    if program.turning:
        widths.append(nx)
    if program.frame:
        widths.append(program.frame)
    return widths


EXTENSION = Target("extension", "CPython extension module", files)
