"""The Target record: a language or kind of file that programs are emitted in."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

from codegen.limits import MANY_RESULTS
from codegen.passes.folding.split import is_long
from codegen.program import Kernel, Program

# entries of the state up to which matrices of derivatives are made for a target
WIDEST = 200
MATRICES = ("jacobian", "derivatives", "dynamics_hessian")
COLUMNS = ("jacobian_t",)  # what is called like a matrix and has one entry for each state


def _fits(program: Program) -> str:
    return ""


@dataclass(frozen=True)
class Target:
    """`files` gives relative path → text; the same program gives the same bytes.

    The other fields are for targets on request. `needs` are functions that are emitted with it
    where the model has them. `refusal` says why a program cannot be emitted so, in words that end
    "the target NAME does not fit: …"; nothing where it can. `taker`: who takes a state that has one
    meaning all the way; what has not is refused before the passes. `readme` is the template of its
    section in README.md.
    """

    name: str
    about: str
    files: Callable[[Program], dict[str, str]]
    needs: tuple[str, ...] = ()
    refusal: Callable[[Program], str] = _fits
    readme: str = ""
    taker: str = ""
    straight: bool = False  # it takes straight-line code alone, no loops over links


def affordable(needs: Collection[str], states: int) -> tuple[str, ...]:
    """What a target needs of a model with so many states: of very many products alone, no
    matrices, which have a million entries for a thousand."""
    if states <= WIDEST:
        return tuple(needs)
    return tuple(name for name in needs if name in COLUMNS or not name.startswith(MATRICES))


def unsteady(program: Program, taker: str) -> str:
    """Why a program has no state of one meaning, which `taker` needs; nothing where it has."""
    if not program.simulates:
        return "it has no state derivative"
    charts = [chart.choice for chart in program.charts]
    return ambiguity(charts, program.choice, bool(program.frame), taker)


def ambiguity(charts: Collection[str], choice: str, based_anew: bool, taker: str) -> str:
    """The same of a state in a choice or, where there are several, in charts."""
    if len(charts) > 1:
        return (
            f"its state changes its meaning on the way, from one of the charts {', '.join(charts)} "
            f"to another; {taker} takes one choice: name it with --choice"
        )
    if based_anew:
        return (
            f"the quasi-velocities of the choice {choice} are based anew on the way; "
            f"{taker} takes another choice"
        )
    return ""


# What the C of a function is written with, PREFIX_… in every file that needs it.
HELPERS = ("turns", "far", "stray", "handed", "abreast", "zeros")


def is_apart(kernel: Kernel) -> bool:
    """Whether a function has a file of its own."""
    return kernel.rolled is not None or is_long(kernel) or kernel.size >= MANY_RESULTS


def plain_sources(program: Program) -> list[str]:
    """C files that hold the functions for one state, the longest functions in files of their
    own."""
    long = [f"{program.name}_{kernel.name}.c" for kernel in program.kernels if is_apart(kernel)]
    return [f"{program.name}.c", *long]
