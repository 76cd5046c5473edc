"""What is checked of a target, and the record of a check."""

from __future__ import annotations

import importlib
import importlib.util
import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from derive.diagnostics import ToolchainError
from hamel.verify.records import CheckResult
from hamel.verify.shipped import tolerance_of

NOTHING = 1e-300  # the size of a result that is zero
Row = tuple[float, np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Subject:
    """A module in its folder, with the files of the target beside it.

    `rows` has per function the arguments "t", "x", "u" and "p" at random admissible states, and the
    "size" of the result there, in terms of which errors are told.
    """

    name: str
    folder: Path
    module: ModuleType
    rows: Mapping[str, Any]

    @property
    def tolerance(self) -> float:
        """What another order of operations may do to the last digits: that of the values that are
        shipped beside a module."""
        return tolerance_of(self.module.defaults.dtype == np.float64)

    def row(self, name: str, k: int) -> Row:
        """The arguments of state k, with the module's usual frame behind the parameters where it
        has one."""
        t, x, u, p = (self.rows[name][argument][k] for argument in "txup")
        usual = self.module._shared.DEFAULTS
        return t, np.array(x), np.array(u), np.append(p, usual[len(p) :])

    def sizes(self, name: str) -> list[float]:
        """By state in terms of what errors are told; none where there is no such function."""
        return [max(size, NOTHING) for size in self.rows.get(name, {}).get("size", ())]

    def error(self, name: str, call: Callable[..., Any]) -> float:
        """The worst difference between a function of the module and `call` at any state, relative
        to the size of the result there."""
        worst = 0.0
        for k, size in enumerate(self.sizes(name)):
            given = self.row(name, k)
            expected = np.asarray(getattr(self.module, name)(*given))
            value = np.asarray(call(*given), dtype=float).reshape(expected.shape)
            difference = float(np.max(np.abs(value - expected), initial=0.0))
            worst = max(worst, math.inf if math.isnan(difference) else difference / size)
        return worst


@dataclass(frozen=True)
class TargetCheck:
    """`run` compares the files of the target with the module; ToolchainError where `tool` is
    missing, with the command that installs it."""

    target: str
    tool: str
    run: Callable[[Subject], Iterable[CheckResult]]


def result(subject: Subject, name: str, errors: Sequence[float], about: str) -> CheckResult:
    """The worst of relative errors, held to the tolerance of the module's precision."""
    value = max((math.inf if math.isnan(error) else error for error in errors), default=math.inf)
    return CheckResult(name, value, subject.tolerance, value <= subject.tolerance, about)


def generated(subject: Subject, target: str) -> ModuleType:
    """NAME_TARGET.py, imported by its path. Raises ToolchainError where what it needs is not
    there."""
    file = subject.folder / f"{subject.name}_{target}.py"
    spec = importlib.util.spec_from_file_location(file.stem, file)
    assert spec is not None and spec.loader is not None  # of a path that ends in .py
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (ImportError, OSError) as error:
        said = str(error).replace(f"{subject.folder}{os.sep}", "")  # the manifest holds no path
        raise ToolchainError(f"{file.name} cannot be imported: {said}") from error
    return module


def tool(name: str) -> ModuleType:
    """An optional package. Raises ToolchainError where it is missing."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        hint = f"pip install 'hamel[{name}]'"
        raise ToolchainError(f"{name} is not installed", hint) from error
