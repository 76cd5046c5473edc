"""The verbs as functions. Each takes the path of a model file, returns a record of hamel.records,
and raises HamelError.

`Floating(path)` in its place takes a URDF or MJCF file with its root link moving freely.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from os import PathLike, fspath
from pathlib import Path
from types import ModuleType
from typing import Any

from derive.diagnostics import HamelError
from derive.model.builder import Model as Built
from derive.robots import File as Model
from derive.robots import RobotFile
from hamel import records
from hamel.build.options import BuildOptions, Constants


def _names(given: Collection[str]) -> tuple[str, ...]:
    """Of several names; one text holds them as on the command line, with commas."""
    return (
        tuple(name for part in given.split(",") if (name := part.strip()))
        if isinstance(given, str)
        else tuple(given)
    )


def _constants(given: Constants) -> Constants:
    return given if given == "all" else _names(given)


def _models(given: Model | Sequence[Model]) -> tuple[Model, ...]:
    """Of several models; other processes read them, too, so that a path of any kind becomes its
    text."""
    many = (given,) if isinstance(given, str | PathLike) else tuple(given)
    return tuple(x if isinstance(x, RobotFile | Built) else fspath(x) for x in many)


def check(path: Model) -> records.Checked:
    """Read a model, form its mechanics and make its initial state consistent, without generating
    anything."""
    from hamel.verbs.check import run

    return run(path)


def build(
    path: Model,
    *,
    choice: str | None = None,
    out: str | Path | None = None,
    constants: Constants = (),
    functions: Collection[str] | None = None,
    formulation: str = "quasi_velocities",
    integrators: Collection[str] = (),
    numpy: bool = False,
    tune: bool = False,
    header: bool = False,
    fix: Mapping[str, float | str] | None = None,
    real: str = "float64",
    targets: Collection[str] = (),
    roll: str = "auto",
) -> records.Built:
    """Derive, emit, compile and quickly verify a module; nothing is left behind when it fails.

    `choice` a+b makes one module of several choices, its charts. `constants` names the parameters
    to bake in ("all" for every one); `integrators` those that the module's simulate() can use
    (dop853 when empty); `out` defaults to generated/<model>. Without a C compiler, and where what
    it made cannot be loaded, this raises ToolchainError, unless `numpy` says that a module that
    runs on NumPy will do. `tune` compiles
    every formulation that fits, with every choice where none is named, and takes the one whose
    `dynamics` is fastest on this machine. `header` adds <model>_inline.h, all functions in one
    header for C and C++. `fix` gives inputs and parameters a value, a number in SI or text with a
    unit, and bakes it in: the functions take them no more, and u is shorter. `real` is what the
    code computes in, float64 or float32. `targets` are written beside the module and checked by
    the tools that use them: `hamel list` names all. `roll` says whether `dynamics` of a tree of
    turning and sliding links is a loop over the links, whose code does not grow with their number:
    "never", "always", or "auto", from 40 links on.
    """
    from hamel.build.reuse import reused

    options = BuildOptions(
        choice=choice,
        constants=_constants(constants),
        functions=None if functions is None else _names(functions),
        formulation=formulation,
        integrators=_names(integrators),
        numpy=numpy,
        tune=tune,
        header=header,
        fix=fix or {},
        real=real,
        targets=_names(targets),
        roll=roll,
    )
    again = reused(path, out, options)
    if again is not None:  # then nothing of what derives has to be imported
        return again
    from hamel.build.pipeline import build

    return build(path, out, options)


def verify(
    path: Model,
    *,
    choice: str | None = None,
    states: int = 100,
    seed: int = 0,
    constants: Constants = (),
    formulation: str = "quasi_velocities",
    mutate: bool = False,
    targets: Collection[str] = (),
    functions: Collection[str] | None = None,
    real: str = "float64",
) -> records.Verified:
    """Compare a choice (all of the file's when none is named) with an independent derivation at
    random admissible states.

    `mutate` also plants errors, one at a time, and says which checks see each: `mutations` of the
    record. `functions` are compared beside the usual ones, such as the pose of a frame. `path` may
    also be the folder of a built module: then every file is compared with the manifest, and what is
    compiled there with the values that were stored when it was verified. `targets` are compared
    with the module instead, by the tools that use them; `functions` and `real` are those of that
    module, as in `build`.
    """
    from hamel.verbs.verify import is_module, run, run_folder, run_targets

    names = _names(targets)
    of_targets = {"functions": functions, "real": real if real != "float64" else ""}
    if is_module(path):
        asked = {"choice": choice, "constants": constants, "mutate": mutate, "targets": names}
        return run_folder(path, asked | of_targets)
    options = BuildOptions(
        choice=choice,
        constants=_constants(constants),
        functions=None if functions is None else _names(functions),
        formulation=formulation,
        real=real,
        targets=names,
    )
    if names:
        return run_targets(path, options, states, seed)
    if real != "float64":
        raise HamelError("real is for targets: name some with --target")
    return run(path, options, states, seed, mutate)


def extremes(
    paths: Model | Sequence[Model],
    *,
    case: str | None = None,
    progress: Callable[[str], None] | None = None,
) -> records.Extremes:
    """Run the `extremes:` cases of model files, or of all in a folder, and judge each end by a
    closed form or many digits."""
    from hamel.verbs.extremes import run

    return run(_models(paths), case, progress)


def simulate(
    path: Model,
    *,
    choice: str | None = None,
    formulation: str = "quasi_velocities",
    enforcement: str | None = None,
    integrator: str = "dop853",
    time: float = 10.0,
    step: float | None = None,
    step_size: float | None = None,
    rtol: float = 1e-10,
    atol: float | None = None,
    alpha: float | None = None,
    conserve: Collection[str] = (),
    values: Mapping[str, float | str] | None = None,
    inputs: Mapping[str, Any] | Callable[[float, Any], Any] | None = None,
    sample: float | Sequence[float] | None = None,
    events: Mapping[str, Any] | None = None,
    start: float = 0.0,
    out: str | Path | None = None,
    plot: str | Path | None = None,
    view: str | Path | None = None,
    progress: Callable[[float], None] | None = None,
    real: str = "float64",
) -> records.Simulated:
    """Integrate from the consistent initial state: one formulation, one enforcement (how to stay on
    the constraints; projection where there is something to project on when None) and one
    integrator, with steps by the tolerances or equal ones of `step_size`.

    `alpha` is the rate in 1/s at which baumgarte and feedback pull violations back (twice the
    system's fastest rate when None), `conserve` names cyclic coordinates whose momenta the
    enforcement invariants holds, beside the energy. `step` is the time between rows of the result;
    `values` sets initial values, parameters and constant inputs by name. `inputs` are those that
    change: by name a file "torque.csv:linear" (or :hold, :cubic) of two columns, or (times, values,
    kind); or a function f(t, x) of all, called every `sample` seconds (or at these times) and
    kept until the next, or, without, wherever the integrator wants it. `events` are functions
    f(t, x) by name, or hamel.Event(f, direction, stop), whose changes of sign are found like those
    of the model's own. `view` is a page FILE.html with the mechanism moving, or a picture FILE.svg
    of a planar one. `start` is the first time, `time` the last. `real` is what the code computes
    in, float64 or float32.
    """
    from hamel.simulate.compiled import Feed, Places, Rows, simulation
    from hamel.simulate.method import Method

    method = Method(
        formulation,
        choice,
        enforcement,
        integrator,
        step_size,
        rtol,
        atol,
        alpha,
        _names(conserve),
        real,
    )
    rows, places, feed = (
        Rows(time, step, start),
        Places(out, plot, view),
        Feed(inputs, sample, events),
    )
    return simulation(path, method, rows, values or {}, places, progress, feed)


def sweep(
    path: Model,
    *,
    vary: Mapping[str, Any],
    keep: Collection[str] = ("state",),
    out: str | Path | None = None,
    files: Collection[str] = (),
    samples: int | None = None,
    design: str = "random",
    seed: int = 0,
    time: float = 10.0,
    start: float = 0.0,
    step: float | None = None,
    formulation: str = "quasi_velocities",
    choice: str | None = None,
    enforcement: str | None = None,
    integrator: str = "dop853",
    step_size: float | None = None,
    rtol: float = 1e-9,
    atol: float | None = None,
    alpha: float | None = None,
    real: str = "float64",
    values: Mapping[str, float | str] | None = None,
    inputs: Mapping[str, Any] | None = None,
    at: str | None = None,
    reduce: bool = False,
    chunk: int | None = None,
    failures: float = 0.1,
    scheduler: str | None = None,
    workers: int | None = None,
    progress: Callable[[Any], None] | None = None,
) -> records.Swept:
    """Make many motions that differ in what `vary` says, keep of each what `keep` says, and write
    that to the folder `out` (default: sweep/<model>) as it comes; the same call goes on.

    `vary`: by name of a parameter, initial value, input or method a text, "1:10:50",
    "1:10:50:log", "1, 2, 5", "normal(0, 2 deg)", "uniform(a, b)", "loguniform(a, b)",
    "triangular(a, b, c)", "runs.csv:column", or an array; `files` are tables whose columns are
    names. `samples` of what is drawn, by `design` random, sobol, latin or saltelli, for every place
    of the grids. `keep`: formulas at the end, at(F, t), highest(F), lowest(F), mean(F), rms(F),
    count(event), first(event), last(event), state, energy, balance, error, violation, steps, end;
    or growth and frequency of the eigenvalue with the largest real part along the steady motion
    `at`. With `reduce` no rows are kept, only what is known of all. `scheduler` is here, processes,
    local or the address of a dask scheduler; results do not depend on it. More than the part
    `failures` of motions that fail ends the sweep. `progress` is called after every chunk with
    `done`, `size`, `failed` and more.
    """
    from hamel.simulate.compiled import Rows
    from hamel.simulate.method import Method
    from hamel.sweep.axes import Sampling
    from hamel.sweep.plan import Asked
    from hamel.verbs.sweep import Running, run

    method = Method(
        formulation, choice, enforcement, integrator, step_size, rtol, atol, alpha, (), real
    )
    asked = Asked(
        vary,
        _names(files),
        tuple([keep] if isinstance(keep, str) else keep),
        Sampling(samples, design, seed),
        method,
        Rows(time, step, start),
        values or {},
        inputs or {},
        at,
        reduce,
        chunk,
    )
    return run(path, asked, Running(out, scheduler, workers, failures, progress))


def linearize(
    path: Model,
    *,
    at: str | None = None,
    choice: str | None = None,
    sweep: Mapping[str, str] | None = None,
    values: Mapping[str, float | str] | None = None,
    cyclic: Sequence[str] | None = None,
    out: str | Path | None = None,
    step: float | None = None,
) -> records.Linearized:
    """The linear equations along the steady motion `at` (the file's first, or `guess`) and their
    eigenvalues.

    `sweep` gives ranges "first:last:count" of one or two names, `values` the free names and
    parameters that stay as they are, and coordinates and velocities that the search starts from.
    `cyclic` names the coordinates to leave out of the
    eigenvalues, all cyclic ones when None. The page goes to `out`. With a `step` (s) the record
    holds the equations in discrete time too.
    """
    from hamel.verbs.linearize import Options, run

    names = None if cyclic is None else _names(cyclic)
    return run(path, Options(at, choice, sweep or {}, values or {}, names, step), out)


def base_parameters(path: Model, *, choice: str | None = None) -> records.BaseParameters:
    """Which sums of inertial, friction and rotor parameters the motion of a model can tell, with
    their closed expressions: by structure, then by rank. Raises AssumptionError for a model without
    bodies that have mass."""
    from hamel.optional import library

    library("scipy", "identification", "identify")
    from hamel.verbs.identify import base

    return base(path, choice)


def identify(
    path: Model,
    data: str | Path,
    *,
    choice: str | None = None,
    cutoff: float | None = None,
    check: str | Path | None = None,
    out: str | Path | None = None,
    page: str | Path | None = None,
) -> records.Identified:
    """Fit the base parameters to a motion in a CSV file: columns t, coordinates and inputs, and
    velocities and accelerations, `der(v)`, where they were measured.

    Without accelerations the motion is filtered at `cutoff` (Hz; by its spectrum when None).
    `check` is a motion that is predicted and not fitted. `out` is the model file with physically
    consistent values, `page` an HTML page. Raises ModelError for what is wrong with the file,
    AssumptionError where the motion does not tell the parameters.
    """
    from hamel.optional import library

    library("scipy", "identification", "identify")
    from hamel.verbs.identify import run

    return run(path, data, choice, cutoff, check, out, page)


def free_parameters(
    path: Model,
    data: str | Path,
    names: Sequence[str],
    *,
    choice: str | None = None,
    segments: int = 10,
    cutoff: float | None = None,
) -> records.FreeParameters:
    """Fit any parameters of a model to a motion in a CSV file by multiple shooting: columns t and
    all inputs, and coordinates, velocities, states or outputs as far as they were measured.

    `cutoff` (Hz) is of the filter that first guesses come from. Raises ModelError for what is wrong
    with the file, AssumptionError where the motion does not tell them.
    """
    from hamel.optional import library

    library("scipy", "identification", "identify")
    from hamel.verbs.identify import shoot

    return shoot(path, data, _names(names), choice, segments, cutoff)


def excitation(
    path: Model,
    out: str | Path,
    *,
    period: float = 10.0,
    harmonics: int = 5,
    speed: float | None = None,
    rate: float = 100.0,
) -> records.Excitation:
    """A motion that tells the base parameters of a tree, as Fourier series within the limits of the
    joints and below `speed` (1/s): sampled at `rate` (Hz) into the CSV file `out`."""
    from hamel.optional import library

    library("scipy", "identification", "identify")
    from hamel.verbs.identify import excite

    return excite(path, out, period, harmonics, speed, rate)


def report(
    paths: Model | Sequence[Model],
    *,
    out: str | Path = "report",
    time: float = 10.0,
    values: Mapping[str, float | str] | None = None,
    formulations: Collection[str] = (),
    choices: Collection[str] = (),
    enforcements: Collection[str] = (),
    integrators: Collection[str] = (),
    tolerances: Sequence[float] = (),
    extremes: Model | Sequence[Model] = (),
    budget: float = 90.0,
    compare: Sequence[str] = (),
    progress: Callable[[float], None] | None = None,
) -> records.Reported:
    """Run every method that fits the models, and write what each costs and reaches to report.html,
    .csv and .json in `out`.

    `formulations` to `tolerances` restrict what is run ("libraries" among the integrators stands
    for the library solvers). `extremes` names files or folders whose extreme cases are run too. The
    runs of one model may take `budget` seconds, and building their modules as many again; finished
    ones are kept, so that the same call goes on where it was. `compare` names two methods
    (formulations, choices or enforcements) that the page puts side by side. Raises ToolchainError
    without a C compiler.
    """
    from hamel.study.plan import Restrictions
    from hamel.verbs.report import run

    asked = Restrictions(
        _names(formulations), _names(choices), _names(enforcements), _names(integrators),
        tuple(tolerances), budget, tuple(compare),
    )  # fmt: skip
    return run(_models(paths), out, time, values or {}, asked, _models(extremes), progress)


def derive(
    path: Model,
    *,
    choice: str | None = None,
    out: str | Path | None = None,
    formulation: str = "quasi_velocities",
    road: Sequence[str] = ("block_inversion",),
    pdf: bool = False,
    live: bool = False,
) -> records.Derived:
    """Write the derivation as derivation.html and derivation.tex into `out` (default: the current
    folder).

    `road` names one way to the equations without multipliers, or two that are put side by side:
    block_inversion, maggi, kane, boltzmann_hamel, gibbs_appell, multipliers, udwadia_kalaba. Raises
    AssumptionError where the model cannot take it. With `pdf` derivation.pdf is typeset as well, by
    pdflatex; raises ToolchainError where there is none. A `live` page carries the module as
    WebAssembly, with sliders for parameters, initial values and inputs; raises ToolchainError where
    nothing compiles for it.
    """
    from hamel.verbs.derive import run

    return run(path, choice, Path(out or "."), formulation, _names(road), pdf, live)


def book(
    paths: Model | Sequence[Model],
    *,
    out: str | Path = "book",
    title: str = "Mechanisms",
    pdf: bool = True,
    workers: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> records.Bound:
    """Write a book with a chapter for every model into the folder `out`: by topic, from energies to
    rolling in space, each with objectives, figure, derivation, a motion, what its accuracy costs,
    and exercises whose solutions the module computes; contents and an index.

    With `pdf` it is also printed, where a Chromium is installed. Chapters are made in as many
    processes as `workers` (as many as cores when None). Raises ModelError where two models have one
    name or none has a chapter.
    """
    from hamel.verbs.book import run

    return run(_models(paths), Path(out), title, pdf, workers, progress)


def draw(path: Model, *, out: str | Path | None = None) -> records.Drawn:
    """Draw the mechanism as a textbook does, into `out`: FILE.svg, or FILE.tex for a TikZ picture
    (default: <model>.svg in the current folder).

    It is drawn at the consistent initial state; coordinates that would hide something there are
    moved a little, and named in the record.
    """
    from hamel.verbs.draw import run

    return run(path, out)


def import_(
    path: Model, *, out: str | Path | None = None, floating: bool = False
) -> records.Imported:
    """Turn a URDF or MJCF file into the text of a model, written to `out` when given. `floating`,
    or Floating(path), puts a free joint under the root link, which is fixed to the ground
    otherwise.
    """
    from hamel.verbs.import_ import run

    return run(path, out, floating)


def choices(
    path: Model, *, time: bool = False, plot: str | Path | None = None, until: float = 10.0
) -> records.Choices:
    """The candidates for the quasi-velocities, ranked, and why: partitions, the file's own,
    orthonormal, frozen, mass-orthogonal.

    `time` compiles each and measures `dynamics`; `plot` draws cond [A; B] along the motion of the
    first choice up to `until`.
    """
    from hamel.verbs.choices import run

    return run(path, time, None if plot is None else Path(plot), until)


def list(path: Model | None = None) -> records.Listed:
    """Everything hamel knows by name; with a model, everything that model names."""
    from hamel.verbs.list import run

    return run(path)


def explain(
    path: Model, *, choice: str | None = None, constants: Constants = ()
) -> records.Explained:
    """Why the module of a choice looks as it does: choice, pivots, what the passes saved, what was
    left out."""
    from hamel.verbs.explain import run

    return run(path, choice, _constants(constants))


def schema(page: bool = False) -> dict[str, Any] | str:
    """The JSON Schema of model files, for editors; with `page` the reference of the language in
    Markdown: every key with type, unit, default, example and what becomes of it."""
    from hamel.verbs.schema import run

    return run(page)


def load(folder: str | Path) -> ModuleType:
    """The generated module in `folder` (it can also be imported like any package).

    Raises VerificationError unless every file is the one that was built and verified.
    """
    from hamel.build.module import module_in

    return module_in(folder)
