"""CasADi: every function as expressions of its symbols, in Python that imports nothing but casadi,
and as external functions in C that `casadi.external` loads."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from codegen import text
from codegen.program import Expression, Kernel, Program, Stepper
from codegen.targets.records import Target

SAME = (
    "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh",
    "atanh", "exp", "log", "expm1", "log1p", "erf", "fabs", "floor", "ceil", "sign",
)  # fmt: skip
OF_TWO = {"pow": "power", "and": "logic_and", "or": "logic_or"} | {
    name: name for name in ("atan2", "hypot", "fmin", "fmax", "copysign", "fmod")
}
COMPARED = {"lt": "<", "le": "<=", "eq": "==", "ne": "!="}
# casadi is imported under a name that no model can give to a quantity
SYMBOLS = text.Language(
    {
        **{name: f"_ca.{name}({{0}})" for name in SAME},
        **{name: f"_ca.{theirs}({{0}}, {{1}})" for name, theirs in OF_TWO.items()},
        **{name: f"({{0}} {sign} {{1}})" for name, sign in COMPARED.items()},
        "not": "_ca.logic_not({0})",
        "where": "_ca.if_else({0}, {1}, 0.0)",
    },
    'float("inf")',
    'float("nan")',
)
# by which argument of the state derivative, and the function that has that Jacobian; those by x and
# u stand behind ẋ in one matrix, with what they have in common computed once
JACOBIANS = {"t": "jacobian_t", "x": "derivatives", "u": "derivatives", "p": "jacobian_p"}


@dataclass(frozen=True)
class Body:
    """A kernel as lines of Python; guards are (value, tolerance, name)."""

    kernel: Kernel
    result: str
    lines: tuple[str, ...]
    outputs: tuple[str, ...]
    guards: tuple[tuple[str, str, str], ...]
    residual: str
    computed: tuple[int, ...]  # entries that guards concern: no arguments, no numbers


@dataclass(frozen=True)
class Block:
    """A Jacobian by one argument, the one of that `number`: `pattern` is its sparsity as CasADi
    writes it, by columns; `places` are the entries in our row-major result. Without a kernel it is
    zero."""

    number: int
    kernel: Kernel | None
    pattern: tuple[int, ...]
    places: tuple[int, ...]


@dataclass(frozen=True)
class External:
    """A function in CasADi's C interface, with the blocks of its Jacobian where there are all."""

    kernel: Kernel
    result: str
    sizes: tuple[int, ...]  # of t, x, u, p
    blocks: tuple[Block, ...]

    @property
    def calls(self) -> dict[str, list[Block]]:
        """Function that is called → the blocks that it has entries of."""
        called: dict[str, list[Block]] = {}
        for block in self.blocks:
            if block.kernel and block.places:
                called.setdefault(block.kernel.name, []).append(block)
        return called

    @property
    def longest(self) -> int:
        """Numbers of the longest result, which is computed before it is put in place."""
        results = [block.kernel for block in self.blocks if block.kernel]
        return max(kernel.size for kernel in (self.kernel, *results))


def files(program: Program) -> dict[str, str]:
    """NAME_casadi.py and NAME_external.c."""
    data: dict[str, Any] = {"prefix": program.name, "PREFIX": program.name.upper()}
    # what is solved for in a loop is there as compiled code alone
    bodies = [_body(kernel) for kernel in program.kernels if not kernel.solving]
    looped = [_stepper(program, stepper.kernel) for stepper in plain_steppers(program)]
    externals = [*(_external(program, kernel) for kernel in program.kernels), *looped]
    data |= {"externals": externals, "steps": _steps(program)}
    data["nx"] = len(program.argument("x").names)
    widest = max((size for external in externals for size in external.sizes), default=1)
    return {
        f"{program.name}_casadi.py": text.render("casadi.py.j2", program, bodies=bodies, **data),
        f"{program.name}_external.c": text.render("external.c.j2", program, widest=widest, **data),
    }


def plain_steppers(program: Program) -> tuple[Stepper, ...]:
    """Steps of the module that give a state; their derivatives are left to CasADi."""
    return tuple(stepper for stepper in program.steppers if not stepper.sensitive)


def _steps(program: Program) -> list[dict[str, str]]:
    """A step for each state derivative: its suffix, and what it calls."""
    suffixes = [chart.suffix for chart in program.charts] or [""]
    charts = [(suffix, program.in_chart("dynamics", suffix)) for suffix in suffixes]
    return [{"suffix": s, "dynamics": k.name} for s, k in charts if k and program.simulates]


def _stepper(program: Program, kernel: Kernel) -> External:
    widths = {argument.name: len(argument.names) for argument in program.arguments}
    sizes = {**widths, "t": 1, "x": len(kernel.x.names)}
    return External(kernel, "x_out", tuple(sizes[name] for name in "txup"), ())


def refusal(program: Program) -> str:
    """CasADi knows one kind of number."""
    if program.real.words:
        return f"CasADi computes in float64, not in {program.real.name}; build without --real"
    loops = [kernel.name for kernel in program.kernels if kernel.rolled]
    if loops:
        return f"{loops[0]} is a loop over links, no expression; build with --roll never"
    odd = [kernel.name for kernel in program.kernels if "__" in kernel.name]
    return f"CasADi takes no name with two underscores in a row: {odd[0]}" if odd else ""


def result_name(kernel: Kernel) -> str:
    """CasADi tells arguments and results by their names."""
    return f"{kernel.result}_out" if kernel.result in JACOBIANS else kernel.result


def _body(kernel: Kernel) -> Body:
    return Body(
        kernel,
        result_name(kernel),
        tuple(_lines(kernel)),
        tuple(_value(value) for value in kernel.outputs),
        tuple(
            (_value(guard.value), text.number(guard.tolerance, SYMBOLS), text.printable(guard.name))
            for guard in kernel.guards
        ),
        _value(kernel.loop.residual) if kernel.loop else "",
        kernel.results if kernel.guards else (),
    )


def _value(value: Expression) -> str:
    return text.expression(value, SYMBOLS)


def _lines(kernel: Kernel) -> Iterator[str]:
    for load in kernel.loads:
        if load.argument != "t":
            yield f"{load.name} = {load.argument}[{load.index}]"
    for section in kernel.sections:
        yield ""
        yield f"# {text.printable(section.title)}"
        for statement in section.statements:
            yield f"{statement.name} = {_value(statement.value)}"


# ---- the C interface


def _external(program: Program, kernel: Kernel) -> External:
    widths = {argument.name: len(argument.names) for argument in program.arguments}
    sizes = {**widths, "t": 1, "x": len(kernel.x.names)}
    shape = tuple(sizes[name] for name in "txup")
    return External(kernel, result_name(kernel), shape, _blocks(program, kernel, sizes))


def _blocks(program: Program, kernel: Kernel, sizes: dict[str, int]) -> tuple[Block, ...]:
    """By t, x, u and p; none where a function that is needed for one of them was not emitted."""
    name, mark, chart = kernel.name.partition("_chart")
    if name != "dynamics":
        return ()
    blocks: list[Block] = []
    for number, (argument, jacobian) in enumerate(JACOBIANS.items()):
        own = program.in_chart(jacobian, mark + chart)
        if argument in kernel.uses and own is None:
            return ()
        used = own if argument in kernel.uses else None
        first = _first(argument, sizes)
        blocks.append(_block(number, used, first, (kernel.size, sizes[argument])))
    return tuple(blocks)


def _first(argument: str, sizes: dict[str, int]) -> int:
    """The column of the function's result that the Jacobian begins in."""
    return {"x": 1, "u": 1 + sizes["x"]}.get(argument, 0)


def _block(number: int, kernel: Kernel | None, first: int, shape: tuple[int, int]) -> Block:
    rows, columns = shape
    entries = [
        [r for r in range(rows) if kernel and _is_entry(kernel, r, first + c)]
        for c in range(columns)
    ]
    starts = [sum(map(len, entries[:c])) for c in range(columns + 1)]
    inner = [r for column in entries for r in column]
    width = _width(kernel) if kernel else 0
    places = [r * width + first + c for c, column in enumerate(entries) for r in column]
    return Block(number, kernel, (rows, columns, *starts, *inner), tuple(places))


def _width(kernel: Kernel) -> int:
    return kernel.shape[1] if len(kernel.shape) > 1 else 1


def _is_entry(kernel: Kernel, row: int, column: int) -> bool:
    """What is the number zero is zero by structure, but where something is solved for."""
    place, solving = row * _width(kernel) + column, kernel.solving
    if kernel.outputs[place] != 0.0:
        return True
    if solving is None:
        return False
    inside = row >= solving.first and any(a <= column < b for a, b in solving.ranges)
    return inside or place in solving.places


CASADI = Target(
    "casadi",
    "functions of CasADi symbols, and external functions in C",
    files,
    needs=tuple(dict.fromkeys(JACOBIANS.values())),
    refusal=refusal,
    readme="casadi.md.j2",
    straight=True,
)
