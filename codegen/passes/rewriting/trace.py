"""trace: from CasADi graphs to the graph of the passes. Equal expressions meet here, constants fold
here."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca

from codegen.limits import MOST_MULTIPLIED_OUT
from codegen.passes.rewriting.graph import Graph, Mark, Reference, Work, scaled
from derive.diagnostics import HamelError
from derive.expressions.instructions import Instruction, listing

_CALLS = {
    "SQRT": "sqrt", "SIN": "sin", "COS": "cos", "TAN": "tan", "ASIN": "asin", "ACOS": "acos",
    "ATAN": "atan",
    "SINH": "sinh", "COSH": "cosh", "TANH": "tanh", "ASINH": "asinh", "ACOSH": "acosh",
    "ATANH": "atanh", "EXP": "exp",
    "LOG": "log", "EXPM1": "expm1", "LOG1P": "log1p", "ERF": "erf", "FABS": "fabs",
    "FLOOR": "floor", "CEIL": "ceil",
    "ATAN2": "atan2", "HYPOT": "hypot", "FMIN": "fmin", "FMAX": "fmax", "COPYSIGN": "copysign",
    "FMOD": "fmod",
    "SIGN": "sign", "LT": "lt", "LE": "le", "EQ": "eq", "NE": "ne", "AND": "and", "OR": "or",
    "NOT": "not",
    "IF_ELSE_ZERO": "where",
}  # fmt: skip


@dataclass(frozen=True)
class Named:
    """A named intermediate: what its nonzero entries are called, and the steps they come from."""

    name: str
    about: str
    labels: tuple[str, ...]
    steps: tuple[int, ...]


@dataclass(frozen=True)
class Tape:
    """A function as CasADi would run it, every result in a place of its own."""

    arguments: tuple[str, ...]
    steps: tuple[Instruction, ...]
    roots: tuple[int, ...]
    named: tuple[Named, ...]

    def count(self) -> int:
        """Instructions that compute something for the roots, before any pass."""
        return sum(
            bool(flag) and step.code not in _COST_NOTHING
            for flag, step in zip(self.needed(self.roots), self.steps)
        )

    def needed(self, roots: Sequence[int]) -> bytearray:
        """1 for every step that the roots need."""
        needed = bytearray(len(self.steps))
        for root in roots:
            needed[root] = 1
        for k in range(len(self.steps) - 1, -1, -1):
            for operand in self.steps[k].operands if needed[k] else ():
                needed[operand] = 1
        return needed

    def slot(self, step: Instruction) -> tuple[str, int]:
        """Of an input the argument's name and the entry of it."""
        argument, entry = step.entry
        return self.arguments[argument], entry


_COST_NOTHING = frozenset({ca.OP_INPUT, ca.OP_CONST, ca.OP_NEG, ca.OP_ASSIGN})


def record(
    arguments: Sequence[tuple[str, ca.SX]],
    roots: Sequence[ca.SX],
    named: Sequence[tuple[str, str, ca.SX]] = (),
) -> Tape:
    """The scalars `roots` as a tape. named holds (name, about, matrix): they ride along as further
    outputs."""
    matrices = [ca.densify(ca.vertcat(*roots)), *(value.T for _, _, value in named)]
    program = listing(ca.Function("traced", [symbol for _, symbol in arguments], matrices))
    intermediates = (
        Named(name, about, tuple(_labels(name, value)), steps)
        for (name, about, value), steps in zip(named, program.outputs[1:])
    )
    return Tape(
        arguments=tuple(name for name, _ in arguments),
        steps=program.instructions,
        roots=program.outputs[0],
        named=tuple(intermediates),
    )


def _labels(name: str, value: ca.SX) -> list[str]:
    """Entries that are not structural zeros, row by row, labelled as in the textbook: M_1_2, h_3,
    T."""
    columns, rows = value.T.sparsity().get_triplet()
    return [_label(name, r, c, *value.shape) for r, c in zip(rows, columns)]


def _label(name: str, row: int, column: int, rows: int, columns: int) -> str:
    if columns == 1:
        return name if rows == 1 else f"{name}_{row + 1}"
    return f"{name}_{row + 1}_{column + 1}"


def trace(tape: Tape) -> Work:
    """The tape run on references instead of numbers; what was named comes back as marks."""
    graph = Graph()
    done: list[Reference] = []
    for step in tape.steps:
        if step.code == ca.OP_INPUT:
            done.append(graph.input(*tape.slot(step)))
        elif step.code == ca.OP_CONST:
            done.append(graph.constant(step.number))
        else:
            operands = [done[i] for i in step.operands]
            done.append(graph.bounded(_operation(step.code)(graph, operands)))
    marks = (
        Mark(
            named.name,
            named.about,
            tuple((label, done[i]) for label, i in zip(named.labels, named.steps)),
        )
        for named in tape.named
    )
    return Work(graph, tuple(done[root] for root in tape.roots), tuple(marks))


def _operation(code: int) -> Operation:
    if code not in _OPERATIONS:
        raise HamelError(f"there is no generated code for CasADi's operation '{_name(code)}'")
    return _OPERATIONS[code]


def _name(code: int) -> str:
    """CasADi's own name of an operation."""
    codes = {key: getattr(ca, key) for key in dir(ca) if key.startswith("OP_")}
    return next((key[3:].lower() for key, known in codes.items() if known == code), str(code))


Operation = Callable[[Graph, list[Reference]], Reference]


def is_multiplied(exponent: float) -> bool:
    """Whether a power is a product, with a root or without: it is whole or half, and small."""
    return 2.0 * exponent == round(2.0 * exponent) and abs(exponent) <= MOST_MULTIPLIED_OUT


def _power(graph: Graph, operands: list[Reference]) -> Reference:
    """Of whole and half exponents products, with the root: x^(5/2) = x² √x is NaN, 0 and infinite
    where the library's power is."""
    base, (value, node) = operands
    if node != 0 or not is_multiplied(value):
        return graph.call("pow", operands)
    whole = int(value)
    factors = [(base, whole)] if whole else []
    if value != whole:
        factors.append((graph.call("sqrt", [base]), 1 if value > 0 else -1))
    return graph.product(factors)


def _call(name: str) -> Operation:
    return lambda graph, operands: graph.call(name, operands)


_ARITHMETIC: dict[str, Operation] = {
    "ASSIGN": lambda g, o: o[0],
    "LIFT": lambda g, o: o[0],
    "ADD": lambda g, o: g.sum(o),
    "SUB": lambda g, o: g.sum([o[0], scaled(-1.0, o[1])]),
    "NEG": lambda g, o: scaled(-1.0, o[0]),
    "TWICE": lambda g, o: scaled(2.0, o[0]),
    "MUL": lambda g, o: g.product([(o[0], 1), (o[1], 1)]),
    "DIV": lambda g, o: g.product([(o[0], 1), (o[1], -1)]),
    "INV": lambda g, o: g.product([(o[0], -1)]),
    "SQ": lambda g, o: g.product([(o[0], 2)]),
    "POW": _power,
    "CONSTPOW": _power,
}
_OPERATIONS: dict[int, Operation] = {
    getattr(ca, f"OP_{name}"): operation
    for name, operation in [
        *_ARITHMETIC.items(),
        *((key, _call(name)) for key, name in _CALLS.items()),
    ]
}
NAME_OF_CALL = {getattr(ca, f"OP_{key}"): name for key, name in _CALLS.items()} | {
    ca.OP_POW: "pow",
    ca.OP_CONSTPOW: "pow",
}
