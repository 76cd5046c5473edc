"""The Equations record: one formulation and one choice of quasi-velocities, as the functions of the
generated module.

x = (q, w, z), v = S w + R c; z are the model's first-order states. Every function is f(t, x, u,
p); arguments it does not use are absent
from its expressions and code.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca

from derive.choices.records import Frame, Guard
from derive.diagnostics import AssumptionError
from derive.expressions.deferred import Term, is_deferred, size_of
from derive.mechanics.loops.records import Recursion
from derive.mechanics.records import Named, System


@dataclass(frozen=True)
class Argument:
    """An argument slot of the generated functions: t (scalar), x, u or p, and its SX symbols in
    order."""

    name: str
    symbols: ca.SX
    labels: tuple[str, ...]
    units: tuple[str, ...]


@dataclass(frozen=True)
class Iteration:
    """The function is one Newton step: repeat with its result as the new x until the residual, a
    scalar, is ≤ tolerance."""

    tolerance: float
    most: int


@dataclass(frozen=True)
class Pattern:
    """Where the entries of a result stand in the matrix of that shape: row and column of each."""

    shape: tuple[int, int]
    rows: tuple[int, ...]
    columns: tuple[int, ...]


@dataclass(frozen=True)
class Result:
    """One result array of a function, row-major; `value` is dense r × c. Vectors are n × 1 and come
    out as (n,).

    A `matrix` comes out as (r, c) even where it has one column. A vector with a `pattern` holds
    entries of a sparse matrix. The value may be deferred: `written` says whether it is there.
    """

    name: str
    value: Term[ca.SX] = Term()
    labels: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    matrix: bool = False
    pattern: Pattern | None = None

    @property
    def written(self) -> bool:
        """Whether the value has been written out."""
        return not is_deferred(self, "value")

    @property
    def size(self) -> int:
        """How many entries the value has."""
        return size_of(self, "value")


@dataclass(frozen=True)
class Elimination:
    """M X = B of a symmetric M, to be solved in a loop over the columns of B where the code runs.

    M = Lᵀ D L with the unknowns taken in `order`; `pairs`: (i, k), in order, row i gets −L times
    row k on the way there, and gives as much back. `values`: those L, then 1/D of each unknown. B
    stands in the function's `unsolved` result, in rows from `first` on and in the `ranges` (begin,
    end) of columns; X takes its place. Then `added` is added at `places` of the result.
    """

    order: tuple[int, ...]
    pairs: tuple[tuple[int, int], ...]
    values: ca.SX
    unsolved: ca.SX
    first: int
    ranges: tuple[tuple[int, int], ...]
    added: ca.SX
    places: tuple[int, ...]


@dataclass(frozen=True)
class Function:
    """`about` is one line for the header, docstring and manifest; `named` are intermediates that
    name sections of the code.

    `x` replaces the x slot of the arguments where the function takes something else there (`state`
    takes q and v).
    """

    name: str
    about: str
    result: Result
    named: tuple[Named, ...] = ()
    guards: tuple[Guard, ...] = ()
    iteration: Iteration | None = None
    residual: ca.SX | None = None  # of an iteration
    x: Argument | None = None
    solving: Elimination | None = None  # how the result is computed, where a loop is shorter
    # the result as loops over links, whatever their number. Raises AssumptionError where it does
    # not fit, with the reason
    recursion: Callable[[], Recursion] | None = None


@dataclass(frozen=True)
class Request:
    """A function that is derived and emitted only when it is asked for by name (`--functions
    default,NAME`).

    One without `make` is no formula of its own but a loop of the runtime around those it `needs`.
    `condition` raises AssumptionError where the model has no such function, at little cost.
    """

    name: str
    about: str
    make: Callable[[], Function] | None = None
    needs: tuple[str, ...] = ()
    condition: Callable[[], None] | None = None

    @cached_property
    def function(self) -> Function:
        """Made when it is first asked for. Raises ValueError where there is none to be made,
        AssumptionError where the model has no such function."""
        if self.make is None:
            raise ValueError(f"{self.name} is a loop around {', '.join(self.needs)}")
        if self.refusal is not None:
            why = self.refusal.diagnostics[0]
            raise AssumptionError(f"{self.name} cannot be had: {why.message}", why.hint)
        return self.make()

    @property
    def refusal(self) -> AssumptionError | None:
        """Why the model has no such function; None where it has."""
        try:
            if self.condition is not None:
                self.condition()
        except AssumptionError as error:
            return error
        return None


@dataclass(frozen=True)
class Family:
    """Functions on request of one quantity, one for each named frame: NAME_FRAME. `about` says
    FRAME where the frame's name belongs."""

    name: str
    about: str
    make: Callable[[str], Function]


@dataclass(frozen=True)
class Equations:
    """One formulation and one choice, over t (s), x = (q, w, z), u, p: everything that a module is
    generated from, and what derivations and references read.

    With `generalized_velocities` x = (q, v) and A v = c is no identity, but a first integral of A
    v̇ = β that can drift.
    """

    system: System
    formulation: str
    choice: str
    reason: str  # why this choice, in one sentence
    arguments: tuple[Argument, ...]  # t, x, u, p in this order; u and p may be empty
    functions: tuple[Function, ...]  # the default ones
    named: tuple[Named, ...]  # S, R, Y, B and what the textbook shows
    pivots: tuple[str, ...]  # in words, in elimination order
    w: tuple[str, ...]  # names of the quasi-velocities
    parameters: tuple[float, ...]  # defaults, in the order of p
    assumptions: tuple[str, ...] = ()
    requests: tuple[Request, ...] = ()
    generalized_velocities: bool = (
        False  # x = (q, v): w are the generalized velocities, all of them
    )
    closing: tuple[
        int, ...
    ] = ()  # the independent rows among the holonomic ones, which `project` closes
    kept: tuple[int, ...] = ()  # the independent rows of A, which stand for all
    charts: tuple[
        Equations, ...
    ] = ()  # further choices, charts 1, 2, … of the same motion; this one is chart 0
    largest: tuple[
        float, ...
        # of a chart: the largest |value| / tolerance of each guard of dynamics at the sampled
        # states
    ] = ()
    families: tuple[Family, ...] = ()
    frame: Frame | None = None  # the last entries of p: directions that are based anew on the way
    z: tuple[str, ...] = ()  # names of the first-order states

    @property
    def speeds(self) -> slice:
        """Where w stands in x."""
        first = self.system.q.numel()
        return slice(first, first + len(self.w))

    def function(self, name: str) -> Function:
        """The default function of that name. Raises KeyError where there is none."""
        return _by_name(self.functions, name)

    def has(self, name: str) -> bool:
        """Whether there is a default function of that name."""
        return any(function.name == name for function in self.functions)

    def argument(self, name: str) -> Argument:
        """t, x, u or p. Raises KeyError for another name."""
        return _by_name(self.arguments, name)

    def term(self, name: str) -> ca.SX:
        """The named term, such as "B" or "M". Raises KeyError where there is none."""
        return _by_name(self.named, name).value

    def request(self, name: str) -> Request:
        """The function of that name that is made when it is asked for. Raises KeyError where there
        is none."""
        return _by_name(self.requests, name)

    def offers(self, name: str) -> bool:
        """Whether there is a function of that name on request."""
        return any(request.name == name for request in self.requests)


def _by_name(items: tuple[Any, ...], name: str) -> Any:
    return {item.name: item for item in items}[name]
