"""hoist: work that needs parameters alone is taken out, so that it can be done once for many
states: precompute(p) → c."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from codegen.passes.rewriting.lower import Code, Lowered, Operand


@dataclass(frozen=True)
class Hoisted:
    """`precompute` gives c from p, `rest` the same roots from t, x, u and c; `entries` are those of
    p that c holds unchanged."""

    precompute: Lowered
    rest: Lowered
    entries: dict[int, int]  # place in c → place in p


def hoist(lowered: Lowered) -> Hoisted | None:
    """None where nothing is computed from parameters alone.

    c holds every value that needs p alone and is used by something that needs more, or is a result
    itself; both halves together do the same operations as the whole.
    """
    operations = lowered.code.operations
    roots = [root for root in lowered.roots if isinstance(root, int)]
    wanted = lowered.wanted
    alone = _of_parameters_alone(lowered.code, wanted)
    inner = lowered.code.inner
    # what crosses over: made from parameters, used by what depends on more
    edge = [i for user in wanted if user not in alone for i in inner[user] if i in alone]
    places = {
        i: k for k, i in enumerate(sorted({*edge, *(root for root in roots if root in alone)}))
    }
    # only plain parameters would cross: there is no work to take out
    if all(operations[i].name == "input" for i in places):
        return None
    before = _copied(lowered, [i for i in wanted if i in alone], {})
    after = _copied(lowered, [i for i in wanted if i not in alone or i in places], places)
    precompute = Lowered(before[0], tuple(before[1][i] for i in places), (1.0,) * len(places), {})
    outer = {node: place for node, place in lowered.places.items() if _is_kept(place[0], after[1])}
    moved = {node: (_there(operand, after[1]), scale) for node, (operand, scale) in outer.items()}
    rest = Lowered(
        after[0], tuple(_there(root, after[1]) for root in lowered.roots), lowered.factors, moved
    )
    entries = {k: operations[i].slot[1] for i, k in places.items() if operations[i].name == "input"}
    return Hoisted(precompute, rest, entries)


def _of_parameters_alone(code: Code, wanted: Sequence[int]) -> set[int]:
    alone: set[int] = set()
    for i in wanted:
        operation = code.operations[i]
        if operation.name == "input":
            depends_on_parameters = operation.slot[0] == "p"
        else:
            inner = code.inner[i]
            depends_on_parameters = bool(inner) and all(operand in alone for operand in inner)
        if depends_on_parameters:
            alone.add(i)
    return alone


def _copied(
    lowered: Lowered, chosen: list[int], given: dict[int, int]
) -> tuple[Code, dict[int, int]]:
    """The chosen operations in a code of their own; those in `given` become entries of c."""
    code = Code()
    moved: dict[int, int] = {}
    for i in chosen:
        operation = lowered.code.operations[i]
        if i in given:
            moved[i] = code.input("c", given[i])
        elif operation.name == "input":
            moved[i] = code.input(*operation.slot)
        else:
            operands = [_there(operand, moved) for operand in operation.operands]
            moved[i] = code.put(operation.name, *operands)
    return code, moved


def _there(operand: Operand, moved: dict[int, int]) -> Operand:
    return moved[operand] if isinstance(operand, int) else operand


def _is_kept(operand: Operand, moved: dict[int, int]) -> bool:
    return not isinstance(operand, int) or operand in moved
