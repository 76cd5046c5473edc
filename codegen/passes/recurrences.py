"""The recurrences of each operation: how coefficient n of its result follows from its operands'."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from codegen.passes.names import RESERVED, Names
from codegen.passes.series import NoSeries, Slot, Step, Term
from codegen.program import Expression, Kernel, Load, Pivot, Statement

PIECES = frozenset({
    "fabs", "sign", "floor", "ceil", "fmin", "fmax", "copysign", "fmod", "lt", "le", "eq", "ne",
    "and", "or", "not", "where",
})  # fmt: skip
FLAT = PIECES - {"fabs", "fmin", "fmax", "copysign", "fmod", "where"}  # constant, piece by piece
# What the code around the recurrences is called.
TAKEN = [
    *("L", "R", "S", "l", "r", "n", "i", "order", "order_n", "part", "next", "now", "x_next"),
    *("sums", "late", "early", "rates_of_u", "given", "INPUTS", "ZERO", "room", "lane", "far"),
    *("history", "newest"),
]
_PARTNERS = {"sin": "cos", "cos": "sin", "sinh": "cosh", "cosh": "sinh"}
_MOST_MULTIPLIED = 64  # whole powers up to this are products


class Recurrences:
    """Values at the start of a step and their coefficients, operation by operation. Equal
    operations are one."""

    def __init__(self) -> None:
        self.names = Names([*RESERVED, *TAKEN])
        self.loads: dict[tuple[str, int], Load] = {}
        self.start: list[Statement] = []
        self.steps: list[Step] = []
        self.slots: dict[Slot, int] = {}
        self.coefficients: dict[str, str] = {}
        self.guards: list[Pivot] = []
        self.in_pieces = False
        self._places: dict[tuple[Expression, ...], Expression] = {}
        self._held: dict[tuple[Expression, ...], str] = {}

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
        """Parameters, numbers and what is made of them alone have no coefficients n > 0."""
        return self.coefficient(value) != 0.0

    # ---- values at the start

    def _load(self, load: Load) -> str:
        key = load.argument, load.index
        if key not in self.loads:
            name = load.name if load.argument == "t" else self.names(load.name)
            self.loads[key] = Load(name, load.argument, load.index)
            if load.argument in ("t", "x", "u"):
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
            # a comparison or a whole number is the same all along a step, as long as no piece ends
            if operation not in FLAT:
                self._rule(operation)(self, name, *operands)
        elif operation in ("sin", "cos"):  # they are written together, of a parameter too
            self._partner(operation, operands[0])
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

    def held(self, operation: str, *operands: Expression) -> str:
        """A value at the start that is needed as a factor; nobody asks for its coefficients."""
        key = (operation, *operands)
        if key not in self._held:
            self._held[key] = self.begin(key)
        return self._held[key]

    # ---- coefficients

    def slot(self, left: Expression, right: Expression, weighted: bool = False) -> int:
        """The number of the sum over two series."""
        slot = Slot(str(left), str(right), weighted)
        return self.slots.setdefault(slot, len(self.slots))

    def term(self, value: Expression, factor: Expression = 1.0, sign: int = 1) -> list[Term]:
        """Of coefficient n of a value, if it has any."""
        of = self.coefficient(value)
        return [Term(of, factor, sign)] if isinstance(of, str) else []

    def grow(self, name: str, *terms: Term, condition: Expression | None = None) -> None:
        """`name` gets its coefficients: those of another where there is nothing to compute."""
        alone = len(terms) == 1 and condition is None and terms[0] == Term(terms[0].of)
        if alone and isinstance(terms[0].of, str):
            self.coefficients[name] = terms[0].of
        elif terms:
            self.coefficients[name] = name
            self.steps.append(Step(name, terms, condition))

    def add(self, name: str, a: Expression, b: Expression) -> None:
        """zₙ = aₙ + bₙ."""
        self.grow(name, *self.term(a), *self.term(b))

    def sub(self, name: str, a: Expression, b: Expression) -> None:
        """zₙ = aₙ − bₙ."""
        self.grow(name, *self.term(a), *self.term(b, sign=-1))

    def neg(self, name: str, a: Expression) -> None:
        """zₙ = −aₙ."""
        self.grow(name, *self.term(a, sign=-1))

    def mul(self, name: str, a: Expression, b: Expression) -> None:
        """zₙ = S + aₙ b₀ + a₀ bₙ with S = Σ aⱼ bₙ₋ⱼ over 0 < j < n; no S where one of them does not
        vary, and S + 2 a₀ aₙ of a square."""
        if not (self.varies(a) and self.varies(b)):
            self.grow(name, *self.term(a, b), *self.term(b, a))
            return
        slot = Term(self.slot(a, b))
        if a == b:
            self.grow(name, slot, *self.term(a, self.held("mul", 2.0, a)))
        else:
            self.grow(name, slot, *self.term(a, b), *self.term(b, a))

    def div(self, name: str, a: Expression, b: Expression) -> None:
        """b q = a: q_n b_0 = a_n − S − b_n q_0."""
        inverse = name if a == 1.0 else self.held("div", 1.0, b)
        if not self.varies(b):
            self.grow(name, *self.term(a, inverse))
            return
        slot = Term(self.slot(b, name), inverse, -1)
        ratio = self.held("mul", name, inverse)
        self.grow(name, slot, *self.term(a, inverse), *self.term(b, ratio, -1))

    def sqrt(self, name: str, a: Expression) -> None:
        """r² = a: 2 r_n r_0 = a_n − S."""
        half = self.held("div", 0.5, name)
        self.grow(name, Term(self.slot(name, name), half, -1), *self.term(a, half))

    def integral(self, name: str, slope: Expression, a: Expression, sign: int = 1) -> None:
        """z' = ± slope · a', hence zₙ = ± (Σ j aⱼ slopeₙ₋ⱼ / n + aₙ slope₀), the sum over 0 < j <
        n. It asks for coefficients of the slope below n, so that the slope may be made of z
        itself."""
        slot = Term(self.slot(a, slope, True), 1.0, sign)
        self.grow(name, slot, *self.term(a, slope, sign))

    def exp(self, name: str, a: Expression) -> None:
        """z' = z a', the slope being the result itself."""
        self.integral(name, name, a)

    def expm1(self, name: str, a: Expression) -> None:
        """z' = exp(a) a': exp(a) and not 1 + z, which cancels where a is very negative."""
        self.integral(name, self.put("exp", a), a)

    def log(self, name: str, a: Expression) -> None:
        """z' = a'/a."""
        self.integral(name, self.put("div", 1.0, a), a)

    def log1p(self, name: str, a: Expression) -> None:
        """z' = a'/(1 + a)."""
        self.integral(name, self.put("div", 1.0, self.put("add", 1.0, a)), a)

    def _partner(self, operation: str, a: Expression) -> str:
        partner = _PARTNERS[operation]
        self._places[partner, a] = other = self.begin((partner, a))
        return other

    def _pair(self, name: str, operation: str, a: Expression) -> None:
        """Sine and cosine, hyperbolic or not: each is the slope of the other, or minus that."""
        other = self._partner(operation, a)
        sine, cosine = (name, other) if operation.startswith("sin") else (other, name)
        self.integral(sine, cosine, a)
        self.integral(cosine, sine, a, 1 if operation.endswith("h") else -1)

    def sin(self, name: str, a: Expression) -> None:
        """z' = cos(a) a'; the cosine comes along, for each is the other's slope."""
        self._pair(name, "sin", a)

    def cos(self, name: str, a: Expression) -> None:
        """z' = −sin(a) a', together with the sine."""
        self._pair(name, "cos", a)

    def sinh(self, name: str, a: Expression) -> None:
        """z' = cosh(a) a', together with it."""
        self._pair(name, "sinh", a)

    def cosh(self, name: str, a: Expression) -> None:
        """z' = sinh(a) a', together with it."""
        self._pair(name, "cosh", a)

    def tan(self, name: str, a: Expression) -> None:
        """z' = (1 + z²) a'."""
        self._by_square(name, a, "add")

    def tanh(self, name: str, a: Expression) -> None:
        """z' = (1 − z²) a'."""
        self._by_square(name, a, "sub")

    def _by_square(self, name: str, a: Expression, sign: str) -> None:
        """name' = (1 ± name²) a': the slope's coefficients follow those of the name."""
        square = self.begin(("mul", name, name))
        slope = self.begin((sign, 1.0, square))
        self.integral(name, slope, a)
        self.mul(square, name, name)
        self.grow(slope, *self.term(square, sign=1 if sign == "add" else -1))

    def _over_root(self, name: str, a: Expression, under: Expression, above: float = 1.0) -> None:
        self.integral(name, self.put("div", above, self.put("sqrt", under)), a)

    def _square(self, a: Expression) -> Expression:
        return self.put("mul", a, a)

    def asin(self, name: str, a: Expression) -> None:
        """z' = a'/√(1 − a²)."""
        self._over_root(name, a, self.put("sub", 1.0, self._square(a)))

    def acos(self, name: str, a: Expression) -> None:
        """z' = −a'/√(1 − a²)."""
        self._over_root(name, a, self.put("sub", 1.0, self._square(a)), -1.0)

    def asinh(self, name: str, a: Expression) -> None:
        """z' = a'/√(1 + a²)."""
        self._over_root(name, a, self.put("add", 1.0, self._square(a)))

    def acosh(self, name: str, a: Expression) -> None:
        """z' = a'/√(a² − 1)."""
        self._over_root(name, a, self.put("sub", self._square(a), 1.0))

    def atan(self, name: str, a: Expression) -> None:
        """z' = a'/(1 + a²)."""
        self.integral(name, self.put("div", 1.0, self.put("add", 1.0, self._square(a))), a)

    def atanh(self, name: str, a: Expression) -> None:
        """z' = a'/(1 − a²)."""
        self.integral(name, self.put("div", 1.0, self.put("sub", 1.0, self._square(a))), a)

    def erf(self, name: str, a: Expression) -> None:
        """z' = 2/√π exp(−a²) a'."""
        bell = self.put("exp", self.put("neg", self._square(a)))
        self.integral(name, self.put("mul", 2.0 / math.sqrt(math.pi), bell), a)

    def atan2(self, name: str, y: Expression, x: Expression) -> None:
        """(x y' − y x')/(x² + y²)."""
        size = self.put("add", self._square(x), self._square(y))
        parts: list[Expression] = []
        for part, along in ((self.put("div", x, size), y), (self.put("div", y, size), x)):
            if self.varies(along):
                total = self.begin(0.0)
                self.integral(total, part, along)
                parts.append(total)
            else:
                parts.append(0.0)
        self.sub(name, parts[0], parts[1])

    def hypot(self, name: str, a: Expression, b: Expression) -> None:
        """z² = a² + b², by the recurrence of the square root."""
        self.sqrt(name, self.put("add", self._square(a), self._square(b)))

    def pow(self, name: str, a: Expression, b: Expression) -> None:
        """Products of a small whole power; z' = (b z/a) a' of a constant exponent; else z' = z (b
        log a)'."""
        if isinstance(b, float) and b.is_integer() and 0 < abs(b) <= _MOST_MULTIPLIED:
            whole = self._whole_power(a, round(abs(b)))
            self.grow(name, *self.term(whole if b > 0 else self.put("div", 1.0, whole)))
        elif not self.varies(b):
            # values first: the coefficients of the slope follow those of the power, which it is
            # made of
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
        """zₙ = ± aₙ with the sign that a has at the start of the step."""
        self.grow(name, *self.term(a, self.begin(("copysign", 1.0, a))))

    def copysign(self, name: str, a: Expression, b: Expression) -> None:
        """zₙ = ± aₙ: + where a and b have the same sign at the start of the step."""
        sign = self.begin(("mul", ("copysign", 1.0, a), ("copysign", 1.0, b)))
        self.grow(name, *self.term(a, sign))

    def where(self, name: str, condition: Expression, a: Expression) -> None:
        """zₙ = aₙ where the condition holds at the start of the step, else 0."""
        self.grow(name, *self.term(a), condition=condition)

    def fmin(self, name: str, a: Expression, b: Expression) -> None:
        """The coefficients of the one that is less at the start of the step."""
        self._either(name, ("le", a, b), a, b)

    def fmax(self, name: str, a: Expression, b: Expression) -> None:
        """The coefficients of the one that is greater at the start of the step."""
        self._either(name, ("le", b, a), a, b)

    def _either(self, name: str, holds: Expression, a: Expression, b: Expression) -> None:
        first = self.begin(holds)
        second = self.begin(("not", first))
        one, other = self.put("where", first, a), self.put("where", second, b)
        self.grow(name, *self.term(one), *self.term(other))

    def fmod(self, name: str, a: Expression, b: Expression) -> None:
        """zₙ = aₙ − k bₙ with k = (a₀ − z₀)/b₀, the whole number taken off at the start."""
        whole = self.begin(("div", ("sub", a, name), b))
        self.grow(name, *self.term(a), *self.term(b, whole, -1))


_RULES: dict[str, Callable[..., None]] = {
    name: getattr(Recurrences, name)
    for name in (
        "add", "sub", "neg", "mul", "div", "sqrt", "pow", "hypot", "exp", "expm1", "log",
        "log1p", "erf", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh",
        "cosh", "tanh", "asinh", "acosh", "atanh", "fabs", "copysign", "where", "fmin",
        "fmax", "fmod",
    )
}  # fmt: skip
