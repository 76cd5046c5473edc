"""The CPython extension around the C source: FASTCALL functions for one state, a gufunc for
many."""

from __future__ import annotations

from typing import Any

from codegen import text
from codegen.passes.lanes import is_batched
from codegen.program import Program
from codegen.targets.records import Target


def files(program: Program) -> dict[str, str]:
    """NAME_module.c."""
    batched = [kernel.name for kernel in program.kernels if is_batched(kernel)]
    data: dict[str, Any] = {
        "batched": batched,
        "program": program,
        "prefix": program.name,
        "PREFIX": program.name.upper(),
    }
    return {f"{program.name}_module.c": text.render("module.c.j2", **data)}


EXTENSION = Target("extension", "CPython extension module", files)
