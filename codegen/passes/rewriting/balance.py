"""balance: sums and products of several operands are done in the order in which these are known,
the latest one last.

As many operations, but what waits for the latest operand waits for one operation only: in a long
recursion every link begins where the one before has ended. 2 · z · cos q becomes (2 · cos q) · z,
and a − (b − z) becomes (a − b) + z.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from codegen.passes.rewriting.lower import Code, Lowered, Operand, Operation

CYCLES = {"neg": 1, "add": 3, "sub": 3, "mul": 4, "div": 13}
OTHERS = 20  # cycles of a square root, and of sines and cosines, which stand at the beginning
FUSED = 4  # of a product and a sum together
EARLY, EARLIEST = -1, -2  # parameters, which may be hoisted, and numbers
KINDS = {"add": "sum", "sub": "sum", "mul": "product"}

Signed = tuple[int, Operand]  # ±1 and what it stands before


def balance(lowered: Lowered, named: Iterable[int] = ()) -> Lowered:
    """The same roots; operations in `named` stay whole, for they are shown under their names."""
    operations = lowered.code.operations
    roots = [root for root in lowered.roots if isinstance(root, int)]
    wanted = lowered.wanted
    inside = _inside(lowered.code, wanted, {*roots, *named})
    if not inside:
        return lowered
    rewriting = _Rewriting()
    for i in wanted:
        if i not in inside:
            rewriting.moved[i] = rewriting.again(operations, i, inside)
    places = {
        node: (rewriting.there(o), scale)
        for node, (o, scale) in lowered.places.items()
        if isinstance(o, float) or o in rewriting.moved
    }
    return Lowered(
        rewriting.code,
        tuple(rewriting.there(root) for root in lowered.roots),
        lowered.factors,
        places,
    )


def _inside(code: Code, wanted: Sequence[int], kept: set[int]) -> set[int]:
    """Sums that are a term of one other sum and nothing else, and such products."""
    operations = code.operations
    uses: Counter[int] = Counter()
    within: set[int] = set()
    for i in wanted:
        inner = code.inner[i]
        uses.update(inner)
        kind = KINDS.get(operations[i].name)
        within.update(o for o in inner if kind and KINDS.get(operations[o].name) == kind)
    return {i for i in within if uses[i] == 1 and i not in kept}


@dataclass
class _Rewriting:
    """New operations, when each is known, and where the old ones are."""

    code: Code = field(default_factory=Code)
    known: dict[int, int] = field(default_factory=dict[int, int])
    moved: dict[int, int] = field(default_factory=dict[int, int])

    def there(self, operand: Operand) -> Operand:
        """Where an old operand stands in the new code; a number is itself."""
        return operand if isinstance(operand, float) else self.moved[operand]

    def again(self, operations: list[Operation], i: int, inside: set[int]) -> int:
        """The place of operation i in the new code. A sum or product is opened into its parts, and
        they are joined in the order in which they are known."""
        operation = operations[i]
        if operation.name == "input":
            return self._input(*operation.slot)
        if operation.name not in KINDS:
            return self._put(operation.name, *map(self.there, operation.operands))
        parts = [(sign, self.there(part)) for sign, part in _parts(operations, i, inside)]
        first, *others = sorted(parts, key=lambda part: self._when(part[1]))
        for part in others:
            first = self._joined(operation.name, first, part)
        assert isinstance(first[1], int)
        return first[1]

    def _joined(self, name: str, left: Signed, right: Signed) -> Signed:
        if name == "mul" or left[0] == right[0]:
            return left[0], self._put("mul" if name == "mul" else "add", left[1], right[1])
        positive, negative = (left, right) if left[0] > 0 else (right, left)
        return 1, self._put("sub", positive[1], negative[1])

    def _when(self, operand: Operand) -> int:
        return EARLIEST if isinstance(operand, float) else self.known[operand]

    def _put(self, name: str, *operands: Operand) -> int:
        operation = self.code.put(name, *operands)
        self.known[operation] = self._ready_at(name, operands)
        return operation

    def _input(self, argument: str, entry: int) -> int:
        result = self.code.input(argument, entry)
        self.known[result] = EARLY if argument == "p" else 0
        return result

    def _ready_at(self, name: str, operands: tuple[Operand, ...]) -> int:
        """The cycle at which a result is known: that of its latest operand and the operation's own,
        a product that goes into a sum being one fused operation with it."""
        if max(map(self._when, operands)) < 0:
            return EARLY
        if KINDS.get(name) == "sum" and any(map(self._is_product, operands)):
            return (
                max(self._when(o) - CYCLES["mul"] * self._is_product(o) for o in operands) + FUSED
            )
        return max(map(self._when, operands)) + CYCLES.get(name, OTHERS)

    def _is_product(self, operand: Operand) -> bool:
        return isinstance(operand, int) and self.code.operations[operand].name == "mul"


def _parts(
    operations: list[Operation], i: int, inside: set[int], sign: int = 1
) -> Iterator[Signed]:
    """The terms of a sum with their signs, or the factors of a product."""
    name, (left, right) = operations[i].name, operations[i].operands
    for operand, own in ((left, sign), (right, -sign if name == "sub" else sign)):
        if (
            isinstance(operand, int)
            and operand in inside
            and KINDS[operations[operand].name] == KINDS[name]
        ):
            yield from _parts(operations, operand, inside, own)
        else:
            yield own, operand
