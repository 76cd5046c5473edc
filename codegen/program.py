"""The Program record: what the generated module computes, statement by statement, in no particular
language.

An expression is a local name (str), a number (float) or a tuple (operation, operand, …) of
expressions. The operations are add, sub, mul, div, neg and the calls listed in
`codegen.passes.graph.CALLS`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TypeAlias

from codegen.reals import FLOAT64, Real

Expression: TypeAlias = "str | float | tuple[str, *tuple[Expression, ...]]"

OK, SINGULAR, NOT_CONVERGED, NOT_FINITE = range(4)
STATUS = ("ok", "singular", "not_converged", "not_finite")
# What `simulate` calls, where the module has it.
CALLED = (
    "dynamics",
    "power",
    "project",
    "constraints",
    "guards",
    "closure",
    "slip",
    "manifold",
    "jacobian",
    "jacobian_t",
    "events",
)
KINDS = ("add", "multiply", "divide", "sqrt", "sin", "cos", "other")


@dataclass(frozen=True)
class Argument:
    """An argument slot t, x, u or p. `names` are identifiers made from the labels; `defaults` are
    given for p alone."""

    name: str
    labels: tuple[str, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    defaults: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Statement:
    """`name` = `value`; every name is assigned once."""

    name: str
    value: Expression


@dataclass(frozen=True)
class Section:
    """Statements under one heading, such as "M: joint-space mass matrix"."""

    title: str
    statements: tuple[Statement, ...]


@dataclass(frozen=True)
class Load:
    """The local `name` stands for entry `index` of argument `argument`."""

    name: str
    argument: str
    index: int


@dataclass(frozen=True)
class Pivot:
    """|value| < tolerance makes the function return SINGULAR.

    `value` is computed up to a constant; for the quantity called `name` the bound is `limit`, a
    `part` of its usual size.
    """

    name: str
    value: Expression
    tolerance: float
    limit: float
    part: float = field(default=1e-9, repr=False)


@dataclass(frozen=True)
class Loop:
    """Repeat with the result as the new x until `residual` ≤ tolerance, at most `most` times."""

    tolerance: float
    most: int
    residual: Expression


@dataclass(frozen=True)
class Pattern:
    """Where the outputs stand in the matrix of that shape, which is zero elsewhere."""

    shape: tuple[int, int]
    rows: tuple[int, ...]
    columns: tuple[int, ...]


@dataclass(frozen=True)
class Solving:
    """A symmetric system solved in a loop over columns, after all statements: see
    derive.formulations.records.Elimination. `values` are computed with the outputs, which hold the
    right-hand sides."""

    size: int
    order: tuple[int, ...]
    pairs: tuple[tuple[int, int], ...]
    values: tuple[Expression, ...]
    first: int
    ranges: tuple[tuple[int, int], ...]
    places: tuple[int, ...]

    @property
    def starts(self) -> tuple[int, ...]:
        """Where the pairs of each unknown begin, in order, and where all end."""
        counts = [sum(k == one for _, k in self.pairs) for one in self.order]
        return tuple(sum(counts[:i]) for i in range(len(counts) + 1))

    @property
    def gathered(self) -> tuple[tuple[int, int], ...]:
        """(number of the pair, k) of what each unknown gets on the way there, in order."""
        return tuple(
            (number, k)
            for one in self.order
            for number, (i, k) in enumerate(self.pairs)
            if i == one
        )

    @property
    def begins(self) -> tuple[int, ...]:
        """Where those of each unknown begin, in order, and where all end."""
        counts = [sum(i == one for i, _ in self.pairs) for one in self.order]
        return tuple(sum(counts[:i]) for i in range(len(counts) + 1))

    @property
    def operations(self) -> dict[str, int]:
        """Of the loop."""
        columns = sum(end - begin for begin, end in self.ranges)
        each = 2 * len(self.pairs) * columns
        return {"add": each + len(self.places), "multiply": each + len(self.order) * columns}


@dataclass(frozen=True)
class Kernel:
    """One generated function. `outputs` are the entries of the result, row-major; `shape` is (n,)
    or (r, c)."""

    name: str
    about: str
    result: str
    shape: tuple[int, ...]
    labels: tuple[str, ...]
    units: tuple[str, ...]
    x: Argument  # the state, or what stands in its place for this function
    uses: tuple[str, ...]  # which of t, x, u, p occur
    loads: tuple[Load, ...]
    sections: tuple[Section, ...]
    outputs: tuple[Expression, ...]
    guards: tuple[Pivot, ...]
    loop: Loop | None
    watched: tuple[
        tuple[str, int], ...
    ]  # entries of arguments that have to be finite and do not show in a result if not
    results: tuple[
        int, ...
    ]  # the outputs that have to be finite; the others are arguments or constants
    operations: Mapping[str, int]  # of each kind and "total"
    hoisted: Hoisted | None = None
    pattern: Pattern | None = None  # of a result that holds the values of a sparse matrix
    # what is done to the outputs at the end
    solving: Solving | None = field(default=None, repr=False)

    @property
    def computed(self) -> tuple[Expression, ...]:
        """The outputs, and what solving takes besides."""
        return (*self.outputs, *(self.solving.values if self.solving else ()))

    @property
    def singular(self) -> str:
        """What status SINGULAR means here, in words."""
        return "singular: " + " or ".join(
            f"|{guard.name}| < {guard.limit:g}" for guard in self.guards
        )

    @property
    def not_converged(self) -> str:
        """What status NOT_CONVERGED means here, in words."""
        return (
            f"not converged to {self.loop.tolerance:g} in {self.loop.most} steps"
            if self.loop
            else "not converged"
        )


@dataclass(frozen=True)
class Stepper:
    """A loop of the runtime around kernels, offered like one: `kernel` takes (x, h) and goes one
    explicit step; `row` takes (x, h, method, substeps), and has the estimate of the error and a
    status behind its result. Neither has statements."""

    kernel: Kernel
    row: Kernel
    chart: int  # of which choice

    @property
    def sensitive(self) -> bool:
        """Does it give the derivatives of the step?"""
        return len(self.kernel.shape) > 1


@dataclass(frozen=True)
class Hoisted:
    """A kernel in two: `precompute` makes c from p, `rest` the result from t, x, u and c."""

    precompute: Kernel
    rest: Kernel


@dataclass(frozen=True)
class Chart:
    """One of several choices in a module: its functions are called NAME`suffix` where they differ
    from those of the first."""

    choice: str
    suffix: str  # none for the first
    quasi_velocities: tuple[str, ...]
    largest: tuple[float, ...]  # what is called the whole of each entry of `guards`


@dataclass(frozen=True)
class Event:
    """An entry of the function `events` whose sign `simulate` watches: `direction` is that of the
    change, 0 for both; `stop` ends the motion."""

    name: str
    direction: int
    stop: bool


@dataclass(frozen=True)
class Entry:
    """A line of the ledger: what one pass did to one function."""

    function: str
    step: str
    before: int
    after: int


@dataclass(frozen=True)
class Program:
    name: str
    description: str
    formulation: str
    choice: str
    reason: str
    pivots: tuple[str, ...]
    quasi_velocities: tuple[str, ...]
    assumptions: tuple[str, ...]
    constants: tuple[str, ...]  # parameters that were baked in
    arguments: tuple[Argument, ...]
    kernels: tuple[Kernel, ...]
    ledger: tuple[Entry, ...] = ()
    left_out: tuple[str, ...] = ()  # functions and arguments this model has no use for
    fixed: tuple[
        tuple[str, float], ...
    ] = ()  # inputs and parameters that were given a value and baked in
    positions: int = 0  # leading rows of `constraints` that are position constraints
    nominal: tuple[float, ...] = field(
        default=(), repr=False
    )  # the model's initial state, for examples; any when empty
    inline: bool = False  # also as one header of inline functions
    flags: tuple[str, ...] = ()  # for the compiler, besides those it always gets
    timings: tuple[
        tuple[str, float], ...
    ] = ()  # what tuning compared: nanoseconds of `dynamics` per state
    integrators: tuple[str, ...] = ()  # of `simulate`, the default first
    enforcements: tuple[
        str, ...
    ] = ()  # how `simulate` may stay on the constraints, the default first
    charts: tuple[Chart, ...] = field(default=(), repr=False)  # all of them where there are several
    turning: tuple[int, ...] = field(
        default=(), repr=False
    )  # coordinates whose whole turns nothing in `simulate` sees
    events: tuple[Event, ...] = field(default=(), repr=False)  # what `simulate` looks for
    steppers: tuple[Stepper, ...] = field(default=(), repr=False)  # loops that were asked for
    frame: int = field(default=0, repr=False)  # last entries of p: directions that are based anew
    real: Real = field(default=FLOAT64, repr=False)  # what it computes in
    targets: tuple[str, ...] = field(default=(), repr=False)  # on request, besides those of all
    states: tuple[str, ...] = field(default=(), repr=False)  # first-order states, the last of x

    @property
    def fingerprint(self) -> str:
        """Tells programs apart: the same text for the same program on every machine."""
        solving = [kernel.solving for kernel in self.kernels if kernel.solving]
        further = (self.charts, self.turning, self.frame, self.events, self.steppers, solving)
        further = (*further, self.states)
        several = "".join(repr(more) for more in further if more)
        return hashlib.sha256(
            f"{replace(self, timings=())!r}{several}{self.real.suffix}".encode()
        ).hexdigest()[:32]

    @property
    def coordinates(self) -> int:
        """How many of the leading entries of x are coordinates."""
        behind = len(self.quasi_velocities) + len(self.states)
        return len(self.argument("x").names) - behind

    @property
    def simulates(self) -> bool:
        """Is there a state derivative to integrate?"""
        length = len(self.argument("x").names)
        return self.has("dynamics") and self.kernel("dynamics").shape == (length,)

    @property
    def offered(self) -> tuple[Kernel, ...]:
        """What a user can call: the kernels and the loops around them."""
        return (*self.kernels, *(stepper.kernel for stepper in self.steppers))

    @property
    def bound(self) -> tuple[Kernel, ...]:
        """What bindings hold."""
        return (*self.offered, *(stepper.row for stepper in self.steppers))

    def argument(self, name: str) -> Argument:
        """The argument slot called `name`. Raises KeyError where there is none."""
        return {argument.name: argument for argument in self.arguments}[name]

    def has(self, name: str) -> bool:
        """Whether there is a function of that name."""
        return any(kernel.name == name for kernel in self.kernels)

    def kernel(self, name: str) -> Kernel:
        """The function called `name`. Raises KeyError where there is none."""
        return {kernel.name: kernel for kernel in self.kernels}[name]

    def in_chart(self, name: str, suffix: str) -> Kernel | None:
        """The function as a chart has it: its own, else that of all charts; None without either."""
        own = f"{name}{suffix}"
        if self.has(own):
            return self.kernel(own)
        return self.kernel(name) if self.has(name) else None
