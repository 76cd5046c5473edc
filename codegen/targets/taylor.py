"""Taylor series: the coefficients of a solution in C, of any order at run time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass, replace
from typing import Any

from codegen import text
from codegen.passes.names import RESERVED, Names
from codegen.passes.recurrences import TAKEN
from codegen.passes.series import Series, Term
from codegen.passes.taylor import HIGHEST, SERIES, names_in, series, series_in_lanes, suffixes
from codegen.program import Expression, Program, Statement
from codegen.targets.records import Target

WIDEST = 64  # bytes of a vector
ADDED = 4  # cycles that a multiplication and an addition take together


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
    inputs: int
    rates: int
    reads: tuple[str, ...]  # arguments that are rows
    time: bool
    roots: bool
    sides: tuple[tuple[int, int], ...]  # rows of both series of a slot of lanes, an even number
    rows: int  # of series


@dataclass(frozen=True)
class _Style:
    """Numbers of one motion, or vectors of several motions side by side."""

    real: str  # what a value is
    number: str  # how a number becomes one
    zero: str
    turn: tuple[str, ...]  # lines for a sine and a cosine
    language: text.Language
    shared: bool  # is a series that several slots take kept once? Vectors need not lie in a row

    def whole(self, value: Expression, numbers: Set[str]) -> str:
        """As it is taken where only what differs between lanes will do: a function's argument, an
        entry, a comparison."""
        form = self.number if names_in(value) <= numbers else "{}"
        return form.format(text.expression(value, self.language))


def files(program: Program) -> dict[str, str]:
    """NAME_taylor.h, a NAME_taylor.c of each chart, and NAME_taylor_lanes.c."""
    if SERIES not in program.integrators or not program.simulates:
        return {}
    one, many = _one(program), _many(program)
    bodies = [_body(program, suffix, one) for suffix in suffixes(program)]
    beside = suffixes(program) if series_in_lanes(program) else ()
    lanes = [_body(program, suffix, many) for suffix in beside]
    data: dict[str, Any] = {
        "program": program,
        "prefix": program.name,
        "PREFIX": program.name.upper(),
    }
    return {
        f"{program.name}_taylor.h": text.render(
            "taylor.h.j2",
            bodies=bodies,
            lanes=lanes,
            highest=HIGHEST,
            room=max((body.rows for body in lanes), default=0),
            **data,
        ),
        **{
            f"{program.name}_taylor{body.suffix}.c": text.render("taylor.c.j2", body=body, **data)
            for body in bodies
        },
        **{
            f"{program.name}_taylor{body.suffix}_lanes.c": text.render(
                "taylor_lanes.c.j2", body=body, **data
            )
            for body in lanes
        },
    }


def _one(program: Program) -> _Style:
    return _Style(
        real="double",
        number="{}",
        zero="0.0",
        turn=(
            "double {sin}, {cos};",
            f"if ({program.name}_sincos({{angle}}, &{{sin}}, &{{cos}}) != 0.0)",
            "    {sin} = sin({angle}), {cos} = cos({angle});",
        ),
        language=text.C,
        shared=False,
    )


def _many(program: Program) -> _Style:
    return _Style(
        real="Vector",
        number="ZERO + ({})",
        zero="ZERO",
        turn=(
            "Vector {sin}, {cos};",
            f"far |= {program.name}_turns({{angle}}, &{{sin}}, &{{cos}});",
        ),
        language=replace(text.C, calls={**text.C.calls, "sqrt": "roots({})"}),
        shared=True,
    )


def _body(program: Program, suffix: str, style: _Style) -> Body:
    coefficients = series(program, suffix)
    loads = [
        f"const {style.real} {load.name} = {load.argument}[{load.index}];"
        for load in coefficients.loads
        if load.argument != "t"
    ]
    numbers = _numbers(coefficients.start)
    start = list(_start(style, coefficients.start, numbers))
    used = {load.argument for load in coefficients.loads}
    line = WIDEST * 8 // program.real.bits
    lines = max(1, -(-len(coefficients.slots) // line))
    order = _Order(coefficients, style)
    return Body(
        suffix=suffix,
        about=f"{len(coefficients.slots)} products",
        used=len(coefficients.slots),
        slots=lines * line,
        stride=(lines | 1) * line,
        turns=any(_is_turn(statement) for statement in coefficients.start),
        loads=tuple(loads),
        start=tuple(start),
        guards=tuple(
            (style.whole(g.value, numbers), text.number(g.tolerance), text.comment(g.name))
            for g in coefficients.guards
        ),
        first=tuple(_first(coefficients, style, numbers)),
        step=tuple(order.lines()),
        unused=tuple(name for name in "tupc" if name not in used),
        inputs=len(program.argument("u").names) if coefficients.inputs else 0,
        rates=len(coefficients.rates),
        reads=tuple(name for name in "upc" if name in used),
        time="t" in used,
        roots=any("roots(" in line for line in start),
        sides=tuple([*order.sides, *order.sides[-1:]][: len(order.sides) + len(order.sides) % 2]),
        rows=max(1, len(order.rows)),
    )


def _value(value: Expression, language: text.Language = text.C) -> str:
    return text.expression(value, language)


def _is_turn(statement: Statement) -> bool:
    return isinstance(statement.value, tuple) and statement.value[0] in ("sin", "cos")


def _numbers(statements: Sequence[Statement]) -> set[str]:
    """Values that are made of numbers alone, which are the same in all lanes; sines come as what
    others are."""
    numbers: set[str] = set()
    for statement in statements:
        if names_in(statement.value) <= numbers and not _is_turn(statement):
            numbers.add(statement.name)
    return numbers


def _start(style: _Style, statements: Sequence[Statement], numbers: Set[str]) -> Iterator[str]:
    """Values at the start of a step; a sine comes with its cosine."""
    k = 0
    while k < len(statements):
        statement = statements[k]
        if isinstance(statement.value, tuple) and _is_turn(statement):
            pair = {s.value[0]: s.name for s in statements[k : k + 2] if isinstance(s.value, tuple)}
            angle = style.whole(statement.value[1], numbers)
            sin, cos = pair["sin"], pair["cos"]
            yield from (line.format(angle=angle, sin=sin, cos=cos) for line in style.turn)
            k += 2
        else:
            same = statement.name in numbers
            value = _value(statement.value, text.C if same else style.language)
            yield f"const {'double' if same else style.real} {statement.name} = {value};"
            k += 1


def _first(made: Series, style: _Style, numbers: Set[str]) -> Iterator[str]:
    """Order 0."""
    for k, slot in enumerate(() if style.shared else made.slots):
        left = style.zero if slot.weighted else slot.left
        yield f"L[{k}] = {left}, R[{k}] = {slot.right};"
    for i, (rate, _) in enumerate(made.rates):
        yield f"out[ROW + {i}] = {style.whole(rate, numbers)};"


class _Order:
    """Lines of order n > 0. Coefficients have names of their own beside the values at the start,
    which are their factors."""

    def __init__(self, made: Series, style: _Style) -> None:
        self.made, self.style = made, style
        taken = {*(load.name for load in made.loads), *(s.name for s in made.start)}
        self._free = Names([*RESERVED, *TAKEN, *taken])
        self._names: dict[str, str] = {}
        # of the series that slots take, and whether times n
        self.rows: dict[tuple[str, bool], int] = {}
        self.sides = [
            (self._row(slot.left, slot.weighted), self._row(slot.right)) for slot in made.slots
        ]
        self.stores = self._shared_stores() if style.shared else self._stores()
        self.ready: dict[str | int, int] = {}  # cycles after which a coefficient is there

    def lines(self) -> Iterator[str]:
        """A coefficient goes to the slots that need it as soon as there is one."""
        yield from self._sums()
        if self.made.time:
            yield from self._put(self.made.time, self.style.number.format("n == 1 ? 1.0 : 0.0"))
        for name, i in self.made.states:
            yield from self._put(name, f"now[{i}]")
        for name, i in self.made.inputs:
            rate = f"rates_of_u[(n - 1) * INPUTS + {i}]"
            yield from self._put(name, f"n <= given ? {rate} : {self.style.zero}")
        for step in self.made.steps:
            value, self.ready[step.name] = self._sum(step.terms)
            if step.condition is not None:
                value = f"{_value(step.condition)} != 0.0 ? {value} : 0.0"
            yield from self._put(step.name, value)
        for i, (_, rate) in enumerate(self.made.rates):
            value = f"{self._name(rate)} * next" if isinstance(rate, str) else self.style.zero
            yield f"x_next[{i}] = now[{i}] = {value};"

    def _name(self, coefficient: str) -> str:
        if coefficient not in self._names:
            self._names[coefficient] = self._free(f"{coefficient}_n")
        return self._names[coefficient]

    def _put(self, coefficient: str, value: str) -> Iterator[str]:
        yield f"const {self.style.real} {self._name(coefficient)} = {value};"
        yield from self.stores.get(coefficient, ())

    def _stores(self) -> dict[str, list[str]]:
        """Where coefficients go."""
        stores: dict[str, list[str]] = {}
        for k, slot in enumerate(self.made.slots):
            left, right = self.made.coefficient(slot.left), self.made.coefficient(slot.right)
            weight = "order_n * " if slot.weighted else ""
            stores.setdefault(left, []).append(f"l[{k}] = {weight}{self._name(left)};")
            stores.setdefault(right, []).append(f"r[{k}] = {self._name(right)};")
        return stores

    def _row(self, name: str, weighted: bool = False) -> int:
        return self.rows.setdefault((self.made.coefficient(name), weighted), len(self.rows))

    def _shared_stores(self) -> dict[str, list[str]]:
        """Where coefficients go if each is kept once."""
        stores: dict[str, list[str]] = {}
        for (name, weighted), k in self.rows.items():
            weight = "order_n * " if weighted else ""
            stores.setdefault(name, []).append(f"newest[{k}] = {weight}{self._name(name)};")
        return stores

    def _sums(self) -> Iterator[str]:
        for k, slot in enumerate(self.made.slots):
            yield f"const {self.style.real} s{k} = S[{k}]{' * part' if slot.weighted else ''};"

    def _sum(self, terms: Sequence[Term]) -> tuple[str, int]:
        """Terms added one after the other as their coefficients get known, or in two such chains
        where that is sooner; and when it is done."""
        order = sorted(terms, key=self._time)
        one, two = self._chain(order), [self._chain(order[k::2]) for k in (0, 1)]
        both = max(time for _, time in two) + ADDED
        if len(terms) < 4 or one[1] <= both:
            return one
        return f"({two[0][0]}) + ({two[1][0]})", both

    def _time(self, term: Term) -> int:
        return self.ready.get(term.of, 0)

    def _chain(self, terms: Sequence[Term]) -> tuple[str, int]:
        line, time = "", 0
        for term in terms:
            of = f"s{term.of}" if isinstance(term.of, int) else self._name(term.of)
            factor = "" if term.factor == 1.0 else f"{_bracketed(term.factor)} * "
            plus = " + " if line else ""
            line += f"{plus if term.sign > 0 else ' - ' if line else '-'}{factor}{of}"
            time = max(time, self._time(term)) + ADDED
        return line, time


def _bracketed(factor: Expression) -> str:
    value = _value(factor)
    return f"({value})" if value.startswith("-") else value


TAYLOR = Target("taylor", "Taylor series of the solution in C", files)
