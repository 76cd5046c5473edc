"""invert: several divisions by the same value become one reciprocal and multiplications, of which a
processor does many more.

It counts as one operation more, but a division takes as long as four to ten multiplications.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

from codegen.passes.rewriting.lower import Code, Lowered, Operand, Operation


def invert(lowered: Lowered) -> Lowered:
    """The same values with every divisor divided by once."""
    wanted = lowered.wanted
    divisions = [
        lowered.code.operations[i] for i in wanted if lowered.code.operations[i].name == "div"
    ]
    count = Counter(
        operation.operands[1] for operation in divisions if isinstance(operation.operands[1], int)
    )
    shared = {divisor for divisor, uses in count.items() if uses > 1}
    if not shared:
        return lowered
    code = Code()
    moved: dict[int, int] = {}
    for i in wanted:
        moved[i] = _operation(code, lowered.code.operations[i], moved, shared)
    places = {
        node: (moved[operand] if isinstance(operand, int) else operand, scale)
        for node, (operand, scale) in lowered.places.items()
        if not isinstance(operand, int) or operand in moved
    }
    roots = tuple(moved[root] if isinstance(root, int) else root for root in lowered.roots)
    return Lowered(code, roots, lowered.factors, places)


def _operation(code: Code, operation: Operation, moved: dict[int, int], shared: set[int]) -> int:
    if operation.name == "input":
        return code.input(*operation.slot)
    operands: list[Any] = [_there(operand, moved) for operand in operation.operands]
    if (
        operation.name != "div"
        or operation.operands[1] not in shared
        or isinstance(operation.operands[1], float)
    ):
        return code.put(operation.name, *operands)
    # equal operations are one: every user of the divisor gets the same reciprocal
    reciprocal = code.put("div", 1.0, operands[1])
    return (
        reciprocal
        if operands[0] == 1.0 and isinstance(operands[0], float)
        else code.put("mul", operands[0], reciprocal)
    )


def _there(operand: Operand, moved: dict[int, int]) -> Operand:
    return moved[operand] if isinstance(operand, int) else operand
