"""What `simulate` takes from a model: sizes, names, methods, and the functions of the module.

The same file in every generated folder. No claim of licence is made on it: 0BSD, see LICENSE.txt.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from ._runge_kutta import Tableau
from ._simulation import Status

Function = Callable[..., Any]  # f(t, x, u, p, out) → status


@dataclass(frozen=True)
class Method:
    """An integrator: `order` is 0 where the tolerance makes it, `stepped` says that it has no step
    control, `exact` that it needs the exact Jacobian or series. Only those with a `tableau` go
    without a compiler."""

    name: str
    order: int
    stepped: bool = False
    exact: bool = False
    tableau: Tableau | None = None


@dataclass(frozen=True)
class Limits:
    """Tolerances in the precision of the module."""

    pivot: float  # of the largest that a guard was: less is a singular position
    drift: float  # of positions, where little of a guard is left
    agreement: float  # of rates of the coordinates that lead to the same state
    whole: float  # a part of a step that is rounding
    least_step: int  # in units of rounding of the time
    independent: float  # smallest pivot of the constraints from which a stop is the choice's own
    carried: float  # of v, that a change of coordinates may be off by
    nearly_based: float  # a frame that is as good as this need not be based anew
    tight: float  # rtol from which an explicit method of high order takes less time
    series: float  # rtol from which one motion takes less time along its Taylor series


class Shared(Protocol):
    """_shared.py of the module: its arguments."""

    @property
    def FUNCTIONS(self) -> Mapping[str, tuple[Any, ...]]: ...
    @property
    def DEFAULTS(self) -> np.ndarray: ...
    def real(self, name: str, letter: str, value: Any) -> np.ndarray: ...
    def prepare(
        self, name: str, t: Any, x: Any, u: Any, p: Any, asked: str | None = None
    ) -> tuple[list[np.ndarray], tuple[int, ...]]: ...


class Charts(Protocol):
    """_charts.py of a module with several choices of quasi-velocities."""

    @property
    def SUFFIXES(self) -> Sequence[str]: ...
    @property
    def BETTER(self) -> float: ...
    # an evaluation takes t, x, u and p
    def margin(self, binding: Any, which: int, /, *state: Any) -> Any: ...
    def chart(self, binding: Any, /, *state: Any) -> Any: ...
    def transform(self, binding: Any, old: int, new: int, /, *state: Any) -> np.ndarray: ...


class Nullspace(Protocol):
    """_nullspace.py of a module with constraints; with a frame it has all of these."""

    @property
    def WORN(self) -> float: ...
    def independence(self, binding: Any, /, *state: Any) -> float: ...
    def worn(self, binding: Any, /, *state: Any) -> float: ...
    def rebase(self, binding: Any, /, *state: Any) -> np.ndarray: ...
    def full(self, p: Any, /) -> Any: ...


@dataclass(frozen=True)
class Facts:
    """A model as `simulate` takes it.

    `lengths` are those of results, 0 where there is no such function; `guards` how many there are
    in each chart; `fields` the entries of NAME_simulation in C: name, letter of an integer or ""
    of a real number or "P" of an address, and length, 0 of a single one.
    """

    name: str
    real: Any  # the type of numbers, as NumPy takes it
    nx: int
    nq: int
    nz: int  # first-order states, the last of x
    inputs: tuple[str, ...]
    parameters: tuple[str, ...]
    methods: tuple[Method, ...]
    enforcements: tuple[str, ...]
    staged: tuple[str, ...]  # enforcements that act at every stage
    events: tuple[tuple[str, int, bool], ...]  # of the model: name, direction, whether it stops
    fields: tuple[tuple[str, str, int], ...]
    lengths: Mapping[str, int]
    positions: int  # how many of the constraints are of positions
    guards: tuple[int, ...]
    limits: Limits
    shared: Shared
    numpy: Callable[[], Any]  # the functions in NumPy, imported only where they are needed
    charts: Charts | None = None
    nullspace: Nullspace | None = None
    frame: int = 0  # the last entries of p are directions that quasi-velocities are measured along
    framed: int = 0  # the chart whose they are
    turning: tuple[int, ...] = ()  # coordinates in which nothing on the way sees a whole turn
    turn: tuple[float, float] = (0.0, 0.0)  # 2π: the nearest number, and what is left
    # by enforcement, what else than the choice may be singular where a motion stops
    stops: Mapping[str, str] = field(default_factory=dict[str, str])

    @property
    def size(self) -> int:
        """Of the state and the work."""
        return self.nx + 1

    @property
    def is_narrow(self) -> bool:
        """Are numbers shorter than those of time steps should be?"""
        return np.dtype(self.real).itemsize < 8

    @cached_property
    def integrators(self) -> tuple[str, ...]:
        return tuple(method.name for method in self.methods)

    @cached_property
    def counted(self) -> tuple[str, ...]:
        """What a motion tells besides its rows."""
        usual = ("steps", "rejected", "calls", "position_violation", "velocity_violation")
        switches = ("switches",) if self.charts else ()
        bases = ("bases",) if self.frame else ()
        return (*usual, "crossings", "landings", "charts", *switches, *bases)

    @cached_property
    def rows(self) -> dict[str, tuple[tuple[int, ...], float]]:
        """What comes out at every output time: the shape of a row, and what stands where none
        is."""
        rows: dict[str, tuple[tuple[int, ...], float]] = {"x": ((self.nx,), np.nan)}
        rows["work"] = ((), np.nan)
        if self.charts:
            rows["v"] = ((self.lengths["velocity"],), np.nan)
            rows["chart"] = ((), -1.0)
        if self.turning:
            rows["reduced"] = ((self.nx,), np.nan)
        if self.frame:
            rows["frame"] = ((self.frame,), np.nan)
        return rows

    @cached_property
    def state(self) -> np.dtype[Any]:
        """NAME_simulation of NAME_simulate.h."""
        kinds = {"": self.real, "P": np.uintp}
        entries: list[tuple[Any, ...]] = []
        for name, letter, length in self.fields:
            entry = (name, kinds.get(letter, letter))
            entries.append((*entry, length) if length else entry)
        return np.dtype(entries, align=True)

    @cached_property
    def end(self) -> np.dtype[Any]:
        """NAME_end of NAME_simulate.h."""
        counts = ("steps", "rejected", "calls", "crossings", "landings")
        counts = (*counts, "charts", "switches", "bases")
        reals = ("t", "position_violation", "velocity_violation")
        entries: list[tuple[str, Any]] = [("status", "i"), *((name, "l") for name in counts)]
        return np.dtype([*entries, *((name, self.real) for name in reals)], align=True)

    @cached_property
    def motions(self) -> np.dtype[Any]:
        """NAME_motions of NAME_simulate.h."""
        entries: list[tuple[str, Any]] = [("rows", np.uintp), ("n", np.uintp)]
        for name in ("t0", "times", "x", "u", "p"):
            entries += [(name, np.uintp), (f"{name}_stride", np.intp)]
        entries += [(name, "i") for name in ("integrator", "enforcement", "choice")]
        entries += [(name, self.real) for name in ("step_size", "rtol", "atol")]
        entries.append(("budget", "l"))
        outputs = ("x", "work", "v", "chart", "reduced", "frame")
        addresses = (*(f"{name}_out" for name in outputs), "ends", "simulations", "events")
        entries += [(name, np.uintp) for name in addresses]
        if self.inputs:
            entries += [("inputs", np.uintp), ("inputs_stride", np.intp)]
        return np.dtype(entries, align=True)

    def array(self, *shape: int) -> np.ndarray:
        """Zeros."""
        return np.zeros(shape, self.real)

    def rows_to_come(self, *shape: int) -> dict[str, np.ndarray]:
        """Rows that are not reached yet."""
        rows = self.rows.items()
        return {name: np.full((*shape, *own), no, self.real) for name, (own, no) in rows}

    def with_frame(self, p: Any) -> Any:
        """With the usual frame where none is given."""
        return self.nullspace.full(p) if self.nullspace and self.frame else p

    def cause(self, status: Status, enforcement: int) -> str:
        """Of a stop under an enforcement, in words."""
        if status == Status.SINGULAR:
            return self.shared.FUNCTIONS["dynamics"][3]
        stop = self.stops.get(self.enforcements[enforcement])
        if status == Status.SINGULAR_CHOICE and stop:
            return f"{status.cause}; or {stop}"
        return status.cause
