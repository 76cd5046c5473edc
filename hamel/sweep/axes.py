"""What varies: `m=1:10:50`, `q1=normal(0, 2 deg)`, `choice=crank,rocker`, `runs.csv`.

An axis has a number of places, and gives values for any of them; nothing is ever laid out whole but
the columns of a file. Random numbers depend on the seed and the number of the sample alone: block b
of 256 samples is drawn by the generator that SeedSequence(seed) spawns as its b-th child. So they
are the same however the samples are cut into chunks.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from derive.diagnostics import ModelError, did_you_mean, listed
from hamel.columns import ENDINGS, file_columns
from hamel.optional import library
from hamel.sweep.limits import BLOCK, COUNT, MOST, WHOLE
from hamel.sweep.quantiles import QUANTILES

METHODS = ("formulation", "choice", "enforcement", "integrator", "rtol", "step_size")
# of every row, beside what is varied and kept
NUMBER, STATUS, MOVED = OWN_COLUMNS = ("motion", "status", "moved")
DESIGNS = ("random", "sobol", "latin", "saltelli")
_CALL = re.compile(r"(\w+)\s*\((.*)\)", re.DOTALL)

Value = Callable[[str, str], float]  # (name, text) → number in SI


@dataclass(frozen=True)
class Distribution:
    """`quantile` of the numbers between 0 and 1 that a design gives."""

    name: str
    kind: str
    numbers: tuple[float, ...]

    def quantile(self, u: np.ndarray) -> np.ndarray:
        """The values that are not exceeded with the probabilities u."""
        return QUANTILES[self.kind](u, *self.numbers)


@dataclass(frozen=True)
class Grid:
    """Places of one name, in order."""

    name: str
    values: tuple[Any, ...]

    @property
    def size(self) -> int:
        return len(self.values)


@dataclass(frozen=True)
class Table:
    """Rows of a file: names that vary together."""

    file: str
    names: tuple[str, ...]
    columns: tuple[tuple[float, ...], ...]

    @property
    def size(self) -> int:
        return len(self.columns[0])


@dataclass(frozen=True)
class Design:
    """All that varies. Motion number i is place `np.unravel_index(i, shape)`: methods first, then
    grids, rows of files, and samples, which run fastest."""

    methods: tuple[Grid, ...]
    grids: tuple[Grid, ...]
    tables: tuple[Table, ...]
    distributions: tuple[Distribution, ...]
    samples: int
    kind: str  # of the samples: one of DESIGNS
    seed: int

    @property
    def shape(self) -> tuple[int, ...]:
        """Places of each axis; the last one is the samples', where anything is drawn."""
        sizes = [axis.size for axis in (*self.methods, *self.grids, *self.tables)]
        return (*sizes, self.samples)

    @property
    def size(self) -> int:
        """How many motions."""
        return math.prod(self.shape)

    @property
    def per_method(self) -> int:
        """How many motions every method makes."""
        return self.size // math.prod(axis.size for axis in self.methods)

    @property
    def names(self) -> tuple[str, ...]:
        """Of all numbers that vary."""
        rows = [name for table in self.tables for name in table.names]
        return (*(g.name for g in self.grids), *rows, *(d.name for d in self.distributions))

    @property
    def dimensions(self) -> tuple[str, ...]:
        """What the axes are called."""
        rows = [_row(k) for k in range(len(self.tables))]
        own = [axis.name for axis in (*self.methods, *self.grids)]
        return (*own, *rows, "sample")

    @property
    def taken(self) -> tuple[str, ...]:
        """Names that files of rows and the Dataset have already, besides the numbers that vary."""
        methods = [axis.name for axis in self.methods]
        rows = [_row(k) for k in range(len(self.tables))]
        alone = not (self.methods or self.grids or self.tables)
        samples = ["sample"] if self.samples > 1 or alone else []
        return (*OWN_COLUMNS, *methods, *rows, *samples)

    def method(self, number: int) -> dict[str, Any]:
        """The method of that number."""
        shape = tuple(axis.size for axis in self.methods)
        places = np.unravel_index(number, shape) if shape else ()
        return {axis.name: axis.values[int(k)] for axis, k in zip(self.methods, places)}

    def values(self, first: int, last: int) -> dict[str, np.ndarray]:
        """The numbers that vary, by name, of motions first to last − 1."""
        places = list(np.unravel_index(np.arange(first, last), self.shape))[len(self.methods) :]
        values: dict[str, np.ndarray] = {}
        for axis, place in zip(self.grids, places):
            values[axis.name] = _picked(axis.values, place)
        for table, place in zip(self.tables, places[len(self.grids) :]):
            for name, column in zip(table.names, table.columns):
                values[name] = _picked(column, place)
        if self.distributions:
            u = self.draws(places[-1])
            for k, each in enumerate(self.distributions):
                values[each.name] = each.quantile(u[:, k])
        return values

    def draws(self, samples: np.ndarray) -> np.ndarray:
        """Numbers between 0 and 1 of these samples, a column for each distribution."""
        width = len(self.distributions)
        low, high = int(samples.min()), int(samples.max()) + 1
        if self.kind == "random":
            first = low // BLOCK * BLOCK
            blocks = [_block(self.seed, b, width) for b in range(low // BLOCK, -(-high // BLOCK))]
            return np.concatenate(blocks)[samples - first]
        if self.kind == "sobol":
            return _sobol(self.seed, width, low, high)[samples - low]
        return _whole(self.kind, self.seed, width, self.samples)[samples]

    def about(self) -> dict[str, Any]:
        """As JSON has it: two designs that say the same are the same."""
        return {
            "methods": {axis.name: list(axis.values) for axis in self.methods},
            "grids": {axis.name: list(axis.values) for axis in self.grids},
            "tables": [{"names": t.names, "columns": t.columns} for t in self.tables],
            "distributions": {d.name: [d.kind, *d.numbers] for d in self.distributions},
            "samples": self.samples,
            "design": self.kind,
            "seed": self.seed,
        }


def _row(number: int) -> str:
    """What the axis of the rows of a file is called."""
    return f"row{number}" if number else "row"


def _picked(values: Sequence[float], places: np.ndarray) -> np.ndarray:
    """Those at the places; the others, millions in a file, are not touched."""
    return np.fromiter(map(values.__getitem__, places.tolist()), float, len(places))


# ---- numbers between 0 and 1


def _block(seed: int, number: int, width: int) -> np.ndarray:
    sequence = np.random.SeedSequence(seed, spawn_key=(number,))
    return np.random.Generator(np.random.PCG64(sequence)).random((BLOCK, width))


def _sobol(seed: int, width: int, low: int, high: int) -> np.ndarray:
    """Points low to high − 1 of a scrambled sequence (I. M. Sobol, 1967; A. B. Owen, 1998).

    Point n is the shift, and the direction of every bit of n's Gray code, by exclusive or (I. A.
    Antonov, V. M. Saleev, 1979). SciPy gives the directions, but only walks through the points from
    the first one on: 60 ns for each, a minute to where 10⁹ end.
    """
    directions, shift, scale = _directions(seed, width)
    n = np.arange(low, high, dtype=np.uint64)
    gray = n ^ (n >> np.uint64(1))
    points = np.tile(shift, (len(n), 1))
    for bit in range(int(gray.max()).bit_length() if len(n) else 0):
        there = (gray >> np.uint64(bit)) & np.uint64(1)
        points ^= there[:, None] * directions[:, bit]
    return np.clip(points * scale, 2.0**-54, 1.0 - 2.0**-53)


@lru_cache(maxsize=8)
def _directions(seed: int, width: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Of every bit, width × bits; the first point; and one of the integers as a number."""
    engine = library("scipy.stats.qmc", "a design of Sobol points").Sobol(
        width, scramble=True, bits=64, rng=np.random.default_rng(np.random.SeedSequence(seed))
    )
    return engine._sv.astype(np.uint64), engine._shift.astype(np.uint64), float(engine._scale)


@lru_cache(maxsize=2)
def _whole(kind: str, seed: int, width: int, samples: int) -> np.ndarray:
    """Latin hypercubes and the points of Saltelli (2002) are only known as a whole."""
    rng = np.random.default_rng(np.random.SeedSequence(seed))
    if kind == "latin":
        return (
            library("scipy.stats.qmc", "a Latin hypercube")
            .LatinHypercube(width, rng=rng)
            .random(samples)
        )
    sobol = library("SALib.sample.sobol", "a design for Sobol indices")
    points = sobol.sample(
        problem(width), samples // (width + 2), calc_second_order=False, seed=seed % 2**32
    )
    return np.clip(points, 2.0**-54, 1.0 - 2.0**-53)


def problem(width: int, names: Sequence[str] = ()) -> dict[str, Any]:
    """What SALib calls a problem, over the numbers between 0 and 1."""
    known = list(names) or [f"x{k}" for k in range(width)]
    return {"num_vars": width, "names": known, "bounds": [[0.0, 1.0]] * width}


_ARGUMENTS = {
    "normal": "normal(mean, deviation) or normal(mean, deviation, low, high)",
    "uniform": "uniform(low, high)",
    "loguniform": "loguniform(low, high)",
    "triangular": "triangular(low, mode, high)",
}
_COUNTS = {"normal": (2, 4), "uniform": (2,), "loguniform": (2,), "triangular": (3,)}


# ---- texts


@dataclass(frozen=True)
class Sampling:
    """How many samples of what is drawn, by which design."""

    samples: int | None
    kind: str
    seed: int


def design(
    vary: Mapping[str, Any], files: Sequence[str], sampling: Sampling, value: Value
) -> Design:
    """What varies as it was asked for: texts, numbers or arrays by name, and files whose columns
    are names. Raises ModelError with the text that is wrong."""
    strange = next((file for file in files if not is_file(file)), None)
    if strange is not None:
        raise ModelError(
            f"'{strange}' varies over nothing, and is no file of columns",
            f"NAME=WHAT, such as m=1:10:50, or a file that ends in {' or '.join(ENDINGS)}",
        )
    methods: list[Grid] = []
    grids: list[Grid] = []
    drawn: list[Distribution] = []
    columns: dict[str, dict[str, str]] = {file: {} for file in files}
    for name, given in vary.items():
        if name in METHODS:
            methods.append(_methods(name, given))
        elif isinstance(given, str) and (distribution := _distribution(name, given, value)):
            drawn.append(distribution)
        elif isinstance(given, str) and (distribution := _column(given)):
            columns.setdefault(distribution[0], {})[name] = distribution[1]
        else:
            grids.append(_grid(name, given, value))
    tables = [_table(file, names) for file, names in columns.items()]
    names = [
        *(g.name for g in grids),
        *(n for t in tables for n in t.names),
        *(d.name for d in drawn),
    ]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice:
        raise ModelError(f"'{twice}' varies twice")
    result = Design(
        tuple(methods),
        tuple(grids),
        tuple(tables),
        tuple(drawn),
        _samples(sampling, len(drawn)),
        sampling.kind,
        sampling.seed,
    )
    if result.size > MOST:
        raise ModelError(f"{result.size:.3g} motions are asked for", f"at most {MOST:.0e}")
    return result


def _samples(sampling: Sampling, width: int) -> int:
    if sampling.kind not in DESIGNS:
        near = did_you_mean(sampling.kind, DESIGNS) or listed(DESIGNS)
        raise ModelError(f"unknown design '{sampling.kind}'; {near}")
    if not width:
        if sampling.samples is not None and sampling.samples != 1:
            raise ModelError("samples are for what is drawn at random, and nothing is")
        return 1
    if sampling.seed < 0:
        raise ModelError(f"seed is {sampling.seed}, which is less than 0")
    count = 1000 if sampling.samples is None else sampling.samples
    if count < 1:
        raise ModelError(f"{count} samples are asked for", "one or more")
    if sampling.kind == "saltelli":
        base = 2 ** max(1, math.ceil(math.log2(max(2, count / (width + 2)))))
        count = base * (width + 2)  # each base point, moved along each axis
    if sampling.kind in ("latin", "saltelli") and count * width > WHOLE:
        raise ModelError(
            f"{count} samples of {width} names by the design '{sampling.kind}', which is only "
            "known as a whole",
            "the design random or sobol",
        )
    return count


def _methods(name: str, given: Any) -> Grid:
    if name in ("rtol", "step_size"):
        return _grid(name, given, _number)
    parts = given.split(",") if isinstance(given, str) else _entries(given)
    texts = [part.strip() if isinstance(part, str) else part for part in parts]
    return Grid(name, tuple(str(part) for part in texts if part))


def _number(name: str, text: str) -> float:
    """Of a method, which has no parameters."""
    try:
        return float(text)
    except ValueError:
        raise ModelError(
            f"{name} varies over '{text}', which is no number",
            f"{name}=1e-6:1e-10:5:log, or a list",
        ) from None


def _distribution(name: str, text: str, value: Value) -> Distribution | None:
    match = _CALL.fullmatch(text.strip())
    opened = text.partition("(")[0].strip()
    if not match and opened in _ARGUMENTS and "(" in text:
        raise ModelError(
            f"{name} varies as '{text}', which does not end with ')'", _ARGUMENTS[opened]
        )
    if not match or match[1] not in _ARGUMENTS:
        if match and "," in match[2]:
            near = did_you_mean(match[1], _ARGUMENTS) or f"known: {listed(_ARGUMENTS)}"
            raise ModelError(
                f"{name} varies as '{text}', but '{match[1]}' is no distribution; {near}"
            )
        return None
    kind, parts = match[1], [part.strip() for part in match[2].split(",")]
    if len(parts) not in _COUNTS[kind]:
        raise ModelError(f"{name} varies as '{text}'", _ARGUMENTS[kind])
    numbers = tuple(value(name, part) for part in parts)
    if problem := _misfit(kind, numbers):
        raise ModelError(f"{name} varies as '{text}': {problem}", _ARGUMENTS[kind])
    return Distribution(name, kind, numbers)


def _misfit(kind: str, numbers: tuple[float, ...]) -> str:
    if kind == "normal":
        if not numbers[1] > 0:
            return "the deviation is not above zero"
        return "low is not below high" if len(numbers) == 4 and numbers[2] >= numbers[3] else ""
    if not numbers[0] < numbers[-1]:
        return "low is not below high"
    if kind == "loguniform" and not numbers[0] > 0:
        return "low is not above zero"
    if kind == "triangular" and not numbers[0] <= numbers[1] <= numbers[2]:
        return "the mode is not between low and high"
    return ""


def _grid(name: str, given: Any, value: Value) -> Grid:
    if not isinstance(given, str):
        numbers = tuple(_entry(name, entry, value) for entry in _entries(given))
    elif ":" in given:
        numbers = _range(name, given, value)
    else:
        numbers = tuple(value(name, part.strip()) for part in given.split(","))
    if not numbers or not np.isfinite(numbers).all():
        raise ModelError(f"{name} varies over values that are not finite, or over none")
    return Grid(name, numbers)


def _entries(given: Any) -> list[Any]:
    """Of a list or an array, or the only one."""
    return np.ravel(np.asarray(given, dtype=object)).tolist()


def _entry(name: str, given: Any, value: Value) -> float:
    if isinstance(given, str):
        return value(name, given)
    try:
        return float(given)
    except (TypeError, ValueError):
        raise ModelError(f"{name} varies over {given!r}, which is no number") from None


def _range(name: str, text: str, value: Value) -> tuple[float, ...]:
    parts = [part.strip() for part in text.split(":")]
    expected = "first:last, first:last:count or first:last:count:log, such as 1:10:50"
    logarithmic = len(parts) == 4 and parts[3] == "log"
    if len(parts) not in (2, 3) and not logarithmic:
        raise ModelError(f"{name} varies over '{text}'", expected)
    count = COUNT if len(parts) == 2 else int(parts[2]) if parts[2].isdecimal() else 0
    if count > WHOLE:
        raise ModelError(f"{name} varies over '{text}'", f"at most {WHOLE:,} values of one name")
    if not count:
        raise ModelError(f"{name} varies over '{text}', with '{parts[2]}' values", expected)
    first, last = value(name, parts[0]), value(name, parts[1])
    if not logarithmic:
        return tuple(np.linspace(first, last, count).tolist())
    if not (first > 0 and last > 0):
        raise ModelError(f"{name} varies over '{text}': a logarithm has no such ends", expected)
    return tuple(np.geomspace(first, last, count).tolist())


# ---- files


def is_file(text: str) -> bool:
    """Whether a text names a file of columns."""
    return text.lower().endswith(ENDINGS)


def _column(text: str) -> tuple[str, str] | None:
    """FILE:COLUMN."""
    file, colon, column = text.rpartition(":")
    return (file, column.strip()) if colon and is_file(file) else None


def _table(file: str, names: Mapping[str, str]) -> Table:
    """Columns of a file: all of them under their own names, or those that are named."""
    known = file_columns(file)
    wanted = dict(names) or {name: name for name in known}
    for name, column in wanted.items():
        if column not in known:
            near = did_you_mean(column, known) or f"it has {listed(known)}"
            raise ModelError(f"{file} has no column '{column}' for {name}; {near}")
    columns = tuple(tuple(map(float, known[column])) for column in wanted.values())
    if not columns or not columns[0]:
        raise ModelError(f"{file} has no rows")
    if len(columns) * len(columns[0]) > WHOLE:
        raise ModelError(f"{file} has more than {WHOLE} numbers")
    return Table(Path(file).name, tuple(wanted), columns)
