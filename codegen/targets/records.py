"""The Target record: a language or kind of file that programs are emitted in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from codegen.program import Program


def _fits(program: Program) -> str:
    return ""


@dataclass(frozen=True)
class Target:
    """`files` gives relative path → text; the same program gives the same bytes.

    The other fields are for targets on request. `needs` are functions that are emitted with it
    where the model has them. `refusal` says why a program cannot be emitted so, in words that end
    "the target NAME does not fit: …"; nothing where it can. `readme` is the template of its section
    in README.md.
    """

    name: str
    about: str
    files: Callable[[Program], dict[str, str]]
    needs: tuple[str, ...] = ()
    refusal: Callable[[Program], str] = _fits
    readme: str = ""
