"""CasADi terms as one graph in which equal subexpressions are one node.

SX builds the same expression twice as two nodes; reading every term into one table numbers them by
value, so that a named term is recognised wherever it occurs again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca

from derive.expressions.instructions import Instruction, listing, run

_COMMUTES = {ca.OP_ADD, ca.OP_MUL, ca.OP_FMIN, ca.OP_FMAX}


@dataclass(frozen=True)
class Node:
    """`op` is a CasADi operation; OP_INPUT has the symbol's index in `number`, OP_CONST its
    value."""

    op: int
    operands: tuple[int, ...] = ()
    number: float = 0.0


@dataclass
class Graph:
    """Nodes over fixed symbols (one SX column); operands have smaller indices than what is made of
    them."""

    symbols: ca.SX
    nodes: list[Node] = field(default_factory=list[Node])
    index: dict[Node, int] = field(default_factory=dict[Node, int])
    _latest: tuple[ca.SX | None, list[int]] = (None, [])

    def read(self, value: ca.SX) -> list[int]:
        """The nodes of a term's entries, row by row. The latest term is not read again: one is
        tried in several forms."""
        if value is not self._latest[0]:
            self._latest = value, self._read(value)
        return self._latest[1]

    def _read(self, value: ca.SX) -> list[int]:
        if value.numel() == 1 and value.is_constant():
            return [self._entered(Node(ca.OP_CONST, (), float(value) + 0.0))]
        entries = ca.vec(ca.densify(ca.SX(value)).T)
        used = ca.symvar(entries)
        function = ca.Function("term", [ca.vertcat(*used)], [entries])
        places = [self.places[symbol.element_hash()] for symbol in used]
        (numbers,) = run(
            listing(function),
            entry=lambda _, nonzero: self._entered(Node(ca.OP_INPUT, (), float(places[nonzero]))),
            number=lambda value: self._entered(Node(ca.OP_CONST, (), value + 0.0)),
            operation=self._numbered,
        )
        return numbers

    @cached_property
    def places(self) -> dict[int, int]:
        """Where each symbol stands among the symbols."""
        return {self.symbols[i].element_hash(): i for i in range(self.symbols.numel())}

    def _numbered(self, read: Instruction, operands: list[int]) -> int:
        ordered = sorted(operands) if read.code in _COMMUTES else operands
        return self._entered(Node(read.code, tuple(ordered)))

    def _entered(self, node: Node) -> int:
        if node not in self.index:
            self.index[node] = len(self.nodes)
            self.nodes.append(node)
        return self.index[node]

    def below(self, roots: Sequence[int], stop: frozenset[int] = frozenset()) -> list[int]:
        """Everything the roots are made of down to `stop`, operands first."""
        below, waiting = set(roots), list(roots)
        while waiting:
            k = waiting.pop()
            if k in stop:
                continue
            fresh = [i for i in self.nodes[k].operands if i not in below]
            below.update(fresh)
            waiting.extend(fresh)
        return sorted(below)
