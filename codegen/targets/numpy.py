"""NumPy: the same statements over leading axes, for machines without a compiler."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from codegen import text
from codegen.integrators import ROSENBROCK
from codegen.passes.folding.split import Part, split
from codegen.passes.lanes import is_batched
from codegen.program import PREVIOUS, Kernel, Program
from codegen.targets.records import Target
from codegen.targets.repeated import Again, again, varying
from codegen.targets.rolled import Text, python_text
from codegen.targets.simulate import alike

# what steps may call beside `dynamics`
NEEDED = ("jacobian", "jacobian_t", "jacobian_u", "jacobian_forward")


@dataclass(frozen=True)
class Piece:
    """A part of a kernel as lines of Python."""

    lines: tuple[str, ...]
    outputs: tuple[str, ...]
    kept: tuple[str, ...]  # values into the workspace
    guards: tuple[tuple[str, str, str], ...]  # value, tolerance, name
    residual: str
    again: Again | None = None  # it is gone through for each of so many blocks


@dataclass(frozen=True)
class Body:
    """A kernel as one piece, or as several over a workspace."""

    kernel: Kernel
    pieces: tuple[Piece, ...]
    workspace: int
    rolled: Text | None = None  # loops in the place of pieces


def files(program: Program) -> dict[str, str]:
    """_numpy.py, _library.py (the C library through ctypes) and what they share."""
    data: dict[str, Any] = {
        "program": program,
        "prefix": program.name,
        "PREFIX": program.name.upper(),
    }
    language = text.numpy(program.real)
    bodies = [_body(kernel, language) for kernel in program.kernels]
    erf = any(
        " _erf(" in f" {line}" or "(_erf(" in line
        for b in bodies
        for c in b.pieces
        for line in (*c.lines, *c.outputs)
    )
    return {
        "_numpy.py": text.render(
            "numpy.py.j2",
            bodies=bodies,
            erf=erf,
            rosenbrock=_coefficients(),
            previous=PREVIOUS,
            models=_stepped(program),
            alike=alike(program),
            **data,
        ),
        "_library.py": text.render(
            "library.py.j2", batched=[k.name for k in program.kernels if is_batched(k)], **data
        ),
        "_shared.py": text.render("shared.py.j2", **data),
    }


def _coefficients() -> dict[str, object]:
    """Of the linearly implicit step, as text of Python numbers."""
    method = ROSENBROCK
    rows = {name: [_numbers(row) for row in getattr(method, name)] for name in ("a", "c")}
    lists = {name: _numbers(getattr(method, name)) for name in ("alpha", "gammas")}
    return {"gamma": repr(float(method.gamma)), **lists, **rows}


def _numbers(row: Sequence[Fraction]) -> str:
    return "[" + ", ".join(repr(float(value)) for value in row) + "]"


def _stepped(program: Program) -> list[dict[str, str]]:
    """By chart, the kernels that a step calls by their plain names."""
    known = {kernel.name for kernel in program.kernels}
    suffixes = [chart.suffix for chart in program.charts] or [""]
    named = [name for name in ("dynamics", *NEEDED) if name in known]
    return [
        {name: name + suffix if name + suffix in known else name for name in named}
        for suffix in suffixes
    ]


def _body(kernel: Kernel, language: text.Language) -> Body:
    if kernel.rolled:
        lines = _lines(Part(loads=kernel.loads, sections=kernel.sections), language)
        return Body(kernel, (), 0, python_text(kernel, kernel.rolled, language, tuple(lines)))
    parts = split(kernel)
    return Body(kernel, tuple(_piece(kernel, part, language) for part in parts.parts), parts.size)


def _piece(kernel: Kernel, part: Part, language: text.Language) -> Piece:
    places = varying(part)
    return Piece(
        lines=tuple(_lines(part, language)),
        outputs=tuple(
            f"{_target(kernel, i, places)} = {text.expression(value, language)}"
            for i, value in part.outputs
        )
        + tuple(
            f"out[..., {copy.first}:{copy.first + copy.count}] = "
            f"{copy.argument}[..., {copy.index}:{copy.index + copy.count}]"
            for copy in part.copies
        ),
        kept=tuple(f"work[{places.get(name, slot)}] = {name}" for name, slot in part.kept),
        guards=tuple(
            (
                text.expression(g.value, language),
                text.number(g.tolerance, language),
                text.printable(g.name),
            )
            for g in part.guards
        ),
        residual=text.expression(part.residual, language) if part.residual is not None else "",
        again=again(part, part.repeat, {}, language) if part.repeat else None,
    )


def _target(kernel: Kernel, i: int, places: Mapping[str | int, str]) -> str:
    """Where an output goes; what solving takes stands first in the workspace."""
    own = kernel.size
    return f"out[..., {places.get(i, i)}]" if i < own else f"work[{i - own}]"


def _lines(part: Part, language: text.Language) -> Iterator[str]:
    places = varying(part)
    for load in part.loads:
        if load.argument != "t":
            yield f"{load.name} = {load.argument}[..., {places.get(load.name, load.index)}]"
    for name, slot in part.taken:
        yield f"{name} = work[{places.get(name, slot)}]"
    for name in part.repeat.constants if part.repeat else ():
        yield f"{name} = numbers_[{places[name]}]"
    for section in part.sections:
        yield ""
        yield f"# {text.printable(section.title)}"
        for statement in section.statements:
            yield f"{statement.name} = {text.expression(statement.value, language)}"


NUMPY = Target("numpy", "NumPy module and the ctypes binding", files)
