"""watch: which values have to be looked at so that no infinity and no NaN passes unseen; what shows
in a result is left out.

Arithmetic keeps NaN to the end; infinity gets lost only below a fraction line and in functions with
a limit there. So most arguments show in some result, and checking that result is enough.
"""

from __future__ import annotations

from dataclasses import dataclass

from codegen.passes.rewriting.lower import Code, Lowered

LOST, NAN, BOTH = range(3)  # of a value that is not finite: what of it certainly shows in a result

_KEEPS = frozenset(
    {"add", "sub", "mul", "neg", "sqrt", "fabs", "floor", "ceil"}
)  # infinity stays so, or becomes NaN
_SPOILS = frozenset({"sin", "cos", "tan", "asin", "acos"})  # infinity becomes NaN
_DULLS = frozenset(
    {
        "atan",
        "tanh",
        "exp",
        "expm1",
        "erf",
        "asinh",
        "sinh",
        "cosh",
        "log",
        "log1p",
        "acosh",
        "atanh",
    }
)


@dataclass(frozen=True)
class Watched:
    """Entries of arguments, and numbers of results, that are to be finite."""

    entries: tuple[tuple[str, int], ...]
    outputs: tuple[int, ...]


def watch(lowered: Lowered, size: int, arguments: dict[str, int]) -> Watched:
    """For the first `size` roots as results; `arguments` are the slots in use and their lengths.

    An entry is left out where both NaN and infinity in it certainly reach a computed result; that
    result is looked at instead.
    """
    code = lowered.code
    outputs = [(i, root) for i, root in enumerate(lowered.roots[:size]) if isinstance(root, int)]
    computed = [(i, root) for i, root in outputs if code.operations[root].name != "input"]
    shows = _shows(code, [root for _, root in computed])
    seen = {
        code.operations[i].slot
        for i, level in shows.items()
        if level == BOTH and code.operations[i].name == "input"
    }
    entries = [
        (name, i)
        for name, length in arguments.items()
        for i in range(length)
        if (name, i) not in seen
    ]
    return Watched(tuple(entries), tuple(i for i, _ in computed))


def _shows(code: Code, roots: list[int]) -> dict[int, int]:
    """For every operation what of it shows in the roots."""
    shows = dict.fromkeys(roots, BOTH)
    for i in reversed(code.reachable(roots)):
        level = shows.get(i, LOST)
        operation = code.operations[i]
        if operation.name == "input" or level == LOST:
            continue
        for place, operand in enumerate(operation.operands):
            if isinstance(operand, int):
                shows[operand] = max(
                    shows.get(operand, LOST), _through(operation.name, place, level)
                )
    return shows


def _through(name: str, place: int, level: int) -> int:
    """What of an operand shows where `level` of the operation's result does."""
    if name in _KEEPS or (name == "div" and place == 0):
        return level
    # whatever is not finite leaves these as NaN, and NaN is not lost again before the result
    if name in _SPOILS:
        return BOTH
    # 1/∞ is 0 and exp(−∞) too: of such an operand only NaN is sure to show
    return NAN if name in _DULLS or name == "div" else LOST
