"""lanes: which functions exist for several states side by side."""

from __future__ import annotations

from codegen.program import Expression, Kernel

BATCHED = ("dynamics",)  # worth the time to compile them twice
PLAIN = frozenset({
    "add", "sub", "mul", "div", "neg", "sqrt", "sin", "cos", "fabs", "sign", "lt", "le", "eq", "ne",
    "and", "or", "not", "where",
})  # fmt: skip
# statements, inputs and outputs together: longer loops over lanes take compilers too long
WIDEST = 1_500


def is_batched(kernel: Kernel) -> bool:
    """No iteration, no calls of the C library, not too long: compilers make vector instructions of
    it."""
    values = [s.value for section in kernel.sections for s in section.statements]
    values += [*kernel.outputs, *(guard.value for guard in kernel.guards)]
    size = len(kernel.x.names) + len(values)
    return (
        kernel.name in BATCHED
        and kernel.loop is None
        and size <= WIDEST
        and all(map(_is_plain, values))
    )


def _is_plain(value: Expression) -> bool:
    return not isinstance(value, tuple) or (value[0] in PLAIN and all(map(_is_plain, value[1:])))
