"""Taylor series: the coefficients of a solution in C, of any order at run time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from codegen import text
from codegen.passes.taylor import HIGHEST, Series, Step, histories, series, suffixes
from codegen.program import Expression, Program, Statement
from codegen.targets.records import Target

INTEGRATOR = "taylor"
WIDEST = 64  # bytes of a vector
_FORMS = {
    "product": "S[{k}] + {first} + {second}",
    "quotient": "(S[{k}] - {a} + {b} * R[{k}]) * {factor}",
    "root": "({a} - S[{k}]) * {factor}",
    "integral": "S[{k}] * part + {a} * R[{k}]",
    "minus": "-(S[{k}] * part) - {a} * R[{k}]",
}


@dataclass(frozen=True)
class Body:
    """The series of a chart as lines of C."""

    suffix: str
    about: str
    used: int  # slots
    slots: int  # the same in whole vectors
    stride: int  # of a row of slots: whole vectors, of an odd number of cache lines
    turns: bool
    loads: tuple[str, ...]
    start: tuple[str, ...]
    guards: tuple[tuple[str, str, str], ...]
    first: tuple[str, ...]  # slots and rates of order 0
    step: tuple[str, ...]
    unused: tuple[str, ...]
    rates: int


def files(program: Program) -> dict[str, str]:
    """NAME_taylor.h, and a NAME_taylor.c of each chart."""
    if INTEGRATOR not in program.integrators or not program.simulates:
        return {}
    bodies = [_body(program, suffix) for suffix in suffixes(program)]
    data: dict[str, Any] = {
        "program": program,
        "prefix": program.name,
        "PREFIX": program.name.upper(),
    }
    return {
        f"{program.name}_taylor.h": text.render(
            "taylor.h.j2", bodies=bodies, highest=HIGHEST, **data
        ),
        **{
            f"{program.name}_taylor{body.suffix}.c": text.render("taylor.c.j2", body=body, **data)
            for body in bodies
        },
    }


def _body(program: Program, suffix: str) -> Body:
    made = series(program, suffix)
    loads = [
        f"const double {load.name} = {load.argument}[{load.index}];"
        for load in made.loads
        if load.argument != "t"
    ]
    start = list(_start(program, made.start))
    used = {load.argument for load in made.loads}
    line = WIDEST * 8 // program.real.bits
    lines = max(1, -(-len(made.slots) // line))
    return Body(
        suffix=suffix,
        about=f"{len(made.slots)} products",
        used=len(made.slots),
        slots=lines * line,
        stride=(lines | 1) * line,
        turns=any(_is_turn(statement) for statement in made.start),
        loads=tuple(loads),
        start=tuple(start),
        guards=tuple(
            (_value(g.value), text.number(g.tolerance), text.comment(g.name)) for g in made.guards
        ),
        first=tuple(_first(made)),
        step=tuple(_step(made)),
        unused=tuple(name for name in "tupc" if name not in used),
        rates=len(made.rates),
    )


def _value(value: Expression) -> str:
    return text.expression(value, text.C)


def _is_turn(statement: Statement) -> bool:
    return isinstance(statement.value, tuple) and statement.value[0] in ("sin", "cos")


def _start(program: Program, statements: Sequence[Statement]) -> Iterator[str]:
    """Values at the start of a step; a sine comes with its cosine."""
    k = 0
    while k < len(statements):
        statement = statements[k]
        if isinstance(statement.value, tuple) and _is_turn(statement):
            pair = {s.value[0]: s.name for s in statements[k : k + 2] if isinstance(s.value, tuple)}
            angle, sin, cos = _value(statement.value[1]), pair["sin"], pair["cos"]
            yield f"double {sin}, {cos};"
            yield f"if ({program.name}_sincos({angle}, &{sin}, &{cos}) != 0.0)"
            yield f"    {sin} = sin({angle}), {cos} = cos({angle});"
            k += 2
        else:
            yield f"const double {statement.name} = {_value(statement.value)};"
            k += 1


def _first(made: Series) -> Iterator[str]:
    """Order 0."""
    for k, slot in enumerate(made.slots):
        left = "0.0" if slot.weighted else slot.left
        yield f"L[{k}] = {left}, R[{k}] = {slot.right};"
    for i, (rate, _) in enumerate(made.rates):
        yield f"out[ROW + {i}] = {_value(rate)};"


def _step(made: Series) -> Iterator[str]:
    """Order n > 0; a coefficient goes to the slots that need it as soon as there is one."""
    stores = _stores(made)
    depth = _depths(made)
    if made.time:
        yield f"const double {made.time} = n == 1 ? 1.0 : 0.0;"
        yield from stores.pop(made.time, ())
    for name, i in made.states:
        yield f"const double {name} = x_n[{i}];"
        yield from stores.pop(name, ())
    for step in made.steps:
        yield f"const double {step.name} = {_rule(step, depth)};"
        yield from stores.pop(step.name, ())
    for i, (_, rate) in enumerate(made.rates):
        yield f"x_next[{i}] = {_value(rate)} * next;" if rate != 0.0 else f"x_next[{i}] = 0.0;"


def _stores(made: Series) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for k, slot, left, right in histories(made):
        weighted = f"order_n * {left}" if slot.weighted else left
        found.setdefault(str(left), []).append(f"l[{k}] = {weighted};")
        found.setdefault(str(right), []).append(f"r[{k}] = {right};")
    return found


def _depths(made: Series) -> dict[str, int]:
    """How many steps one after the other it takes to a coefficient."""
    found: dict[str, int] = {}
    for step in made.steps:
        operands = [*_names(step.a), *_names(step.b)]
        found[step.name] = 1 + max((found.get(name, 0) for name in operands), default=0)
    return found


def _names(value: Expression) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, tuple):
        for operand in value[1:]:
            yield from _names(operand)


def _rule(step: Step, depth: dict[str, int]) -> str:
    """The coefficient as C; what comes latest is added last."""
    if step.rule == "linear":
        return _value(step.a)
    k, a, b = step.slot, _value(step.a), _value(step.b)
    terms = [(f"{a} * R[{k}]", depth.get(a, 0)), (f"L[{k}] * {b}", depth.get(b, 0))]
    first, second = (term for term, _ in sorted(terms, key=lambda item: item[1]))
    if step.rule == "quotient" and step.a == 0.0:
        return f"(S[{k}] + {b} * R[{k}]) * {step.factor}"
    return _FORMS[step.rule].format(k=k, a=a, b=b, factor=step.factor, first=first, second=second)


TAYLOR = Target("taylor", "Taylor series of the solution in C", files)
