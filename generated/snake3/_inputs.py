"""Inputs that change on the way: tables over time, and functions of time and state.

The same file in every generated folder. No claim of licence is made on it: 0BSD, see LICENSE.txt.
"""

import ctypes
import difflib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

KINDS = ("hold", "linear", "cubic")
NAMED = 12  # inputs or parameters, where one is none
# NAME_inputs of NAME_simulate.h
INPUTS = np.dtype(
    [(name, np.uintp) for name in ("knots", "times", "polynomials", "call", "data")], align=True
)
Function = Callable[[float, np.ndarray], Any]


@dataclass(frozen=True)
class Table:
    """Values of an input over time, or of all inputs with these along one more axis at the end.

    `times` (..., n) increase; `values` (..., n) or (..., n, nu) belong to them, leading axes to
    the motions of a batch. `kind` is what is between two times: "hold" keeps a value until the
    next time (and the last one for ever), "linear" goes straight, "cubic" is the spline with
    continuous second derivative whose third does not jump at the second and the last but one time.
    """

    times: Any
    values: Any
    kind: str = "linear"

    def __post_init__(self) -> None:
        _check("Table()", self.kind, *self._arrays())

    def _arrays(self) -> tuple[np.ndarray, np.ndarray]:
        """Times and values; those of all inputs with their times at the end."""
        times, values = np.asarray(self.times, dtype=float), np.asarray(self.values, dtype=float)
        many = times.shape[-1:] != values.shape[-1:] and times.shape[-1:] == values.shape[-2:-1]
        return times, values.swapaxes(-1, -2) if many else values


@dataclass(frozen=True)
class Source:
    """Inputs as they were asked for: `constant` (..., nu) where no table gives others, tables by
    the number of the input, and a function."""

    constant: np.ndarray
    tables: dict[int, Table]
    function: Any = None

    @property
    def changes(self) -> bool:
        return bool(self.tables) or self.function is not None

    @property
    def lead(self) -> tuple[int, ...]:
        """Leading axes of the tables."""
        if not self.tables:
            return ()
        shapes = [np.shape(table.times)[:-1] for table in self.tables.values()]
        shapes += [np.shape(table.values)[:-1] for table in self.tables.values()]
        return np.broadcast_shapes(*shapes)


def source(u: Any, names: Sequence[str], real: Callable[[Any], np.ndarray]) -> Source:
    """What `u` stands for: numbers, a Table, a mapping of names to either, or a function.

    `real` makes arrays of the module's precision. Raises ValueError with the name of the input.
    """
    count = len(names)
    zero = np.zeros(count)
    if isinstance(u, Table):
        values = np.asarray(u.values)
        if not values.ndim > 1 or values.shape[-1] != count:
            raise ValueError(
                f"simulate() needs a table with {count} values along the last axis, "
                f"got shape {values.shape}"
            )
        columns = {name: Table(u.times, values[..., i], u.kind) for i, name in enumerate(names)}
        return source(columns, names, real)
    if isinstance(u, Mapping):
        return _named(cast(Mapping[str, Any], u), names, real)
    if callable(u):
        if not count:
            raise ValueError("simulate() has no inputs here that a function could give")
        return Source(real(zero), {}, u)
    return Source(real(zero if u is None else u), {})


def _named(u: Mapping[str, Any], names: Sequence[str], real: Callable[[Any], np.ndarray]) -> Source:
    check_names("input", u, names)
    tables = {
        names.index(name): _checked(name, value)
        for name, value in u.items()
        if isinstance(value, Table)
    }
    numbers = {name: value for name, value in u.items() if not isinstance(value, Table)}
    return Source(filled(real(np.zeros(len(names))), numbers, names, real), tables)


def check_names(kind: str, given: Mapping[str, Any], known: Sequence[str]) -> None:
    """Refuse what is no input or parameter, with the nearest one. Raises ValueError."""
    for name in given:
        if name not in known:
            small = {each.lower(): each for each in known}
            near = difflib.get_close_matches(str(name).lower(), small, 1, 0.5)
            meant = f", perhaps {small[near[0]]!r}" if near else ""
            said = ", ".join(known[:NAMED]) + (", …" if len(known) > NAMED else "")
            raise ValueError(f"simulate() has no {kind} {name!r}{meant}; it has {said or 'none'}")


def filled(
    usual: np.ndarray,
    given: Mapping[str, Any],
    names: Sequence[str],
    real: Callable[[Any], np.ndarray],
) -> np.ndarray:
    """The usual numbers with those that are given by name in their places, over leading axes."""
    numbers = {name: real(value) for name, value in given.items()}
    lead = np.broadcast_shapes(*(value.shape for value in numbers.values()))
    result = np.broadcast_to(usual, (*lead, *usual.shape)).copy()
    for name, value in numbers.items():
        result[..., names.index(name)] = value
    return result


def _checked(name: str, table: Table) -> Table:
    """The table as arrays. Raises ValueError where it is none."""
    times = np.asarray(table.times, dtype=float)
    values = np.asarray(table.values, dtype=float)
    _check(f"table of {name!r}", table.kind, times, values)
    return Table(times, values, table.kind)


def _check(table: str, kind: str, times: np.ndarray, values: np.ndarray) -> None:
    """Refuse what is no table. Raises ValueError."""
    least = 1 if kind == "hold" else 2
    if kind not in KINDS:
        raise ValueError(f"{table}: no kind {kind!r}; there are {', '.join(KINDS)}")
    if not times.ndim or not values.ndim or times.shape[-1] != values.shape[-1]:
        raise ValueError(
            f"{table}: times of shape {times.shape} and values of shape {values.shape} "
            "do not belong to each other"
        )
    if times.shape[-1] < least:
        raise ValueError(f"{table}: {kind} needs at least {least} times")
    for what, array in (("time", times), ("value", values)):
        strange = np.argwhere(~np.isfinite(array))
        if len(strange):
            raise ValueError(f"{table}: {what} {strange[0][-1]} is not finite")
    late = np.argwhere(np.diff(times) <= 0)
    if len(late):
        raise ValueError(f"{table}: times do not increase from {late[0][-1]} to {late[0][-1] + 1}")


def check_cover(tables: Mapping[int, Table], names: Sequence[str], start: Any, end: Any) -> None:
    """Refuse tables that leave a part of the motion without a value. Raises ValueError."""
    for i, table in tables.items():
        first, last = table.times[..., 0], table.times[..., -1]
        if np.any(first > start):
            raise ValueError(
                f"table of {names[i]!r} begins at t = {np.max(first):g}, "
                f"the motion at t = {np.min(start):g}"
            )
        if table.kind != "hold" and np.any(last < end):
            raise ValueError(
                f"table of {names[i]!r} ends at t = {np.min(last):g}, "
                f"the motion at t = {np.max(end):g}"
            )


@dataclass(frozen=True)
class Pieces:
    """Polynomials of all inputs from knot to knot: knots (m,), a (..., m, nu, 4), lowest power
    first, of the time since the knot."""

    knots: np.ndarray
    a: np.ndarray

    def at(self, t: np.ndarray) -> np.ndarray:
        """u at the times t (n,), of the right-hand segment at a knot: (..., n, nu)."""
        place = np.clip(np.searchsorted(self.knots, t, "right") - 1, 0, None)
        return self.on(place, t)

    def on(self, segment: Any, t: Any) -> np.ndarray:
        """u at t by the polynomials of a segment."""
        since = (np.asarray(t) - self.knots[segment])[..., np.newaxis]
        a0, a1, a2, a3 = np.moveaxis(self.a[..., segment, :, :], -1, 0)
        return a0 + since * (a1 + since * (a2 + since * a3))


def pieces(source: Source) -> Pieces | list[Pieces]:
    """The polynomials on the knots of all tables; a list, one for each motion, where these have
    knots of their own."""
    tables = source.tables
    if all(table.times.ndim == 1 for table in tables.values()):
        return _merged(source.constant, tables)
    lead = np.broadcast_shapes(source.lead, source.constant.shape[:-1])
    constant = _rows(source.constant, lead, 1)
    times = {i: _rows(table.times, lead, 1) for i, table in tables.items()}
    values = {i: _rows(table.values, lead, 1) for i, table in tables.items()}
    return [
        _merged(
            constant[k],
            {i: Table(times[i][k], values[i][k], table.kind) for i, table in tables.items()},
        )
        for k in range(len(constant))
    ]


def _rows(value: np.ndarray, lead: tuple[int, ...], kept: int) -> np.ndarray:
    own = value.shape[value.ndim - kept :]
    return np.broadcast_to(value, (*lead, *own)).reshape(-1, *own)


def _merged(constant: np.ndarray, tables: Mapping[int, Table]) -> Pieces:
    """Every table on the knots of all."""
    own = {i: _segments(table) for i, table in tables.items()}
    knots = np.unique(np.concatenate([starts for starts, _ in own.values()]))
    lead = np.broadcast_shapes(constant.shape[:-1], *(a.shape[:-2] for _, a in own.values()))
    a = np.zeros((*lead, len(knots), constant.shape[-1], 4))
    a[..., 0] = constant[..., np.newaxis, :]
    for i, (starts, polynomials) in own.items():
        place = np.clip(np.searchsorted(starts, knots, "right") - 1, 0, None)
        a[..., i, :] = _shifted(polynomials[..., place, :], knots - starts[place])
    return Pieces(knots, a)


def _shifted(a: np.ndarray, by: np.ndarray) -> np.ndarray:
    """The same polynomials from a later time on."""
    a0, a1, a2, a3 = np.moveaxis(a, -1, 0)
    parts = (
        a0 + by * (a1 + by * (a2 + by * a3)),
        a1 + by * (2 * a2 + 3 * by * a3),
        a2 + 3 * by * a3,
        a3,
    )
    return np.stack(parts, axis=-1)


def _segments(table: Table) -> tuple[np.ndarray, np.ndarray]:
    """Where the polynomials of a table begin, and these: (m,), (..., m, 4)."""
    t, y = table.times, table.values
    if table.kind == "hold":
        return t, np.stack([y, *[np.zeros_like(y)] * 3], axis=-1)
    h = np.diff(t)
    chord = np.diff(y) / h
    if table.kind == "linear" or len(t) == 2:
        parts = [y[..., :-1], chord, np.zeros_like(chord), np.zeros_like(chord)]
        return t[:-1], np.stack(parts, axis=-1)
    slope = _spline_slopes(h, chord)
    left, right = slope[..., :-1], slope[..., 1:]
    parts = [
        y[..., :-1],
        left,
        (3 * chord - 2 * left - right) / h,
        (left + right - 2 * chord) / h**2,
    ]
    return t[:-1], np.stack(parts, axis=-1)


def _spline_slopes(h: np.ndarray, chord: np.ndarray) -> np.ndarray:
    """Slopes of the cubic spline at its knots, third derivatives continuous at the second and the
    last but one (de Boor, A Practical Guide to Splines, IV: "not-a-knot"); a parabola of three."""
    if len(h) == 2:
        bend = (chord[..., 1] - chord[..., 0]) / (h[0] + h[1])
        first = chord[..., 0] - bend * h[0]
        return np.stack([first, first + 2 * bend * h[0], chord[..., 1] + bend * h[1]], axis=-1)
    n = len(h) + 1
    below, middle, above = np.zeros(n), np.zeros(n), np.zeros(n)
    right = np.zeros((*chord.shape[:-1], n))
    below[1:-1], above[1:-1] = h[1:], h[:-1]
    middle[1:-1] = 2 * (h[:-1] + h[1:])
    right[..., 1:-1] = 3 * (h[1:] * chord[..., :-1] + h[:-1] * chord[..., 1:])
    middle[0], above[0], right[..., 0] = _end(h[0], h[1], chord[..., 0], chord[..., 1])
    middle[-1], below[-1], right[..., -1] = _end(h[-1], h[-2], chord[..., -1], chord[..., -2])
    for k in range(1, n):
        weight = below[k] / middle[k - 1]
        middle[k] -= weight * above[k - 1]
        right[..., k] -= weight * right[..., k - 1]
    slope = right
    slope[..., -1] /= middle[-1]
    for k in range(n - 2, -1, -1):
        slope[..., k] = (slope[..., k] - above[k] * slope[..., k + 1]) / middle[k]
    return slope


def _end(
    h: float, other: float, chord: np.ndarray, next_chord: np.ndarray
) -> tuple[float, float, np.ndarray]:
    """The row of an end: its diagonal, the entry beside it and the right-hand side."""
    both = h + other
    return other, both, ((h + 2 * both) * other * chord + h**2 * next_chord) / both


class Callback:
    """A function f(t, x) as compiled code calls it: what it raises is kept in `error`.

    A function of ctypes, `int f(double t, const double *x, double *out, void *data)`, is called as
    it is.
    """

    def __init__(self, function: Any, nx: int, size: int, real: Any) -> None:
        self.function, self.error = function, None
        self.x, self.out = np.empty(nx, real), np.empty(size, real)
        letter = ctypes.c_float if self.x.itemsize == 4 else ctypes.c_double
        prototype = ctypes.CFUNCTYPE(
            ctypes.c_int, letter, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p
        )
        native = isinstance(function, ctypes._CFuncPtr)  # type: ignore[attr-defined]
        self.pointer = function if native else prototype(self._call)
        self._prototype = prototype

    @property
    def address(self) -> int:
        return ctypes.cast(self.pointer, ctypes.c_void_p).value or 0

    def _call(self, t: float, x: int, out: int, _data: Any) -> int:
        here = np.frombuffer(bytearray(ctypes.string_at(x, self.x.nbytes)), self.x.dtype)
        values = self.values(t, here)
        if values is None:
            return 1
        ctypes.memmove(out, values.tobytes(), values.nbytes)
        return 0

    def values(self, t: float, x: np.ndarray) -> np.ndarray | None:
        """What the function gives; None where it fails."""
        if self.pointer is self.function:
            native = ctypes.cast(self.pointer, self._prototype)
            out = np.zeros_like(self.out)
            x = np.ascontiguousarray(x)
            return None if native(t, x.ctypes.data, out.ctypes.data, None) else out
        try:
            return given(self.function(t, x), self.out.shape, self.out.dtype)
        except Exception as error:  # it belongs to whoever gave the function
            self.error = error
            return None


def given(values: Any, shape: tuple[int, ...], real: Any) -> np.ndarray:
    """What a function gave, in the shape that is needed. Raises ValueError."""
    array = np.asarray(values, dtype=real)
    if array.shape == shape:
        return np.ascontiguousarray(array)
    if array.shape != shape and not (array.ndim < len(shape) and array.shape in ((), shape[1:])):
        raise ValueError(f"the function of the inputs gave shape {array.shape} instead of {shape}")
    return np.ascontiguousarray(np.broadcast_to(array, shape))


def sample_times(sample: Any, start: float, end: float) -> np.ndarray:
    """When a function is asked anew: at the start, then every `sample` seconds, or at times of its
    own, before the end. Raises ValueError."""
    times = np.asarray(sample, dtype=float)
    if not times.ndim:
        step = float(times)
        if not 0 < step < np.inf:
            raise ValueError("simulate() needs a sample time above zero")
        count = int(np.ceil((end - start) / step * (1 - 1e-12)))
        times = start + step * np.arange(count)
    if times.ndim > 1 or not np.isfinite(times).all() or np.any(np.diff(times) <= 0):
        raise ValueError("simulate() needs sample times that increase")
    inner = times[(times > start) & (times < end)]
    return np.concatenate([[start], inner])


class Feed:
    """Inputs that change as compiled code takes them: `structures`, one for all motions or one
    each, of polynomials and a function that is called wherever u is needed."""

    def __init__(self, source: Source, callback: Callback | None, real: Any) -> None:
        self.callback, self.count = callback, source.constant.shape[-1]
        self.all = pieces(source) if source.tables else None
        self.each = self._each(source)
        self._kept = [
            (np.ascontiguousarray(each.knots, real), np.ascontiguousarray(each.a, real))
            for each in self.each
        ]
        self.structures = np.zeros(len(self.each) or 1, INPUTS)
        self.structures["call"] = callback.address if callback else 0
        for structure, (knots, a) in zip(self.structures, self._kept):
            structure["knots"] = knots.size
            structure["times"], structure["polynomials"] = knots.ctypes.data, a.ctypes.data

    def _each(self, source: Source) -> list[Pieces]:
        if self.all is None or isinstance(self.all, list):
            return self.all or []
        a = self.all.a
        return [Pieces(self.all.knots, one) for one in a.reshape(-1, *a.shape[-3:])]

    @property
    def address(self) -> int:
        return self.structures.ctypes.data

    def of(self, row: int) -> tuple[Pieces | None, Callback | None]:
        """What a motion is fed with."""
        if not self.each:
            return None, self.callback
        return self.each[row if len(self.each) > 1 else 0], self.callback

    def spread(self, lead: tuple[int, ...], own: tuple[int, ...]) -> None:
        """One structure for each motion where leading axes `own` of the tables are fewer."""
        if len(self.each) > 1:
            numbers = np.broadcast_to(np.arange(len(self.each)).reshape(own), lead).ravel()
            self.each = [self.each[k] for k in numbers.tolist()]
            self.structures = self.structures[numbers]

    def rows(self, t: np.ndarray, x: np.ndarray) -> np.ndarray:
        """u at rows of one motion."""
        table = self.each[0].at(t) if self.each else None
        if self.callback is None:
            assert table is not None  # one of both is there
            return table
        values = [self.callback.values(float(t[k]), x[k]) for k in range(len(t))]
        missing = np.full(self.count, np.nan)
        return np.array([missing if value is None else value for value in values])
