"""Optional libraries, and what to do where one is missing."""

from __future__ import annotations

import importlib
from typing import Any

from derive.diagnostics import ToolchainError


def library(name: str, what: str, extra: str = "sweep") -> Any:
    """A module of an optional library; `what` needs it, the extra brings it. Raises
    ToolchainError where it is missing."""
    try:
        return importlib.import_module(name)
    except ImportError:
        owner = name.partition(".")[0]
        raise ToolchainError(
            f"{what} needs {owner}, which is not installed", f"pip install 'hamel[{extra}]'"
        ) from None
