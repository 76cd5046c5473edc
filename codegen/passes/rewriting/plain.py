"""plain: the operations of the derivation as they are, equal ones done once, signs kept out of the
way.

Folding constants moves them, and in long recursions a moved constant is one more multiplication.
This is what the passes must beat: where they do not, it is what is emitted.
"""

from __future__ import annotations

import casadi as ca

from codegen.passes.rewriting.graph import EVEN, ODD, Mark
from codegen.passes.rewriting.lower import Code, Lowered, Operand
from codegen.passes.rewriting.trace import NAME_OF_CALL, Tape, is_multiplied
from derive.diagnostics import HamelError

Signed = tuple[float, Operand]  # ±1 and what it stands before
_SAME = frozenset({ca.OP_ASSIGN, ca.OP_LIFT})
_SUMS = {ca.OP_ADD: 1.0, ca.OP_SUB: -1.0}


def plain(tape: Tape, loose: range) -> tuple[Lowered, tuple[Mark, ...]]:
    """Operations for all roots of the tape (those numbered in `loose` up to their sign) and where
    the named entries are."""
    code = Code()
    done: list[Signed] = []
    for step in tape.steps:
        if step.code == ca.OP_CONST:
            done.append((1.0, step.number))
        elif step.code == ca.OP_INPUT:
            done.append((1.0, code.input(*tape.slot(step))))
        else:
            done.append(_applied(code, step.code, [done[i] for i in step.operands]))
    places: dict[int, tuple[Operand, float]] = {}
    marks: list[Mark] = []
    for named in tape.named:
        nodes = range(len(places), len(places) + len(named.steps))
        places |= {node: (done[i][1], done[i][0]) for node, i in zip(nodes, named.steps)}
        entries = tuple((label, (1.0, node)) for label, node in zip(named.labels, nodes))
        marks.append(Mark(named.name, named.about, entries))
    roots = [
        (done[root][1], done[root][0]) if k in loose else (_value(code, done[root]), 1.0)
        for k, root in enumerate(tape.roots)
    ]
    values, signs = tuple(value for value, _ in roots), tuple(sign for _, sign in roots)
    return Lowered(code, values, signs, places), tuple(marks)


def _value(code: Code, signed: Signed) -> Operand:
    sign, operand = signed
    if sign > 0:
        return operand
    return -operand if isinstance(operand, float) else code.put("neg", operand)


def _applied(code: Code, instruction: int, operands: list[Signed]) -> Signed:
    if instruction in _SAME:
        return operands[0]
    if instruction == ca.OP_NEG:
        return -operands[0][0], operands[0][1]
    if instruction in _SUMS:
        return _sum(code, operands[0], (_SUMS[instruction] * operands[1][0], operands[1][1]))
    if instruction == ca.OP_TWICE:
        return operands[0][0], code.put("mul", 2.0, operands[0][1])
    if instruction == ca.OP_SQ:
        return 1.0, code.put("mul", operands[0][1], operands[0][1])
    if instruction == ca.OP_INV:
        return operands[0][0], code.put("div", 1.0, operands[0][1])
    if instruction in (ca.OP_MUL, ca.OP_DIV):
        name = "mul" if instruction == ca.OP_MUL else "div"
        return operands[0][0] * operands[1][0], code.put(name, operands[0][1], operands[1][1])
    return _call(code, instruction, operands)


def _sum(code: Code, left: Signed, right: Signed) -> Signed:
    """x − y and y − x are one operation."""
    if left[0] == right[0]:
        return left[0], code.put("add", left[1], right[1])
    sign = left[0]
    if isinstance(left[1], int) and isinstance(right[1], int) and left[1] > right[1]:
        left, right, sign = right, left, -sign
    return sign, code.put("sub", left[1], right[1])


def _call(code: Code, instruction: int, operands: list[Signed]) -> Signed:
    name = NAME_OF_CALL.get(instruction)
    if name is None:
        raise HamelError(f"there is no generated code for CasADi's operation {instruction}")
    if name in ODD:
        return operands[0][0], code.put(name, operands[0][1])
    if name in EVEN:
        return 1.0, code.put(name, operands[0][1])
    values = [_value(code, operand) for operand in operands]
    if name == "pow" and isinstance(values[1], float) and is_multiplied(values[1]):
        return 1.0, _power(code, values[0], values[1])
    return 1.0, code.put(name, *values)


def _power(code: Code, base: Operand, exponent: float) -> Operand:
    """Of a whole or half exponent, by products."""
    factors = [base] * int(abs(exponent))
    if abs(exponent) % 1.0:
        factors.append(code.put("sqrt", base))
    product: Operand = 1.0
    for factor in factors:
        product = factor if product == 1.0 else code.put("mul", product, factor)
    return product if exponent > 0 else code.put("div", 1.0, product)
