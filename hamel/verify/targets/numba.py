"""The numba target, by numba: values against the module, and a loop that allocates nothing."""

from __future__ import annotations

import importlib
import math
from types import ModuleType
from typing import Any

import numpy as np

from hamel.verify.records import CheckResult
from hamel.verify.targets.records import Subject, TargetCheck, generated, result, tool

STEPS = 1000


def check(subject: Subject) -> tuple[CheckResult, ...]:
    """Every function, called as compiled code calls it. ToolchainError without numba."""
    numba = tool("numba")
    functions = generated(subject, "numba")
    errors = [
        subject.error(name, _call(subject, functions, name))
        for name in functions.FUNCTIONS
        if name in subject.rows
    ]
    return (
        result(subject, "values", errors, "every function against the module"),
        _allocations(subject, functions, numba),
    )


def _call(subject: Subject, functions: ModuleType, name: str) -> Any:
    """With a result of its own, not-a-number where the status says so."""
    call, (_, shape) = getattr(functions, name), functions.FUNCTIONS[name]
    real = functions.defaults.dtype

    def value(t: float, *given: np.ndarray) -> np.ndarray:
        out = np.empty(math.prod(shape), real)
        status = call(t, *(np.ascontiguousarray(part, real) for part in given), out)
        return np.where(status == 0, out, math.nan)

    return value


def _allocations(subject: Subject, functions: ModuleType, numba: ModuleType) -> CheckResult:
    """What more calls in a compiled loop add to those of its own arguments, as numba's runtime
    counts them."""
    name = next(name for name in functions.FUNCTIONS if name in subject.rows)
    call, (_, shape) = getattr(functions, name), functions.FUNCTIONS[name]

    @numba.njit
    def loop(steps: int, t: float, x: Any, u: Any, p: Any, out: Any) -> int:
        failed = 0
        for _ in range(steps):
            failed += call(t, x, u, p, out)
        return failed

    t, *arrays = subject.row(name, 0)
    real = functions.defaults.dtype
    given = [np.ascontiguousarray(part, real) for part in arrays]
    out = np.empty(math.prod(shape), real)
    once, many = (_counted(loop, steps, t, *given, out) for steps in (1, STEPS))
    about = f"allocations in {STEPS} calls of {name} in a compiled loop"
    return CheckResult("no allocation", float(many - once), 0.0, many == once, about)


def _counted(loop: Any, *given: Any) -> int:
    """Allocations of a call, compiled before."""
    runtime = importlib.import_module("numba.core.runtime")
    importlib.import_module("numba.core.runtime._nrt_python").memsys_enable_stats()
    loop(*given)
    before = runtime.rtsys.get_allocation_stats().alloc
    loop(*given)
    return runtime.rtsys.get_allocation_stats().alloc - before


NUMBA = TargetCheck("numba", "numba", check)
