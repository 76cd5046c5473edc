"""schedule: order operations under the headings of the textbook, give them names, and nest what is
used once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from codegen.passes.rewriting.graph import Mark
from codegen.passes.rewriting.lower import Code, Lowered, Operand, Operation
from codegen.program import Expression, Load, Section, Statement

TURNS = "angles: their sines and cosines, all together"
SUMMANDS = 32  # from which the terms of a sum stand before it, one after the other
_ADDED = ("add", "sub")
_NESTED = 11  # names, numbers and operators that one nested expression may hold


@dataclass(frozen=True)
class Scheduled:
    loads: tuple[Load, ...]
    sections: tuple[Section, ...]
    roots: tuple[Expression, ...]


def schedule(
    lowered: Lowered,
    marks: Sequence[Mark],
    title: str,
    inputs: dict[tuple[str, int], str],
    free: Callable[[str], str],
    shape: tuple[int, int] = (0, 1),
) -> Scheduled:
    """inputs names argument entries; free(wanted) makes a name that is not taken; `title` heads
    what belongs to no mark. Of a matrix of that `shape`, where it comes first, one column is
    finished after the other: what a column is made of has to be kept no longer."""
    roots = [root for root in _by_columns(lowered.roots, *shape) if isinstance(root, int)]
    wanted = set(lowered.wanted)
    groups: list[tuple[str, list[int]]] = []
    done = {i for i in wanted if lowered.code.operations[i].name == "input"}
    sums = _long_sums(lowered.code, lowered.wanted, roots)
    for heading, starts in [
        (TURNS, _turns(lowered.code, wanted)),
        *_headings(lowered, marks, wanted),
        (title, roots),
    ]:
        group = _depth_first(lowered.code, starts, done, sums)
        if group:
            groups.append((heading, group))
    names = _names(lowered, marks, wanted)
    nested = _nested(lowered.code, groups, roots, names)
    return _write(lowered, wanted, groups, names, nested, inputs, free)


def _by_columns(roots: Sequence[Operand], rows: int, columns: int) -> Sequence[Operand]:
    """The roots of a matrix, row by row with others behind it, column by column."""
    size = rows * columns
    return [*(root for k in range(columns) for root in roots[k:size:columns]), *roots[size:]]


def _headings(
    lowered: Lowered, marks: Sequence[Mark], wanted: set[int]
) -> list[tuple[str, list[int]]]:
    headings: list[tuple[str, list[int]]] = []
    for mark in marks:
        starts = [
            lowered.places[node][0] for _, (_, node) in mark.entries if node in lowered.places
        ]
        headings.append(
            (
                f"{mark.name}: {mark.about}",
                [i for i in starts if isinstance(i, int) and i in wanted],
            )
        )
    return headings


def _long_sums(
    code: Code, wanted: Sequence[int], roots: Sequence[int]
) -> dict[int, tuple[int, ...]]:
    """Sums of very many terms, and these as they were made: what belongs to one of many equal links
    or loops looks like the next then, whatever way they are added up."""
    operations = code.operations
    uses: Counter[int] = Counter(roots)
    for i in wanted:
        uses.update(code.inner[i])
    added = [i for i in wanted if operations[i].name in _ADDED]
    inside = {
        o for i in added for o in code.inner[i] if uses[o] == 1 and operations[o].name in _ADDED
    }
    found = {i: sorted(_terms(code, i, inside)) for i in added if i not in inside}
    return {i: tuple(terms) for i, terms in found.items() if len(terms) >= SUMMANDS}


def _terms(code: Code, i: int, inside: set[int]) -> Iterator[int]:
    stack = [*code.inner[i]]
    while stack:
        operand = stack.pop()
        if operand in inside:
            stack += code.inner[operand]
        else:
            yield operand


def _depth_first(
    code: Code,
    starts: Sequence[int],
    done: set[int],
    sums: Mapping[int, tuple[int, ...]],
) -> list[int]:
    """What the starts need and `done` does not hold, operands first: values are used soon after
    they are made. The terms of a long sum come before any of it is added up."""
    order: list[int] = []
    for start in starts:
        stack = [(start, False)]
        while stack:
            i, ready = stack.pop()
            if i in done:
                continue
            if ready:
                done.add(i)
                order.append(i)
            else:
                stack.append((i, True))
                inner = (*reversed(code.inner[i]), *reversed(sums.get(i, ())))
                stack += [(operand, False) for operand in inner if operand not in done]
    return order


def _names(lowered: Lowered, marks: Sequence[Mark], present: set[int]) -> dict[int, str]:
    """Names worth having: entries of named matrices, sines and cosines of a coordinate."""
    names: dict[int, str] = {}
    for mark in marks:
        for label, (factor, node) in mark.entries:
            operand, scale = lowered.places.get(node, (0.0, 1.0))
            if isinstance(operand, int) and operand in present and factor == scale:
                names.setdefault(operand, label)
    return names


def _nested(
    code: Code, groups: Sequence[tuple[str, list[int]]], roots: Sequence[int], names: dict[int, str]
) -> set[int]:
    """Operations used once, in the section they stand in, become part of the expression that uses
    them."""
    count: dict[int, int] = {}
    user: dict[int, int] = {}
    home = {i: k for k, (_, group) in enumerate(groups) for i in group}
    for i in home:
        for operand in code.inner[i]:
            count[operand] = count.get(operand, 0) + 1
            user[operand] = i
    for root in roots:
        # two uses: a result is never nested, so that it can be seen under its own name
        count[root] = count.get(root, 0) + 2
    return _fitting(
        code,
        home,
        lambda i: (
            count[i] == 1 and i not in names and home[user[i]] == home[i] and not _is_turn(code, i)
        ),
    )


def _turns(code: Code, wanted: set[int]) -> list[int]:
    """Sines and cosines of angles that need no others: they stand at the beginning and are computed
    side by side."""
    later: set[int] = set()  # what depends on a sine or cosine
    places: list[int] = []
    for i in sorted(wanted):
        depends = any(operand in later for operand in code.inner[i])
        if _is_turn(code, i) and not depends:
            places.append(i)
        if _is_turn(code, i) or depends:
            later.add(i)
    return places


def _is_turn(code: Code, i: int) -> bool:
    return code.operations[i].name in ("sin", "cos")


def _fitting(code: Code, home: dict[int, int], once: Callable[[int], bool]) -> set[int]:
    size: dict[int, int] = {}
    nested: set[int] = set()
    for i in sorted(home):
        operands = code.operations[i].operands
        size[i] = 1 + sum(size.get(x, 1) if isinstance(x, int) else 1 for x in operands)
        if once(i) and size[i] <= _NESTED:
            nested.add(i)
        else:
            size[i] = 1
    return nested


def _write(
    lowered: Lowered,
    wanted: set[int],
    groups: Sequence[tuple[str, list[int]]],
    names: dict[int, str],
    nested: set[int],
    inputs: dict[tuple[str, int], str],
    free: Callable[[str], str],
) -> Scheduled:
    loads = _loads(lowered, wanted, inputs)
    expressions: dict[int, Expression] = {i: load.name for i, load in loads.items()}
    sections: list[Section] = []
    for heading, group in groups:
        statements: list[Statement] = []
        for i in group:
            value = _expression(lowered.code.operations[i], expressions)
            expressions[i] = (
                value if i in nested else free(names.get(i) or _trig_name(value) or "z")
            )
            if i not in nested:
                statements.append(Statement(str(expressions[i]), value))
        sections.append(Section(heading, tuple(statements)))
    roots = tuple(expressions[root] if isinstance(root, int) else root for root in lowered.roots)
    return Scheduled(tuple(sorted(loads.values(), key=_slot)), tuple(sections), roots)


def _loads(
    lowered: Lowered, wanted: set[int], inputs: dict[tuple[str, int], str]
) -> dict[int, Load]:
    operations = lowered.code.operations
    slots = {i: operations[i].slot for i in sorted(wanted) if operations[i].name == "input"}
    return {i: Load(inputs[slot], *slot) for i, slot in slots.items()}


def _slot(load: Load) -> tuple[int, str, int]:
    """Arguments, then what a link reads: constants, numbers by name, its row and what it
    receives."""
    rank = {name: k for k, name in enumerate("txupck")} | {"r": 7, "e": 8}
    return rank.get(load.argument, 6), load.argument, load.index


def _expression(operation: Operation, expressions: dict[int, Expression]) -> Expression:
    return (
        operation.name,
        *(expressions[o] if isinstance(o, int) else o for o in operation.operands),
    )


def _trig_name(value: Expression) -> str | None:
    if isinstance(value, tuple) and value[0] in ("sin", "cos") and isinstance(value[1], str):
        return f"{value[0]}_{value[1]}"
    return None
