"""taylor: from a function to recurrences for the Taylor coefficients of all that it computes.

Along a solution every value is a power series in time, v = Σ vₙ sⁿ. Each operation gives vₙ from
coefficients of its operands up to n and of lower order of its own (R. E. Moore: Interval Analysis,
1966; A. Griewank, A. Walther: Evaluating Derivatives, 2008, table 13.2). Every operation that is
not linear needs one sum Σ lⱼ rₙ₋ⱼ over 0 < j < n of two known series, its *slot*. All sums of one
order depend on lower orders alone, so they are made together, side by side; what is left of an
order are the terms j = 0 and j = n.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from codegen.passes.names import RESERVED, Names
from codegen.program import Expression, Kernel, Load, Pivot, Program, Statement
from derive.diagnostics import AssumptionError

MOST_SLOTS = 1_400  # what a step keeps of them stands on the stack: at most half a megabyte
HIGHEST = 20  # order: what a tolerance of one unit of rounding asks for
PIECES = frozenset({
    "fabs", "sign", "floor", "ceil", "fmin", "fmax", "copysign", "fmod", "lt", "le", "eq", "ne",
    "and", "or", "not", "where",
})  # fmt: skip
FLAT = PIECES - {"fabs", "fmin", "fmax", "copysign", "fmod", "where"}  # constant, piece by piece
# What the code around the recurrences is called.
_TAKEN = [
    "L",
    "R",
    "S",
    "l",
    "r",
    "n",
    "i",
    "order",
    "order_n",
    "part",
    "next",
    "x_n",
    "x_next",
    "sums",
]
_PARTNERS = {"sin": "cos", "cos": "sin", "sinh": "cosh", "cosh": "sinh"}
_MOST_MULTIPLIED = 64  # whole powers up to this are products


class NoSeries(Exception):
    """An operation without recurrence, or a function that is too long; the message says which."""


@dataclass(frozen=True)
class Slot:
    """Σ lⱼ rₙ₋ⱼ, where lⱼ is that of `left`, times j where `weighted`."""

    left: str
    right: str
    weighted: bool = False


@dataclass(frozen=True)
class Step:
    """Coefficient n of `name`, with S the sum of slot `slot`, and l, r its first terms:

    linear: a · product: S + l b + a r · quotient: (S − a + b r) factor · root: (a − S) factor ·
    integral: S/n + a r · minus: minus that.
    """

    name: str
    rule: str
    a: Expression
    b: Expression = 0.0
    slot: int = -1
    factor: str = ""


@dataclass(frozen=True)
class Series:
    """`start` are the values at the start of a step, `steps` the coefficients n > 0 of those that
    have any, `rates` the derivative of the state (then of the work) at the start and in order n."""

    loads: tuple[Load, ...]
    start: tuple[Statement, ...]
    guards: tuple[Pivot, ...]
    steps: tuple[Step, ...]
    slots: tuple[Slot, ...]
    states: tuple[tuple[str, int], ...]  # local names of the state's entries
    time: str  # local name of t; empty where it does not occur
    coefficients: dict[str, Expression] = field(repr=False)
    rates: tuple[tuple[Expression, Expression], ...] = ()
    in_pieces: bool = False  # not analytic everywhere

    def coefficient(self, name: str) -> Expression:
        """Coefficient n of a value, where n > 0."""
        return self.coefficients.get(name, 0.0)


def suffixes(program: Program) -> tuple[str, ...]:
    """Of the functions of each chart of the program."""
    return tuple(chart.suffix for chart in program.charts) or ("",)


def series(program: Program, suffix: str = "") -> Series:
    """Recurrences of `dynamics`, and of `power` where there is one. Raises NoSeries."""
    known = {kernel.name: kernel for kernel in program.kernels}
    dynamics = known.get(f"dynamics{suffix}", known["dynamics"])
    hoisted = dynamics.hoisted
    alone = not program.charts and not program.frame
    tape = _Tape()
    rates = tape.read(hoisted.rest if hoisted and alone else dynamics)
    power = known.get(f"power{suffix}", known.get("power"))
    if power:
        rates += tape.read(power)
    if len(tape.slots) > MOST_SLOTS:
        raise NoSeries(f"{len(tape.slots)} products, more than the {MOST_SLOTS} that it can hold")
    return tape.made(rates)


def in_pieces(program: Program) -> bool:
    """Is any of the series not analytic everywhere?"""
    return any(series(program, suffix).in_pieces for suffix in suffixes(program))


def check_series(program: Program) -> None:
    """Refuse a program without recurrences. Raises AssumptionError."""
    try:
        for suffix in suffixes(program):
            series(program, suffix)
    except NoSeries as reason:
        raise AssumptionError(
            f"taylor does not fit {program.name}: its equations have {reason}",
            "the other explicit integrators fit every model; verner9 is for tight tolerances",
        ) from None


class _Tape:
    """Values at the start of a step and their coefficients, operation by operation. Equal
    operations are one."""

    def __init__(self) -> None:
        self.names = Names([*RESERVED, *_TAKEN])
        self.loads: dict[tuple[str, int], Load] = {}
        self.start: list[Statement] = []
        self.steps: list[Step] = []
        self.slots: dict[Slot, int] = {}
        self.coefficients: dict[str, Expression] = {}
        self.guards: list[Pivot] = []
        self.in_pieces = False
        self._places: dict[tuple[Expression, ...], Expression] = {}

    def made(self, rates: Sequence[Expression]) -> Series:
        states = tuple(
            (load.name, load.index) for load in self.loads.values() if load.argument == "x"
        )
        time = next((load.name for load in self.loads.values() if load.argument == "t"), "")
        return Series(
            loads=tuple(self.loads.values()),
            start=tuple(self.start),
            guards=tuple(self.guards),
            steps=tuple(self.steps),
            slots=tuple(self.slots),
            states=states,
            time=time,
            coefficients=self.coefficients,
            rates=tuple((rate, self.coefficient(rate)) for rate in rates),
            in_pieces=self.in_pieces,
        )

    def read(self, kernel: Kernel) -> list[Expression]:
        """The results of a function, all of whose statements are taken up."""
        local: dict[str, Expression] = {load.name: self._load(load) for load in kernel.loads}
        for section in kernel.sections:
            for statement in section.statements:
                local[statement.name] = self._value(statement.value, local, statement.name)
        for guard in kernel.guards:
            value = self._value(guard.value, local)
            self.guards.append(Pivot(guard.name, value, guard.tolerance, guard.limit, guard.part))
        return [self._value(output, local) for output in kernel.outputs]

    def coefficient(self, value: Expression) -> Expression:
        """Coefficient n > 0: 0.0 of what does not vary."""
        return self.coefficients.get(value, 0.0) if isinstance(value, str) else 0.0

    def varies(self, value: Expression) -> bool:
        return self.coefficient(value) != 0.0

    # ---- values at the start

    def _load(self, load: Load) -> str:
        key = load.argument, load.index
        if key not in self.loads:
            name = load.name if load.argument == "t" else self.names(load.name)
            self.loads[key] = Load(name, load.argument, load.index)
            if load.argument in ("t", "x"):
                self.coefficients[name] = name
        return self.loads[key].name

    def _value(
        self, value: Expression, local: dict[str, Expression], wanted: str = "z"
    ) -> Expression:
        if not isinstance(value, tuple):
            return local[value] if isinstance(value, str) else value
        name, *inside = value
        operands = [self._value(operand, local) for operand in inside]
        return self.put(str(name), *operands, wanted=wanted)

    def put(self, operation: str, *operands: Expression, wanted: str = "z") -> Expression:
        """The value of an operation, with its coefficients."""
        if operation in ("add", "mul"):
            operands = tuple(sorted(operands, key=str))
        key = (operation, *operands)
        if key not in self._places:
            self._places[key] = self._new(operation, operands, wanted)
        return self._places[key]

    def _new(self, operation: str, operands: Sequence[Expression], wanted: str) -> Expression:
        name = self.begin((operation, *operands), wanted)
        if any(map(self.varies, operands)):
            self.in_pieces = self.in_pieces or operation in PIECES
            if operation not in FLAT:
                self._rule(operation)(self, name, *operands)
        return name

    def _rule(self, operation: str) -> Callable[..., None]:
        rule = _RULES.get(operation)
        if rule is None:
            raise NoSeries(f"the operation {operation}, which has no recurrence")
        return rule

    def begin(self, value: Expression, wanted: str = "z") -> str:
        """A new local with its value at the start."""
        name = self.names(wanted)
        self.start.append(Statement(name, value))
        return name

    # ---- coefficients

    def slot(self, left: Expression, right: Expression, weighted: bool = False) -> int:
        """The number of the sum over two series."""
        made = Slot(str(left), str(right), weighted)
        return self.slots.setdefault(made, len(self.slots))

    def grow(
        self, name: str, rule: str, a: Expression, b: Expression = 0.0, slot: int = -1,
        factor: str = "",
    ) -> None:  # fmt: skip
        """`name` gets its coefficients by a rule."""
        self.coefficients[name] = name
        self.steps.append(Step(name, rule, a, b, slot, factor))

    def linear(self, name: str, value: Expression) -> None:
        """One that is another's, or a sum or multiple of others'."""
        if isinstance(value, str):
            self.coefficients[name] = value
        else:
            self.grow(name, "linear", value)

    def add(self, name: str, a: Expression, b: Expression) -> None:
        terms = [x for x in (self.coefficient(a), self.coefficient(b)) if x != 0.0]
        self.linear(name, terms[0] if len(terms) == 1 else ("add", *terms))

    def sub(self, name: str, a: Expression, b: Expression) -> None:
        if not self.varies(a):
            self.neg(name, b)
        elif not self.varies(b):
            self.linear(name, self.coefficient(a))
        else:
            self.linear(name, ("sub", self.coefficient(a), self.coefficient(b)))

    def neg(self, name: str, a: Expression) -> None:
        self.linear(name, ("neg", self.coefficient(a)))

    def mul(self, name: str, a: Expression, b: Expression) -> None:
        if not (self.varies(a) and self.varies(b)):
            constant, other = (b, a) if self.varies(a) else (a, b)
            self.linear(name, ("mul", constant, self.coefficient(other)))
        else:
            slot = self.slot(a, b)
            self.grow(name, "product", self.coefficient(a), self.coefficient(b), slot)

    def div(self, name: str, a: Expression, b: Expression) -> None:
        if not self.varies(b):
            inverse = self.begin(("div", 1.0, b))
            self.linear(name, ("mul", inverse, self.coefficient(a)))
            return
        inverse = self.begin(("div", -1.0, b))
        slot = self.slot(b, name)
        self.grow(name, "quotient", self.coefficient(a), self.coefficient(b), slot, inverse)

    def sqrt(self, name: str, a: Expression) -> None:
        half = self.begin(("div", 0.5, name))
        self.grow(name, "root", self.coefficient(a), slot=self.slot(name, name), factor=half)

    def integral(self, name: str, slope: Expression, a: Expression, rule: str = "integral") -> None:
        """name' = slope · a'; the slope may be one that gets its own coefficients later."""
        slot = self.slot(a, slope, True)
        self.grow(name, rule, self.coefficient(a), slot=slot)

    def exp(self, name: str, a: Expression) -> None:
        self.integral(name, name, a)

    def expm1(self, name: str, a: Expression) -> None:
        self.integral(name, self.put("exp", a), a)

    def log(self, name: str, a: Expression) -> None:
        self.integral(name, self.put("div", 1.0, a), a)

    def log1p(self, name: str, a: Expression) -> None:
        self.integral(name, self.put("div", 1.0, self.put("add", 1.0, a)), a)

    def _pair(self, name: str, operation: str, a: Expression) -> None:
        """Sine and cosine, hyperbolic or not: each is the slope of the other, or minus that."""
        partner = _PARTNERS[operation]
        other = self.begin((partner, a))
        self._places[partner, a] = other
        sine, cosine = (name, other) if operation.startswith("sin") else (other, name)
        self.integral(sine, cosine, a)
        self.integral(cosine, sine, a, "integral" if operation.endswith("h") else "minus")

    def sin(self, name: str, a: Expression) -> None:
        self._pair(name, "sin", a)

    def cos(self, name: str, a: Expression) -> None:
        self._pair(name, "cos", a)

    def sinh(self, name: str, a: Expression) -> None:
        self._pair(name, "sinh", a)

    def cosh(self, name: str, a: Expression) -> None:
        self._pair(name, "cosh", a)

    def tan(self, name: str, a: Expression) -> None:
        self._by_square(name, a, "add")

    def tanh(self, name: str, a: Expression) -> None:
        self._by_square(name, a, "sub")

    def _by_square(self, name: str, a: Expression, sign: str) -> None:
        """name' = (1 ± name²) a': the slope's coefficients follow those of the name."""
        square = self.begin(("mul", name, name))
        slope = self.begin((sign, 1.0, square))
        self.integral(name, slope, a)
        self.mul(square, name, name)
        self.linear(slope, square if sign == "add" else ("neg", square))

    def _over_root(self, name: str, a: Expression, under: Expression, above: float = 1.0) -> None:
        self.integral(name, self.put("div", above, self.put("sqrt", under)), a)

    def _square(self, a: Expression) -> Expression:
        return self.put("mul", a, a)

    def asin(self, name: str, a: Expression) -> None:
        self._over_root(name, a, self.put("sub", 1.0, self._square(a)))

    def acos(self, name: str, a: Expression) -> None:
        self._over_root(name, a, self.put("sub", 1.0, self._square(a)), -1.0)

    def asinh(self, name: str, a: Expression) -> None:
        self._over_root(name, a, self.put("add", 1.0, self._square(a)))

    def acosh(self, name: str, a: Expression) -> None:
        self._over_root(name, a, self.put("sub", self._square(a), 1.0))

    def atan(self, name: str, a: Expression) -> None:
        self.integral(name, self.put("div", 1.0, self.put("add", 1.0, self._square(a))), a)

    def atanh(self, name: str, a: Expression) -> None:
        self.integral(name, self.put("div", 1.0, self.put("sub", 1.0, self._square(a))), a)

    def erf(self, name: str, a: Expression) -> None:
        bell = self.put("exp", self.put("neg", self._square(a)))
        self.integral(name, self.put("mul", 2.0 / math.sqrt(math.pi), bell), a)

    def atan2(self, name: str, y: Expression, x: Expression) -> None:
        """(x y' − y x')/(x² + y²)."""
        size = self.put("add", self._square(x), self._square(y))
        by_y, by_x = self.put("div", x, size), self.put("div", y, size)
        self.sub(name, self._along(by_y, y), self._along(by_x, x))

    def _along(self, part: Expression, along: Expression) -> Expression:
        """∫ part d(along) from zero."""
        if not self.varies(along):
            return 0.0
        total = self.begin(0.0)
        self.integral(total, part, along)
        return total

    def hypot(self, name: str, a: Expression, b: Expression) -> None:
        self.sqrt(name, self.put("add", self._square(a), self._square(b)))

    def pow(self, name: str, a: Expression, b: Expression) -> None:
        if isinstance(b, float) and b.is_integer() and 0 < abs(b) <= _MOST_MULTIPLIED:
            whole = self._whole_power(a, round(abs(b)))
            self.linear(name, self.coefficient(whole if b > 0 else self.put("div", 1.0, whole)))
        elif not self.varies(b):
            over = self.begin(("div", name, a))
            slope = self.begin(("mul", b, over))
            self.integral(name, slope, a)
            self.div(over, name, a)
            self.mul(slope, b, over)
        else:
            exponent = self.put("mul", b, self.put("log", a))
            self.integral(name, name, exponent)

    def _whole_power(self, a: Expression, n: int) -> Expression:
        if n == 1:
            return a
        half = self._whole_power(a, n // 2)
        square = self.put("mul", half, half)
        return self.put("mul", square, a) if n % 2 else square

    # ---- in pieces: as it is at the start of the step

    def fabs(self, name: str, a: Expression) -> None:
        sign = self.begin(("copysign", 1.0, a))
        self.linear(name, ("mul", sign, self.coefficient(a)))

    def copysign(self, name: str, a: Expression, b: Expression) -> None:
        sign = self.begin(("mul", ("copysign", 1.0, a), ("copysign", 1.0, b)))
        if self.varies(a):
            self.linear(name, ("mul", sign, self.coefficient(a)))

    def where(self, name: str, condition: Expression, a: Expression) -> None:
        if self.varies(a):
            self.linear(name, ("where", condition, self.coefficient(a)))

    def fmin(self, name: str, a: Expression, b: Expression) -> None:
        self._either(name, self.begin(("le", a, b)), a, b)

    def fmax(self, name: str, a: Expression, b: Expression) -> None:
        self._either(name, self.begin(("le", b, a)), a, b)

    def _either(self, name: str, first: str, a: Expression, b: Expression) -> None:
        second = self.begin(("not", first))
        terms = [
            ("where", condition, self.coefficient(value))
            for condition, value in ((first, a), (second, b))
            if self.varies(value)
        ]
        self.linear(name, terms[0] if len(terms) == 1 else ("add", *terms))

    def fmod(self, name: str, a: Expression, b: Expression) -> None:
        whole = self.begin(("div", ("sub", a, name), b))
        if not self.varies(b):
            self.linear(name, self.coefficient(a))
            return
        multiple = ("mul", whole, self.coefficient(b))
        varying = ("sub", self.coefficient(a), multiple)
        self.linear(name, varying if self.varies(a) else ("neg", multiple))


_RULES: dict[str, Callable[..., None]] = {
    rule.__name__: rule
    for rule in (
        _Tape.add, _Tape.sub, _Tape.neg, _Tape.mul, _Tape.div, _Tape.sqrt, _Tape.pow, _Tape.hypot,
        _Tape.exp, _Tape.expm1, _Tape.log, _Tape.log1p, _Tape.erf, _Tape.sin, _Tape.cos, _Tape.tan,
        _Tape.asin, _Tape.acos, _Tape.atan, _Tape.atan2, _Tape.sinh, _Tape.cosh, _Tape.tanh,
        _Tape.asinh, _Tape.acosh, _Tape.atanh, _Tape.fabs, _Tape.copysign, _Tape.where, _Tape.fmin,
        _Tape.fmax, _Tape.fmod,
    )
}  # fmt: skip


def histories(made: Series) -> Iterator[tuple[int, Slot, Expression, Expression]]:
    """Of each slot what it keeps of order n: a coefficient on the left and one on the right."""
    for number, slot in enumerate(made.slots):
        yield number, slot, made.coefficient(slot.left), made.coefficient(slot.right)
