"""The motions that the constraints allow: whether they are independent, and frames of directions
for quasi-velocities, in C and Python."""

from __future__ import annotations

from typing import Any

from codegen import text
from codegen.program import Kernel, Program
from codegen.targets.records import Target
from derive.choices.limits import SINGULAR
from derive.choices.orthonormal import LENGTH

WORN = 0.5  # of 1, where it is based: a frame is based anew before its projection degenerates


def files(program: Program) -> dict[str, str]:
    """NAME_nullspace.h, NAME_nullspace.c and _nullspace.py."""
    if not program.has("constraint_rows"):
        return {}
    kernel = program.kernel("constraint_rows")
    if kernel.pattern is None:
        return {}
    pattern = kernel.pattern
    data: dict[str, Any] = {
        "program": program,
        "prefix": program.name,
        "PREFIX": program.name.upper(),
        "rows": pattern.shape[0],
        "columns": pattern.shape[1],
        "entries": list(zip(pattern.rows, pattern.columns)),
        "nq": program.coordinates,
        "worn": WORN,
        "guards": _guards(program) if program.frame else {},
    }
    return {
        f"{program.name}_nullspace.h": text.render("nullspace.h.j2", **data),
        f"{program.name}_nullspace.c": text.render("nullspace.c.j2", **data),
        "_nullspace.py": text.render("nullspace.py.j2", **data),
    }


def has_lengths(program: Program) -> bool:
    """Whether a guard is the length of a direction: it vanishes on the way without a change of
    sign."""
    return any(
        label.startswith(LENGTH)
        for kernel in program.kernels
        if kernel.name.startswith("guards")
        for label in kernel.labels
    )


def framed(program: Program) -> int:
    """The number of the chart whose quasi-velocities are measured along the frame."""
    suffixes = [chart.suffix for chart in program.charts] or [""]
    return suffixes.index(_watching(program).name.removeprefix("guards"))


def _watching(program: Program) -> Kernel:
    return next(
        kernel
        for kernel in program.kernels
        if kernel.name.startswith("guards") and any(x.startswith(LENGTH) for x in kernel.labels)
    )


def _guards(program: Program) -> dict[str, object]:
    """Which entries of which function are the lengths of the frame, in units of its tolerance."""
    kernel = _watching(program)
    places = [i for i, label in enumerate(kernel.labels) if label.startswith(LENGTH)]
    return {
        "function": kernel.name,
        "count": len(kernel.labels),
        "first": places[0],
        "last": places[-1] + 1,
        "unit": SINGULAR,
    }


NULLSPACE = Target("nullspace", "independence of the constraints, and frames", files)
