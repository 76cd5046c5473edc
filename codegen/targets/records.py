"""The Target record: a language or kind of file that programs are emitted in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from codegen.program import Program


@dataclass(frozen=True)
class Target:
    """`files` gives relative path → text; the same program gives the same bytes."""

    name: str
    about: str
    files: Callable[[Program], dict[str, str]]
