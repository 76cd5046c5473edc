"""improve: rounds of passes over the operations of one function; the best result wins, for a pass
may cost something that a later one does not regain.

To choose the multiples that are computed (see scales) takes most of the time. For a long function
that is done only for what is best by an estimate, for a short one after every pass.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from codegen.limits import (
    LONG_FUNCTION,
    LONGEST_FUNCTION,
    MOST_ROUNDS,
    SHORT_FUNCTION,
)
from codegen.passes.rewriting.balance import balance
from codegen.passes.rewriting.factor import factor
from codegen.passes.rewriting.graph import Call, Mark, Product, Sum, Work, same
from codegen.passes.rewriting.invert import invert
from codegen.passes.rewriting.lower import Lowered, Operation, lower
from codegen.passes.rewriting.plain import plain
from codegen.passes.rewriting.scales import Starts, starts
from codegen.passes.rewriting.share import share
from codegen.passes.rewriting.trace import Tape, trace
from codegen.program import KINDS, Entry

PASSES: tuple[tuple[str, Callable[[Work], Work]], ...] = (("factor", factor), ("share", share))

_KIND = {
    "add": "add",
    "sub": "add",
    "mul": "multiply",
    "div": "divide",
    "sqrt": "sqrt",
    "sin": "sin",
    "cos": "cos",
}


@dataclass(frozen=True)
class Candidate:
    """A function as operations, their number (signs are counted apart), and where its named entries
    are."""

    lowered: Lowered
    marks: tuple[Mark, ...]
    total: int
    signs: int


class _Draft:
    """A function after some passes: the number of its operations, and the operations when they are
    asked for."""

    def __init__(self, work: Work, loose: range, short: bool) -> None:
        self.work = work
        self._loose = loose
        self._short = short
        self.total = self.candidate.total if short else self._estimate()

    @functools.cached_property
    def candidate(self) -> Candidate:
        return _candidate(lower(self.work, self._loose, self._starts), self.work.marks)

    @functools.cached_property
    def _starts(self) -> Starts:
        return starts(self.work, set(self._loose))

    def after(self, apply: Callable[[Work], Work]) -> _Draft:
        """With one pass more; itself where that changes nothing."""
        changed = apply(self.work)
        return self if same(changed, self.work) else _Draft(changed, self._loose, self._short)

    def _estimate(self) -> int:
        """With the constants of the better start."""
        own = sum(map(self._own, self.work.live))
        return own + self._starts.constants

    def _own(self, node: int) -> int:
        inside = self.work.graph.nodes[node]
        if isinstance(inside, Sum):
            return len(inside.terms) - 1
        if isinstance(inside, Product):
            exponents = [exponent for _, exponent in inside.factors]
            powers = sum(_power_cost(abs(exponent)) for exponent in exponents)
            return powers + len(exponents) - any(exponent > 0 for exponent in exponents)
        return int(isinstance(inside, Call))


def _power_cost(exponent: int) -> int:
    """Multiplications by repeated squaring."""
    return exponent.bit_length() + exponent.bit_count() - 2


def improve(name: str, tape: Tape, loose: range) -> tuple[Candidate, list[Entry]]:
    """The fewest operations found for a recorded function, and what each step did to their number.

    `loose` numbers the roots that may come out times a constant.
    """
    best = _candidate(*plain(tape, loose))
    entries = [Entry(name, "number", tape.count(), best.total)]
    drafts: list[_Draft] = []
    for step, draft in _rounds(trace(tape), loose, best.total):
        entries.append(Entry(name, step, entries[-1].after, draft.total))
        drafts.append(draft)
    for draft in _nearly_best(drafts, best.total <= SHORT_FUNCTION):
        best = min(draft.candidate, best, key=_cost)
    entries.append(Entry(name, "choose", entries[-1].after, best.total))
    inverted = _candidate(invert(best.lowered), best.marks)
    if inverted.total != best.total:
        entries.append(Entry(name, "invert", best.total, inverted.total))
    if inverted.total > LONG_FUNCTION:  # these wait for instructions, not for operands (measured)
        return inverted, entries
    balanced = _candidate(balance(inverted.lowered, _named(inverted)), inverted.marks)
    if balanced.total != inverted.total:  # a sign less, or a sum shared
        entries.append(Entry(name, "balance", inverted.total, balanced.total))
    return balanced, entries


def _rounds(work: Work, loose: range, operations: int) -> Iterator[tuple[str, _Draft]]:
    """The folded graph, then what each pass makes of it, for as long as a round helps."""
    short = operations <= SHORT_FUNCTION
    if operations > LONGEST_FUNCTION:  # what comes of all passes alone: one draft needs no estimate
        yield "fold, factor and share", _Draft(share(factor(work)), loose, short=True)
        return
    draft = _Draft(work, loose, short)
    yield "fold", draft
    # later rounds may cost more than they save: the least decides whether to go on
    least = draft.total
    for _ in range(1 if operations > LONG_FUNCTION else MOST_ROUNDS):
        start = least
        for step, apply in PASSES:
            draft = draft.after(apply)
            least = min(least, draft.total)
            yield step, draft
        if least == start:
            return


def _nearly_best(drafts: list[_Draft], short: bool) -> list[_Draft]:
    """Those that may have the fewest operations, of equal ones the later last: of a long function
    the best by its estimate."""
    least = min(draft.total for draft in drafts)
    near = [draft for draft in drafts if draft.total == least]
    return near if short else near[-1:]


def _candidate(lowered: Lowered, marks: tuple[Mark, ...]) -> Candidate:
    operations = used_operations(lowered)
    return Candidate(
        lowered,
        marks,
        count(operations)["total"],
        sum(operation.name == "neg" for operation in operations),
    )


def _cost(candidate: Candidate) -> tuple[int, int]:
    return candidate.total, candidate.signs


def _named(candidate: Candidate) -> set[int]:
    """The operations that are shown under a name."""
    places = candidate.lowered.places
    operands = (
        places[node][0]
        for mark in candidate.marks
        for _, (_, node) in mark.entries
        if node in places
    )
    return {operand for operand in operands if isinstance(operand, int)}


def used_operations(lowered: Lowered) -> list[Operation]:
    """The operations that the roots need."""
    operations = lowered.code.operations
    return [operations[i] for i in lowered.wanted]


def count(operations: Iterable[Operation]) -> dict[str, int]:
    """Operations of each kind. A negation is a sign, not an operation, and is not counted."""
    counts: dict[str, int] = dict.fromkeys(KINDS, 0)
    for operation in operations:
        if operation.name not in ("input", "neg"):
            counts[_KIND.get(operation.name, "other")] += 1
    return {**counts, "total": sum(counts.values())}
