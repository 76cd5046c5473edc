"""What the verbs return. The fields are the keys of `--json`; nothing here imports more than the
standard library and what errors are, but for the libraries that a method is named after."""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hamel.optional import library

if TYPE_CHECKING:
    from codegen.runtime.simulation import Simulation


def as_json(record: Any) -> Any:
    """The record as JSON values; what JSON has no number for (inf, nan) becomes null."""
    if is_dataclass(record):
        return {
            f.name: as_json(getattr(record, f.name))
            for f in fields(record)
            if f.metadata.get("json", True)
        }
    if isinstance(record, Mapping):
        return {str(key): as_json(value) for key, value in record.items()}
    if isinstance(record, list | tuple):
        return [as_json(item) for item in record]
    if isinstance(record, Path):
        return str(record)
    if isinstance(record, float):  # NumPy's float64 is one
        return float(record) if math.isfinite(record) else None
    return record


@dataclass(frozen=True)
class Built:
    """A module on disk. `seconds` is the time of each stage, `left_out` what this model has no use
    for.

    `kept`: it was built and verified earlier, from the same file with the same options by the same
    hamel, and taken from the store.
    """

    model: str
    choice: str
    reason: str
    folder: Path
    verified: bool
    operations: Mapping[str, int]
    seconds: Mapping[str, float]
    quasi_velocities: tuple[str, ...]
    left_out: tuple[str, ...]
    ledger: tuple[Mapping[str, Any], ...]
    compiled: bool
    # function → loops over what repeats, or why it is written out though the mechanism is long
    rolling: Mapping[str, str] = field(default_factory=dict)
    size: int = 0  # bytes of the library for C
    # nanoseconds of `dynamics` per state for what was compared
    tuned: Mapping[str, float] = field(default_factory=dict)
    kept: bool = False
    real: str = "float64"  # what the code computes in
    targets: Mapping[str, str] = field(default_factory=dict)  # on request: how each was verified


@dataclass(frozen=True)
class Checked:
    """A model that is a mechanical system. `rank` is that of the constraint rows at the consistent
    initial state; `speeds_at_start`, what it leaves, is more than the degrees of freedom where that
    state is singular."""

    model: str
    file: str
    bodies: tuple[str, ...]
    coordinates: tuple[str, ...]
    velocities: tuple[str, ...]
    constraints: tuple[str, ...]
    inputs: tuple[str, ...]
    states: tuple[str, ...]  # first-order ones
    parameters: tuple[str, ...]
    outputs: tuple[str, ...]
    choices: tuple[str, ...]
    refused: Mapping[str, str]  # choices of the file that cannot be built, and why
    rank: int
    degrees_of_freedom: int
    speeds_at_start: int
    moved: Mapping[
        str, Mapping[str, float]
    ]  # held initial values that had to give way: given and used
    initial: Mapping[str, float]  # the consistent initial state: coordinates, velocities, states
    assumptions: tuple[str, ...]


@dataclass(frozen=True)
class CheckLine:
    name: str
    value: float
    tolerance: float
    passed: bool


@dataclass(frozen=True)
class Mutation:
    """A planted error: in which term or function (`dynamics()`), what was done, and the checks that
    went red."""

    where: str
    what: str
    caught_by: tuple[str, ...]


@dataclass(frozen=True)
class Mutations:
    """`equivalent` changes left every number as it was; they are not among the planted."""

    choice: str
    planted: int
    caught: int
    equivalent: int
    list: tuple[Mutation, ...]


@dataclass(frozen=True)
class Verified:
    """The checks of every choice that was asked for; names start with the choice. `varied` are the
    parameters that differed between the states, `mutations` is there where errors were planted."""

    model: str
    passed: bool
    checks: tuple[CheckLine, ...]
    refused: Mapping[str, str]  # choices of the file that cannot be built, and why
    states: int
    seed: int
    varied: tuple[str, ...] = ()
    mutations: Mutations | None = None


@dataclass(frozen=True)
class ExtremeRow:
    """An extreme case: survived with an `error` within the tolerance, refused with a `status`, or
    wrong."""

    model: str
    case: str
    about: str
    method: str
    outcome: str  # survived, refused or wrong
    error: (
        float | None
    )  # at the end: angles in radians, else relative to the largest value of the same unit
    tolerance: float | None  # None: the error is only reported
    status: str
    expected: str  # survived or refused
    passed: bool
    judged_by: str
    steps: int
    seconds: float
    moved: float  # how far held initial values had to give way
    constraints: float  # largest |φ| or |A v − c|
    energy: float  # energy balance
    fewest: int | None = (
        None  # of stiff cases: steps at the loosest tolerance, by decades, that meets the case's
    )
    scipy: int | None = None  # the same of SciPy's Radau


@dataclass(frozen=True)
class Extremes:
    passed: bool  # every case came out as its file expects
    rows: tuple[ExtremeRow, ...]
    survived: int
    refused: int
    wrong: int


@dataclass(frozen=True)
class Derived:
    model: str
    choice: str
    reason: str
    html: Path
    tex: Path
    pdf: Path | None = None


@dataclass(frozen=True)
class Bound:
    """A book. `chapters` are the models in its order, `refused` those without a chapter and why,
    `pdf` is None where no browser could print it."""

    folder: Path
    contents: Path
    chapters: tuple[str, ...]
    refused: Mapping[str, str]
    pages: int  # HTML files
    pdf: Path | None


@dataclass(frozen=True)
class Drawn:
    """A figure of the mechanism. `moved`: coordinates that are drawn beside their initial values,
    which would hide something; `width` and `height` in pixels; `unnamed` labels are left out."""

    model: str
    file: Path
    about: str
    moved: tuple[str, ...]
    width: float
    height: float
    labels: int
    unnamed: int


@dataclass(frozen=True)
class Imported:
    """A robot file as a model. `left_out` alters the motion, `changed` does not; `text` is in
    `file` where there is one."""

    model: str
    kind: str  # URDF or MJCF
    file: Path | None
    bodies: int
    joints: Mapping[str, str]  # name in the robot's file → name in the model
    velocities: int
    changed: tuple[str, ...]
    left_out: tuple[str, ...]
    text: str = field(repr=False)


@dataclass(frozen=True)
class Ranking:
    """One candidate for the quasi-velocities, as `auto` sees it."""

    name: str
    kind: str
    rows: tuple[str, ...]
    pivots: tuple[str, ...]
    constant_pivots: bool
    condition: float  # cond [A; B], median over sampled consistent states
    worst: float
    least_pivot: float  # over those states, relative to the largest
    violation: (
        float  # predicted: |φ| after one step, or the roundoff of A v − c where there is no φ
    )
    operations: int  # of ẋ
    verdict: str
    ns: float | None  # per state, measured in a batch


@dataclass(frozen=True)
class Choices:
    """The candidates, best first; `default` is what `build` takes when no choice is given."""

    model: str
    default: str
    choices: tuple[Ranking, ...]
    refused: Mapping[str, str]  # kinds and choices of the file that fail, and why
    plot: Path | None


@dataclass(frozen=True)
class Explained:
    """Why the module of a choice looks as it does."""

    model: str
    choice: str
    reason: str
    pivots: tuple[str, ...]
    quasi_velocities: tuple[str, ...]
    operations: Mapping[str, int]
    ledger: tuple[Mapping[str, Any], ...]
    left_out: tuple[str, ...]
    assumptions: tuple[str, ...]
    rolling: Mapping[str, str]  # function → its loops, or why it is written out


@dataclass(frozen=True)
class CriticalValue:
    """Where the kind of motion changes along a swept name: `kind` is zero, hopf or double;
    `eigenvalue` is [re, im]."""

    kind: str
    name: str
    value: float
    eigenvalue: Sequence[float]


@dataclass(frozen=True)
class ModeOf:
    """An eigenvalue at `values`, of a pair the one above the real axis: its course and shape in
    words, and dλ/d(name)."""

    eigenvalue: Sequence[float]
    course: str
    shape: str
    sensitivity: Mapping[str, Sequence[float]]


@dataclass(frozen=True)
class UnreducedForm:
    """The multiplier equations in all coordinates and velocities that are not cyclic: how far they
    are from the minimal form on the constraints, relative to the largest entry of A, and their
    spurious zero eigenvalues, 2 m_h + m_n."""

    states: tuple[str, ...]
    A: Sequence[Sequence[float]]
    difference: float
    spurious: int


@dataclass(frozen=True)
class Linearized:
    """δẋ = A δx + B δu, δy = C δx + D δu along a steady motion, in `states`: independent
    coordinates and quasi-velocities.

    `rows` hold the swept values, the eigenvalues [re, im] that belong to the states `reduced`
    (without `cyclic` coordinates and `families` of steady motions, whose eigenvalues are zero), and
    how many spurious ones there are among them.
    """

    model: str
    file: str
    choice: str
    motion: str
    values: Mapping[str, float]  # parameters and free names where A to D are taken
    steady: Mapping[str, float]
    strayed: Mapping[
        str, tuple[float, float]
    ]  # coordinates far from the guess: there, and in the motion
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    A: Sequence[Sequence[float]]
    B: Sequence[Sequence[float]]
    C: Sequence[Sequence[float]]
    D: Sequence[Sequence[float]]
    cyclic: tuple[str, ...]
    families: int
    reduced: tuple[str, ...]
    swept: tuple[str, ...]
    rows: tuple[Mapping[str, Any], ...]
    critical: tuple[CriticalValue, ...]
    modes: tuple[ModeOf, ...]
    unreduced: (
        UnreducedForm | None
    )  # where neither generalized velocities nor rates are constant along the motion there is none
    stable: tuple[
        tuple[float, float], ...
    ]  # intervals of the swept name without an unstable eigenvalue
    unstable: tuple[tuple[float, float], ...]  # the same with one
    breaks: tuple[int, ...]  # rows on another branch of steady motions than the row before
    absent: tuple[int, ...]  # rows without a steady motion, which have no eigenvalues
    seconds: Mapping[str, float]
    step: float | None  # s; δx(t + step) = Φ δx + Γ δu where it is given
    Phi: Sequence[Sequence[float]] | None
    Gamma: Sequence[Sequence[float]] | None
    page: Path | None


@dataclass(frozen=True)
class Known:
    """A name with one line about it, and who devised it where that is known."""

    name: str
    about: str
    source: str = ""


@dataclass(frozen=True)
class Listed:
    """Everything hamel knows by name, or everything one model names, by kind."""

    kinds: Mapping[str, tuple[Known, ...]]


@dataclass(frozen=True)
class Switch:
    """Where one choice of quasi-velocities took over from another that came near a singular
    position: between the rows at `time` and `before`."""

    time: float
    before: float
    left: str
    entered: str


@dataclass(frozen=True)
class Simulated:
    """A motion and how far it can be trusted. The arrays are in `motion`, by name, and are left out
    of `--json`; `simulation` is the motion as whoever integrated it gave it, with its status."""

    model: str
    formulation: str
    choice: str
    enforcement: str
    integrator: str
    alpha: (
        float | None
    )  # rate in 1/s at which violations are pulled back, where the enforcement has one
    time: float
    steps: int
    rejected: int
    calls: int  # of dynamics
    seconds: float
    position_violation: float  # max |φ|
    velocity_violation: float  # max |A v − c|
    acceleration_violation: float  # the largest |A v̇ − β| in the rows of the output
    # max |E − (E at 0) − ∫ power dt|, relative to the largest energy exchanged; E is T + V, or
    # T₂ − T₀ + V where T = T₂ + T₁ + T₀ has terms linear in the rates or free of them
    energy_balance: float
    # estimate of the largest error of a coordinate or quasi-velocity at the end, in SI units
    error: float | None
    # positions on the way where a pivot of the choice or of the constraints vanishes, which is not
    # always where A loses rank; two ways across each agreed within the tolerance
    crossings: int
    landings: int  # steps that end where forces go on to another piece
    charts: int  # that the enforcement used, 0 where it has none
    switches: tuple[Switch, ...]  # of the choice of quasi-velocities
    moved: Mapping[str, Mapping[str, float]]
    final: Mapping[str, float]
    file: Path | None
    plot: Path | None
    view: Path | None = None
    events: Mapping[str, Sequence[float]] = field(default_factory=dict)  # times by name
    stopped_by: str | None = None  # the event that ended the motion
    # the state (coordinates, quasi-velocities) at each of these times, a row each
    at_events: Mapping[str, Any] = field(repr=False, default_factory=dict, metadata={"json": False})
    motion: Mapping[str, Any] = field(repr=False, default_factory=dict, metadata={"json": False})
    # t, T, V, work … of `motion`, by these names whatever names the model has
    measures: Mapping[str, Any] = field(repr=False, default_factory=dict, metadata={"json": False})
    simulation: Simulation | None = field(repr=False, default=None, metadata={"json": False})
    title: str = field(repr=False, default="", metadata={"json": False})
    automatic: bool = False  # the integrator was left to `auto`
    why: str = ""  # it is not the one by the tolerance
    units: Mapping[str, str] = field(repr=False, default_factory=dict, metadata={"json": False})
    figure: Callable[[], str] | None = field(repr=False, default=None, metadata={"json": False})

    def to_pandas(self) -> Any:
        """The motion as a DataFrame over t, the units in `attrs`. Raises ToolchainError without
        pandas."""
        pandas = library("pandas", "to_pandas()", "data")
        columns = dict(self.motion)
        frame = pandas.DataFrame(columns, index=pandas.Index(columns.pop("t"), name="t"))
        frame = frame[list(columns)]
        frame.attrs |= {**self._about(), "units": {"t": "s", **self.units}}
        return frame

    def to_xarray(self) -> Any:
        """The motion as a Dataset over t, each variable with its unit. Raises ToolchainError
        without xarray."""
        xarray = library("xarray", "to_xarray()", "data")
        columns = dict(self.motion)
        t = ("t", columns.pop("t"), {"units": "s"})
        variables = {
            name: ("t", values, {"units": self.units.get(name, "")})
            for name, values in columns.items()
        }
        return xarray.Dataset(variables, {"t": t}, self._about())

    @property
    def lasts(self) -> str:
        """How long it takes; from when to when where it does not begin at 0."""
        begin = float(self.motion["t"][0]) if "t" in self.motion else 0.0
        return f"{begin:g} s to {self.time:g} s" if begin else f"{self.time:g} s"

    def _about(self) -> dict[str, str]:
        names = ("model", "formulation", "choice", "enforcement", "integrator")
        return {name: getattr(self, name) for name in names}

    def _repr_html_(self) -> str:
        """The plot, with one line about it, for notebooks."""
        about = f"{self.model}, choice {self.choice}: {self.lasts}, {self.integrator}"
        steps = f"{self.steps} steps, energy balance {self.energy_balance:.2g}"
        figure = self.figure() if self.figure else ""
        return f"<div><p>{html.escape(about)}; {html.escape(steps)}</p>{figure}</div>"


@dataclass(frozen=True)
class Reported:
    """Error against run time. A row per run; `models` hold the time, the reference, what to use and
    what was left out.

    Not `passed`: runs that agree with each other contradict the reference solution, or an extreme
    case is not as expected.
    """

    model: str
    passed: bool
    rows: tuple[Mapping[str, Any], ...]
    models: tuple[Mapping[str, Any], ...]
    extremes: tuple[ExtremeRow, ...]
    html: Path
    csv: Path
    json: Path


@dataclass(frozen=True)
class KeptColumn:
    """What is known of a kept quantity over all motions of a sweep that came to their end.
    `lowest` and `highest`: (value, number of the motion); quantiles to half a per cent of a value,
    and nearer where values lie closely."""

    name: str
    unit: str
    count: int
    mean: float
    deviation: float
    quantiles: Mapping[str, float]
    lowest: tuple[tuple[float, int], ...]
    highest: tuple[tuple[float, int], ...]
    histogram: tuple[Sequence[float], Sequence[int]]  # edges, and how many are between them


@dataclass(frozen=True)
class MovedStart:
    """A motion whose start the constraints do not allow: which value gave way, and what is used
    (SI, or the unit of the model file)."""

    motion: int
    name: str
    unit: str
    given: float
    used: float


@dataclass(frozen=True)
class Swept:
    """A sweep that is complete. `statuses` counts motions by how they ended, `moves` are the first
    of those that are `moved`, `sensitivities` are Sobol indices by kept quantity: first order and
    total of every name, with their confidence."""

    model: str
    folder: str
    motions: int
    failed: int
    statuses: Mapping[str, int]
    reasons: tuple[tuple[int, str], ...]
    moved: int  # motions whose held initial values had to give way
    moves: tuple[MovedStart, ...]
    kept: tuple[KeptColumn, ...]
    sensitivities: Mapping[str, Any]
    engine: str
    made: int  # chunks that were made now; the others were there
    chunks: int
    lost: int  # chunks that lost their worker and were made again
    seconds: float
    running: float  # seconds of it that motions were made in
    rate: float  # motions made in one of these
    notes: tuple[str, ...]
    page: str
    commands: Mapping[str, str]  # what makes motions at the ends and others again
    data: Callable[[], Any] | None = field(repr=False, default=None, metadata={"json": False})

    def to_xarray(self) -> Any:
        """The rows as a Dataset over what varies, with units. Raises ToolchainError without
        xarray, and for a sweep that kept no rows."""
        assert self.data is not None  # whoever makes a record gives it
        return self.data()


@dataclass(frozen=True)
class BaseParameter:
    """A sum of standard parameters that motion tells, named after one of them; `file`: its value in
    the model file. `deviation` is the standard deviation of `weighted`."""

    name: str
    unit: str
    sum: str
    file: float | None = None
    ordinary: float | None = None
    weighted: float | None = None
    deviation: float | None = None
    consistent: float | None = None


@dataclass(frozen=True)
class BaseParameters:
    """Which sums a model's motion can tell. `least_kept` and `largest_dropped`: what the columns
    that count, and those that do not, have beyond the ones before them, scaled to one."""

    model: str
    standard: int
    by_structure: int
    base: tuple[BaseParameter, ...]
    without_effect: tuple[str, ...]
    least_kept: float
    largest_dropped: float


@dataclass(frozen=True)
class StandardParameter:
    """`value` is None where no physically consistent set was asked for."""

    name: str
    unit: str
    file: float
    value: float | None


@dataclass(frozen=True)
class Identified:
    """Parameters from measured motion. `noise`: standard deviation of each equation's noise;
    `residuals`: what is left of each, root mean square of that of the forces."""

    model: str
    data: str
    rows: int
    base: tuple[BaseParameter, ...]
    standard: tuple[StandardParameter, ...]
    condition: float
    equations: tuple[str, ...]
    noise: tuple[float, ...]
    residuals: tuple[float, ...]
    check: str | None
    check_residuals: tuple[float, ...]
    notes: tuple[str, ...]
    file: Path | None
    page: Path | None


@dataclass(frozen=True)
class FreeParameter:
    """A parameter of the file that was fitted by simulation, with its standard deviation for noise
    that is independent from row to row."""

    name: str
    unit: str
    file: float
    value: float
    deviation: float


@dataclass(frozen=True)
class FreeParameters:
    """Parameters by multiple shooting. `measured`: what is left of each quantity, root mean square
    in its unit; `gap`: the largest between two segments, in spreads of the state; `notes`: what
    speaks against the values."""

    model: str
    data: str
    rows: int
    segments: int
    parameters: tuple[FreeParameter, ...]
    measured: Mapping[str, float]
    gap: float
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Excitation:
    """A Fourier series in `file`: q = middle + Σ (aₖ sin kωt − bₖ cos kωt)/kω, ω = 2π/period."""

    model: str
    file: Path
    period: float
    harmonics: int
    condition: float
    base: int
    middle: tuple[float, ...]
    a: Sequence[Sequence[float]]
    b: Sequence[Sequence[float]]
    undriven: tuple[str, ...]  # coordinates that no input moves, where others are moved
