"""numba: the functions of the compiled library for loops under @njit."""

from __future__ import annotations

from typing import Any

from codegen import text
from codegen.program import Program
from codegen.targets.records import Target


def files(program: Program) -> dict[str, str]:
    """NAME_numba.py."""
    data: dict[str, Any] = {"prefix": program.name, "PREFIX": program.name.upper()}
    return {f"{program.name}_numba.py": text.render("numba.py.j2", program, **data)}


NUMBA = Target(
    "numba",
    "functions of the compiled library for loops under @njit",
    files,
    readme="numba.md.j2",
)
