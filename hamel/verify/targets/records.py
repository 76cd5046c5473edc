"""What is checked of a target, and the record of a check."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from hamel.verify.records import CheckResult


@dataclass(frozen=True)
class Subject:
    """A module in its folder, with the files of the target beside it.

    `rows` has per function the arguments "t", "x", "u" and "p" at random admissible states.
    """

    name: str
    folder: Path
    module: ModuleType
    rows: Mapping[str, Any]


@dataclass(frozen=True)
class TargetCheck:
    """`run` compares the files of the target with the module; ToolchainError where `tool` is
    missing, with the command that installs it."""

    target: str
    tool: str
    run: Callable[[Subject], Sequence[CheckResult]]
