"""The Program record: what the generated module computes, statement by statement, in no particular
language.

An expression is a local name (str), a number (float) or a tuple (operation, operand, …) of
expressions. The operations are add, sub, mul, div, neg and the calls listed in
`codegen.passes.rewriting.graph.CALLS`.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import accumulate
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
    "kinks",
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
    part: float = field(repr=False)


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
class Visit:
    """What a sweep does at one link. Loads are of the link's constants "k", of its row "r", of what
    it receives "e", of entries of arguments by the name of the read, and of t.

    `kept` goes to entries of the row, `handed` to the next link, `results` to entries of the result
    by the name of the index.
    """

    loads: tuple[Load, ...]
    sections: tuple[Section, ...]
    kept: tuple[tuple[int, Expression], ...]
    handed: tuple[Expression, ...]
    results: tuple[tuple[str, Expression], ...]
    operations: Mapping[str, int]


@dataclass(frozen=True)
class Angle:
    """The angle of a link of one kind, and what it takes to compute it."""

    of: Visit
    value: Expression


@dataclass(frozen=True)
class Sweep:
    """A loop over the links, with a visit for each kind. Where it is `rising`, from base to tip, a
    link receives what its parent handed on, a root the `start`; else the sum over its children."""

    title: str
    rising: bool
    start: tuple[Expression, ...]
    visits: tuple[Visit, ...]


@dataclass(frozen=True)
class Table:
    """The constants of the links of a kind, a row for links that are equal."""

    about: str
    width: int
    rows: tuple[tuple[Expression, ...], ...]

    @property
    def computed(self) -> bool:
        """Whether parameters are in it."""
        return any(not isinstance(x, float) for row in self.rows for x in row)


PREVIOUS, BASE = -2, -1  # whom a link hands to, besides the slots


@dataclass(frozen=True)
class Read:
    """An entry of the `argument` (x or u) for each link: where the index of that name leads."""

    name: str
    argument: str
    index: str


@dataclass(frozen=True)
class Rolled:
    """A function of a tree as loops over its links: code for each kind of link, tables for what
    differs. Parents stand before children.

    By link: its kind, its row of the kind's table, and by name the `indices` of what it reads and
    of its results; where several links have a result in common each adds its part. `of`: the link
    before is its parent (PREVIOUS), the ground is (BASE), or the slot where its parent left what it
    handed on; `to`: the slot where a link with further children leaves it, or −1. `angles` are
    computed before all: sine and cosine begin the row.
    """

    kinds: tuple[int, ...]
    rows: tuple[int, ...]
    indices: Mapping[str, tuple[int, ...]]
    reads: tuple[Read, ...]
    of: tuple[int, ...]
    to: tuple[int, ...]
    slots: int
    tables: tuple[Table, ...]
    angles: tuple[Angle | None, ...]
    sweeps: tuple[Sweep, ...]
    widths: tuple[int, ...]  # by kind, of a row of the workspace
    factors: tuple[Expression, ...]  # f0, f1, …: of parameters, the same at all links

    @property
    def links(self) -> int:
        """How many there are."""
        return len(self.kinds)

    @property
    def added(self) -> frozenset[str]:
        """The results that several links have in common."""
        of = self.indices
        return frozenset(
            name
            for name, kinds in self.giving.items()
            if len({of[name][i] for i in self._of_kinds(kinds)}) < len(self._of_kinds(kinds))
        )

    @property
    def covered(self) -> frozenset[int]:
        """Entries of the result that links have."""
        given = self.giving.items()
        return frozenset(self.indices[name][i] for name, k in given for i in self._of_kinds(k))

    @property
    def giving(self) -> dict[str, frozenset[int]]:
        """By result the kinds of links that have it."""
        names = dict.fromkeys(name for visit in self.visits for name, _ in visit.results)
        return {
            name: frozenset(
                kind
                for sweep in self.sweeps
                for kind, visit in enumerate(sweep.visits)
                if name in dict(visit.results)
            )
            for name in names
        }

    def _of_kinds(self, kinds: frozenset[int]) -> list[int]:
        return [i for i, kind in enumerate(self.kinds) if kind in kinds]

    @property
    def received(self) -> int:
        """The most that is handed on in a sweep."""
        return max(len(sweep.start) for sweep in self.sweeps)

    @property
    def chain(self) -> bool:
        """Whether every link but the first hangs on the one before."""
        return all(of == PREVIOUS for of in self.of[1:])

    @property
    def workspace(self) -> int:
        """Numbers beside the results."""
        return sum(self.widths[kind] for kind in self.kinds) + self.slots * self.received

    @property
    def starts(self) -> tuple[int, ...]:
        """By link where its row begins in the workspace."""
        return (0, *accumulate(self.widths[kind] for kind in self.kinds[:-1]))

    @property
    def visits(self) -> tuple[Visit, ...]:
        """All bodies of code."""
        angles = (angle.of for angle in self.angles if angle)
        return (*angles, *(visit for sweep in self.sweeps for visit in sweep.visits))


@dataclass(frozen=True)
class Repeats:
    """Statements that come again and again are written once, where so many are left in bodies and
    between them; `numbers` of workspace."""

    statements: int
    numbers: int


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
    # loops in the place of `outputs`, of which there are none; sections compute what tables need
    rolled: Rolled | None = field(default=None, repr=False)
    repeats: Repeats | None = field(default=None, repr=False)

    @property
    def size(self) -> int:
        """How many entries the result has."""
        return math.prod(self.shape)

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


CHART = "_chart"  # behind the name of a function: of the chart with the number that follows


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
    # functions that are loops over links, or were to be: (name, how or why not)
    rolling: tuple[tuple[str, str], ...] = field(default=(), repr=False)

    @property
    def fingerprint(self) -> str:
        """Tells programs apart: the same text for the same program on every machine."""
        solving = [kernel.solving for kernel in self.kernels if kernel.solving]
        rolled = [kernel.rolled for kernel in self.kernels if kernel.rolled]
        further = (
            self.charts, self.turning, self.frame, self.events, self.steppers, solving, rolled,
            self.states,
        )  # fmt: skip
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
