"""The checks of the targets that a build was asked for."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from codegen.program import Program
from derive.diagnostics import ToolchainError, VerificationError
from hamel.verify.targets import TARGET_CHECKS, Subject, TargetCheck

UNCHECKED = "not checked"  # so begins what is said of a target whose tool is missing


def subject_of(program: Program, module: ModuleType, rows: Mapping[str, Any]) -> Subject:
    """A module that was loaded, with arguments of its functions: `rows`, or where a model is so
    large that there are none, the model's initial state."""
    folder = Path(str(module.__file__)).parent
    at_start = {} if rows else dict(_at_start(program, module))
    return Subject(program.name, folder, module, {**rows, **at_start})


def _at_start(program: Program, module: ModuleType) -> Iterator[tuple[str, dict[str, Any]]]:
    """Arguments of functions at the initial state, numbers behind it where more are taken."""
    u = np.zeros(len(program.argument("u").names))
    p = np.array(program.argument("p").defaults, dtype=float)
    states = program.nominal or [0.1] * len(program.argument("x").names)
    for kernel in program.kernels:
        width = len(kernel.x.names)
        x = np.array([*states, *[0.1] * width][:width])
        value = getattr(module, kernel.name)(0.0, x, u, p)
        size = float(np.max(np.abs(value), initial=0.0))
        yield kernel.name, {"t": [0.0], "x": [x], "u": [u], "p": [p], "size": [size]}


def target_checks(names: Collection[str]) -> tuple[TargetCheck, ...]:
    """The checks of these targets, in the order of the table."""
    return tuple(check for check in TARGET_CHECKS if check.target in names)


def checked_targets(program: Program, subject: Subject) -> dict[str, str]:
    """Target → how it was verified, in words; a missing tool is said there, and warned of.

    Raises VerificationError where a target disagrees with the module.
    """
    return {check.target: _checked(check, subject) for check in target_checks(program.targets)}


def _checked(check: TargetCheck, subject: Subject) -> str:
    try:
        results = tuple(check.run(subject))
    except ToolchainError as error:
        warnings.warn(
            f"target {check.target} was not checked: {error}", RuntimeWarning, stacklevel=4
        )
        return f"{UNCHECKED}: {error.diagnostics[0].message}"
    failed = [result.failure for result in results if not result.passed]
    if failed:
        raise VerificationError(
            f"{subject.name}: the target {check.target} disagrees with the module, nothing is "
            f"written: {'; '.join(failed)}"
        )
    return f"by {check.tool}: {', '.join(result.name for result in results)}"
