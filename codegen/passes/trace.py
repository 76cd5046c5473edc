"""trace: from CasADi graphs to the graph of the passes. Equal expressions meet here, constants fold here."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca

from codegen.passes.graph import Graph, Mark, Reference, Work, scaled
from derive.diagnostics import HamelError

_CALLS = {
    "SQRT": "sqrt", "SIN": "sin", "COS": "cos", "TAN": "tan", "ASIN": "asin", "ACOS": "acos", "ATAN": "atan",
    "SINH": "sinh", "COSH": "cosh", "TANH": "tanh", "ASINH": "asinh", "ACOSH": "acosh", "ATANH": "atanh", "EXP": "exp",
    "LOG": "log", "EXPM1": "expm1", "LOG1P": "log1p", "ERF": "erf", "FABS": "fabs", "FLOOR": "floor", "CEIL": "ceil",
    "ATAN2": "atan2", "HYPOT": "hypot", "FMIN": "fmin", "FMAX": "fmax", "COPYSIGN": "copysign", "FMOD": "fmod",
    "SIGN": "sign", "LT": "lt", "LE": "le", "EQ": "eq", "NE": "ne", "AND": "and", "OR": "or", "NOT": "not",
    "IF_ELSE_ZERO": "where",
}  # fmt: skip
_MOST = 16  # integer powers up to this are multiplied out


def trace(
    arguments: Sequence[tuple[str, ca.SX]], roots: Sequence[ca.SX], named: Sequence[tuple[str, str, ca.SX]]
) -> tuple[Work, int]:
    """The scalars `roots` as a Work, and the number of instructions CasADi has for them.

    named holds (name, about, matrix): they ride along as further outputs and come back as marks.
    """
    matrices = [ca.densify(ca.vertcat(*roots)), *(ca.densify(ca.vec(value.T)) for _, _, value in named)]
    symbols = [symbol for _, symbol in arguments]
    function = ca.Function("traced", symbols, matrices)
    graph, outputs = _run(function, [name for name, _ in arguments])
    marks = (Mark(name, about, _labelled(name, value, found)) for (name, about, value), found in zip(named, outputs[1:]))
    return Work(graph, tuple(outputs[0]), tuple(marks)), _counted(ca.Function("plain", symbols, matrices[:1]))


def _counted(function: ca.Function) -> int:
    """Instructions that compute something; CasADi's own count before any pass."""
    free = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST, ca.OP_NEG, ca.OP_ASSIGN}
    return sum(function.instruction_id(k) not in free for k in range(function.n_instructions()))


def _labelled(name: str, value: ca.SX, found: Sequence[Reference]) -> tuple[tuple[str, Reference], ...]:
    """Entries that are computed, labelled as in the textbook: M_1_2, h_3, T."""
    rows, columns = value.shape
    labels = [_label(name, r, c, rows, columns) for r in range(rows) for c in range(columns)]
    return tuple((label, reference) for label, reference in zip(labels, found))


def _label(name: str, row: int, column: int, rows: int, columns: int) -> str:
    if columns == 1:
        return name if rows == 1 else f"{name}_{row + 1}"
    return f"{name}_{row + 1}_{column + 1}"


def _run(function: ca.Function, arguments: Sequence[str]) -> tuple[Graph, list[list[Reference]]]:
    """Execute the function's instructions on references instead of numbers."""
    graph = Graph()
    outputs = [[(0.0, 0)] * function.numel_out(i) for i in range(function.n_out())]
    register: dict[int, Reference] = {}
    for k in range(function.n_instructions()):
        code, inputs, targets = function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_OUTPUT:
            outputs[targets[0]][targets[1]] = register[inputs[0]]
        elif code == ca.OP_INPUT:
            register[targets[0]] = graph.input(arguments[inputs[0]], inputs[1])
        elif code == ca.OP_CONST:
            register[targets[0]] = graph.constant(function.instruction_constant(k))
        else:
            register[targets[0]] = _operation(code)(graph, [register[i] for i in inputs])
    return graph, outputs


def _operation(code: int) -> Operation:
    if code not in _OPERATIONS:
        name = next((key[3:].lower() for key in dir(ca) if key.startswith("OP_") and getattr(ca, key) == code), str(code))
        raise HamelError(f"there is no generated code for CasADi's operation '{name}'")
    return _OPERATIONS[code]


Operation = Callable[[Graph, list[Reference]], Reference]


def _power(graph: Graph, operands: list[Reference]) -> Reference:
    base, (value, node) = operands
    if node == 0 and value == round(value) and abs(value) <= _MOST:
        return graph.product([(base, round(value))])
    if node == 0 and value == 0.5:
        return graph.call("sqrt", [base])
    return graph.call("pow", operands)


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
    for name, operation in [*_ARITHMETIC.items(), *((key, _call(name)) for key, name in _CALLS.items())]
}
