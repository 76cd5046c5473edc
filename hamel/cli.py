"""The command line: click options around the verbs of hamel.api.

Only click is imported until a verb runs.
"""

from __future__ import annotations

import functools
import gc
import io
import os
import signal
import sys
from collections.abc import Sequence
from typing import Any

import click

import hamel
from hamel import failures
from hamel.arguments import (
    CHOICE,
    CONSTANTS,
    FINITE,
    FORMULATION,
    POSITIVE,
    REAL,
    TARGETS,
    Listed,
    constant_names,
    model_argument,
    name_list,
    number_list,
    values_by_name,
)
from hamel.command import group, verb

# objects that may be new before garbage is looked for: a command makes many that stay, and ends
# soon
YOUNG = 100_000


@verb
@model_argument
def check(model: str) -> Any:
    """Read MODEL and say what mechanical system it is."""
    return hamel.check(model)


@verb
@model_argument
@CHOICE
@FORMULATION
@click.option(
    "-o", "--out", metavar="DIR", help="The folder of the module (default: generated/<model>)."
)
@CONSTANTS
@click.option(
    "--fix",
    metavar="u1=0,a=2 m",
    default="",
    help="Inputs and parameters to bake in with these values; u is then shorter.",
)
@click.option(
    "--functions",
    cls=Listed,
    help='Emit these functions only (`hamel list MODEL` names all); "default" stands for all of '
    "use.",
)
@click.option(
    "--integrator",
    "integrators",
    cls=Listed,
    help="What the module's simulate() uses (default: dop853).",
)
@REAL
@click.option(
    "--numpy",
    is_flag=True,
    help="Where no C compiler makes what can be loaded, make a module that runs on NumPy.",
)
@click.option(
    "--roll",
    type=click.Choice(("auto", "never", "always")),
    default="auto",
    show_default=True,
    help="Functions of a tree as loops over its links, and what comes again and again in others "
    "written once (auto: from 40 links, or 1,500 statements, on).",
)
@click.option(
    "--header",
    is_flag=True,
    help="Also write all functions as one header of inline functions, NAME_inline.h.",
)
@TARGETS(help="Also write and check these targets on request, such as casadi: see list.")
@click.option(
    "--tune",
    is_flag=True,
    help="Time the candidates here (formulations, choices, flags) and take the fastest.",
)
@click.option(
    "--explain", is_flag=True, help="Also print what each pass saved and what was left out."
)
def build(
    model: str,
    constants: str,
    fix: str,
    functions: str,
    integrators: str,
    targets: str,
    explain: bool,
    **options: Any,
) -> Any:
    """Derive, compile and quickly verify a module of MODEL."""
    values = values_by_name(name_list(fix), "--fix")
    lists = {
        "functions": name_list(functions) or None,
        "integrators": name_list(integrators),
        "targets": name_list(targets),
    }
    return hamel.build(model, constants=constant_names(constants), fix=values, **lists, **options)


@verb
@model_argument
@click.option(
    "--choice",
    metavar="NAME",
    help="Verify this choice of quasi-velocities only (default: all of the file's).",
)
@click.option(
    "--states",
    type=click.IntRange(1, 1_000_000),
    default=100,
    show_default=True,
    help="Random admissible states per choice.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@FORMULATION
@CONSTANTS
@click.option(
    "--mutate",
    is_flag=True,
    help="Also plant errors, one at a time, and say which checks see each.",
)
@TARGETS(help="Instead compare these targets with the module, by the tools that use them.")
@click.option(
    "--functions",
    cls=Listed,
    help="Also these functions (`hamel list MODEL` names all); with --target: these only.",
)
@REAL
def verify(model: str, constants: str, targets: str, functions: str, **options: Any) -> Any:
    """Compare MODEL's code with an independent derivation; or the module in a folder with the
    values that were stored when it was verified."""
    lists = {"targets": name_list(targets), "functions": name_list(functions) or None}
    return hamel.verify(model, constants=constant_names(constants), **lists, **options)


@verb
@click.argument("models", nargs=-1)
@click.option("--case", metavar="NAME", help="Only the cases of this name.")
def extremes(models: Sequence[str], case: str | None) -> Any:
    """Run the extreme cases of MODELS (files or folders): survived, refused, or wrong."""
    if not models:
        raise click.UsageError(
            "no model is named: give files with `extremes:` cases or a folder of them, "
            "such as models/extremes"
        )
    return hamel.extremes(models, case=case)


@verb
@model_argument
@CHOICE
@FORMULATION
@click.option(
    "--enforcement",
    metavar="NAME",
    help="How to stay on the constraints (default: projection, where there is any).",
)
@click.option(
    "--alpha",
    type=POSITIVE,
    metavar="1/S",
    help="Rate of baumgarte and feedback (default: twice the system's fastest).",
)
@click.option(
    "--conserve",
    cls=Listed,
    help="Coordinates whose momenta the enforcement invariants holds too.",
)
@click.option(
    "--integrator",
    default="dop853",
    show_default=True,
    metavar="NAME",
    help="How to step; `hamel list` names all, auto picks one by the tolerance.",
)
@click.option(
    "--step-size",
    type=POSITIVE,
    metavar="S",
    help="Equal steps of at most this size instead of steps by the tolerances.",
)
@click.option(
    "--time",
    "--until",
    "time",
    type=POSITIVE,
    default=10.0,
    show_default=True,
    metavar="S",
    help="The last time, in seconds.",
)
@click.option(
    "--step",
    type=POSITIVE,
    metavar="S",
    help="Time between rows of the output (default: a five-hundredth of the time).",
)
@click.option(
    "--rtol", type=POSITIVE, default=1e-10, show_default=True, help="Relative tolerance of a step."
)
@click.option(
    "--atol", type=POSITIVE, help="Absolute tolerance of a step (default: a hundredth of rtol)."
)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="NAME=VALUE",
    help="Initial value, parameter or input; may be repeated.",
)
@click.option(
    "--input",
    "inputs",
    multiple=True,
    metavar="NAME=FILE[:KIND]",
    help="An input over time from a file of two columns, seconds and values; KIND is hold, linear "
    "or cubic (default: linear); may be repeated.",
)
@click.option(
    "--start",
    type=FINITE,
    default=0.0,
    show_default=True,
    metavar="S",
    help="The first time, in seconds.",
)
@REAL
@click.option("-o", "--out", metavar="FILE", help="Write the motion to FILE.csv, .npz or .parquet.")
@click.option("--plot", metavar="FILE", help="Draw the motion to FILE.svg.")
@click.option(
    "--view",
    metavar="FILE",
    help="Show the mechanism moving in the page FILE.html, or the picture FILE.svg.",
)
def simulate(
    model: str, settings: Sequence[str], inputs: Sequence[str], conserve: str, **options: Any
) -> Any:
    """Integrate MODEL from its consistent initial state."""
    from hamel.progress import bar

    values = values_by_name(settings)
    tables = values_by_name(inputs, "--input")
    with bar(options["time"] - options["start"]) as progress:
        return hamel.simulate(
            model,
            values=values,
            inputs=tables or None,
            progress=progress,
            conserve=name_list(conserve),
            **options,
        )


@verb
@model_argument
@click.argument("data", required=False)
@CHOICE
@click.option(
    "--base", is_flag=True, help="Only list the sums of parameters that a motion can tell."
)
@click.option(
    "--excite", metavar="FILE.csv", help="Only find a motion that tells them, and write it."
)
@click.option(
    "--cutoff",
    type=POSITIVE,
    metavar="HZ",
    help="Of the filter, where accelerations are missing (default: by the spectrum).",
)
@click.option("--free", cls=Listed, help="Fit these parameters of the file, by simulation of DATA.")
@click.option(
    "--segments",
    type=click.IntRange(1, 1000),
    default=10,
    show_default=True,
    help="Of --free: parts of the motion with starts of their own.",
)
@click.option("--check", metavar="FILE.csv", help="A motion to predict, that is not fitted.")
@click.option("-o", "--out", metavar="FILE.yaml", help="Write the model with the values found.")
@click.option("--page", metavar="FILE.html", help="Write values and plots.")
@click.option(
    "--period", type=POSITIVE, default=10.0, show_default=True, metavar="S", help="Of --excite."
)
@click.option(
    "--harmonics", type=click.IntRange(1, 50), default=5, show_default=True, help="Of --excite."
)
@click.option("--speed", type=POSITIVE, metavar="1/S", help="The most of --excite (default: any).")
@click.option(
    "--rate",
    type=POSITIVE,
    default=100.0,
    show_default=True,
    metavar="HZ",
    help="Rows per second of --excite.",
)
def identify(model: str, data: str | None, base: bool, excite: str | None, **options: Any) -> Any:
    """Fit masses, inertias, friction and rotors of MODEL to the motion in DATA, a CSV file with
    columns t, coordinates, inputs, and velocities and accelerations, der(v), where there are
    any."""
    series = {name: options.pop(name) for name in ("period", "harmonics", "speed", "rate")}
    if [data is not None, base, excite is not None].count(True) != 1:
        raise click.UsageError("give one of DATA, --base and --excite FILE.csv")
    if base:
        return hamel.base_parameters(model, choice=options["choice"])
    if excite:
        return hamel.excitation(model, excite, **series)
    assert data is not None  # the one that is left of the three
    free, segments = options.pop("free"), options.pop("segments")
    if free:
        unused = [name for name in ("check", "out", "page") if options[name] is not None]
        if unused:
            raise click.UsageError(f"--{unused[0]} is not for --free")
        names, how = name_list(free), {x: options[x] for x in ("choice", "cutoff")}
        return hamel.free_parameters(model, data, names, segments=segments, **how)
    return hamel.identify(model, data, **options)


@verb
@click.argument("models", nargs=-1, metavar="MODEL...")
@click.option(
    "--extremes",
    multiple=True,
    metavar="PATH",
    help="Add the extreme cases of a file or folder; may be repeated.",
)
@click.option(
    "-o",
    "--out",
    metavar="DIR",
    default="report",
    show_default=True,
    help="The folder of the report.",
)
@click.option(
    "--time",
    type=POSITIVE,
    default=10.0,
    show_default=True,
    metavar="S",
    help="The length of the motions, in seconds.",
)
@click.option(
    "--budget",
    type=POSITIVE,
    default=90.0,
    show_default=True,
    metavar="S",
    help="Seconds for all runs of one model, and as many for building their modules.",
)
@click.option("--formulation", "formulations", cls=Listed, help="These formulations only.")
@click.option("--choice", "choices", cls=Listed, help="These choices of quasi-velocities only.")
@click.option("--enforcement", "enforcements", cls=Listed, help="These enforcements only.")
@click.option(
    "--integrator",
    "integrators",
    cls=Listed,
    help='These only; "libraries" for the library solvers.',
)
@click.option(
    "--rtol",
    "tolerances",
    cls=Listed,
    help="These relative tolerances (default: 1e-4 to 1e-12).",
)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="NAME=VALUE",
    help="Initial value, parameter or input; may be repeated.",
)
@click.option(
    "--compare",
    nargs=2,
    metavar="A B",
    help="Put two methods side by side: formulations, choices or enforcements by name.",
)
def report(models: Sequence[str], settings: Sequence[str], **options: Any) -> Any:
    """Compare every method that fits MODEL: error against run time."""
    from hamel.progress import bar

    values = values_by_name(settings)
    names = {
        kind: name_list(options.pop(kind))
        for kind in ("formulations", "choices", "enforcements", "integrators")
    }
    tolerances = number_list(options.pop("tolerances"))
    pair = options.pop("compare") or ()
    chosen = {**names, **options, "tolerances": tolerances, "compare": pair}
    with bar(1.0, "running") as progress:
        return hamel.report(models, values=values, progress=progress, **chosen)


@verb
@model_argument
@click.option(
    "--vary",
    multiple=True,
    required=True,
    metavar="NAME=WHAT|FILE",
    help="A parameter, initial value, input or method over 1:10:50, 1:10:50:log, 1,2,5, "
    "normal(0, 2 deg), uniform(a, b), loguniform(a, b), triangular(a, b, c) or FILE.csv:COLUMN; "
    "or a CSV or Parquet file whose columns are names; may be repeated.",
)
@click.option(
    "--keep",
    multiple=True,
    metavar="FORMULA",
    help="What is kept of a motion: a formula at its end, at(F, t), highest(F), lowest(F), "
    "mean(F), rms(F), count(EVENT), first(EVENT), state, energy, balance, error, steps, growth; "
    "may be repeated (default: state).",
)
@click.option(
    "-o",
    "--out",
    metavar="DIR",
    help="Where results go; the same command goes on from there (default: sweep/<model>).",
)
@click.option("--samples", type=click.IntRange(1), metavar="N", help="Of what is drawn (1000).")
@click.option(
    "--design",
    default="random",
    show_default=True,
    metavar="NAME",
    help="How samples are drawn: random, sobol, latin, or saltelli for Sobol indices.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@CHOICE
@FORMULATION
@click.option("--enforcement", metavar="NAME", help="How to stay on the constraints.")
@click.option("--alpha", type=POSITIVE, metavar="1/S", help="Rate of baumgarte and feedback.")
@click.option("--integrator", default="dop853", show_default=True, metavar="NAME")
@click.option("--step-size", type=POSITIVE, metavar="S", help="Equal steps of at most this size.")
@click.option(
    "--time",
    "--until",
    "time",
    type=POSITIVE,
    default=10.0,
    show_default=True,
    metavar="S",
    help="The last time, in seconds.",
)
@click.option("--start", type=FINITE, default=0.0, show_default=True, metavar="S")
@click.option(
    "--step",
    type=POSITIVE,
    metavar="S",
    help="Between the rows that highest, lowest, mean and rms look at (default: a "
    "five-hundredth of the time).",
)
@click.option("--rtol", type=POSITIVE, default=1e-9, show_default=True)
@click.option("--atol", type=POSITIVE, help="Default: a hundredth of rtol.")
@REAL
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="NAME=VALUE",
    help="A value of all motions; may be repeated.",
)
@click.option(
    "--input",
    "inputs",
    multiple=True,
    metavar="NAME=FILE[:KIND]",
    help="An input over time, of all motions; may be repeated.",
)
@click.option("--at", metavar="NAME", help="The steady motion whose growth is kept.")
@click.option(
    "--reduce", is_flag=True, help="Keep no rows: means, deviations, quantiles and extremes only."
)
@click.option("--chunk", type=click.IntRange(1), metavar="N", help="Motions in one piece of work.")
@click.option(
    "--failures",
    type=click.FloatRange(0.0, 1.0),
    default=0.1,
    show_default=True,
    metavar="PART",
    help="The part of all motions that may fail; with more the sweep ends.",
)
@click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="here (threads), processes, local (dask on this machine), or the address of a dask "
    "scheduler, tcp://HOST:PORT (default: here).",
)
@click.option("--workers", type=click.IntRange(1), metavar="N", help="Of this machine.")
def sweep(
    model: str,
    vary: Sequence[str],
    keep: Sequence[str],
    settings: Sequence[str],
    inputs: Sequence[str],
    **options: Any,
) -> Any:
    """Make many motions of MODEL, here or on a cluster, and keep what is asked for of each."""
    from hamel.engines import KNOWN, is_engine
    from hamel.progress import counted

    scheduler = options["scheduler"]
    if not is_engine(scheduler):
        raise click.BadParameter(
            f"'{scheduler}' is no engine; known: {KNOWN}", param_hint="--scheduler"
        )
    files = [text for text in vary if "=" not in text]
    varied = values_by_name([text for text in vary if "=" in text], "--vary")
    with counted("sweeping") as progress:
        return hamel.sweep(
            model,
            vary=varied,
            files=files,
            keep=keep or ("state",),
            values=values_by_name(settings),
            inputs=values_by_name(inputs, "--input"),
            progress=progress,
            **options,
        )


@verb
@model_argument
@click.option(
    "--at",
    metavar="NAME",
    help="A steady motion of the file, or guess: near the initial values (default: its first).",
)
@CHOICE
@click.option(
    "--sweep",
    multiple=True,
    metavar="NAME=A:B:N",
    help="Range of a free name or parameter; give two for a map.",
)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="NAME=VALUE",
    help="A free name or parameter, or where the search starts (a coordinate or velocity); may be "
    "repeated.",
)
@click.option(
    "-o",
    "--out",
    metavar="DIR|FILE.html",
    help="Where linearization.html goes: equations, plots, modes (default: here; with --json "
    "none).",
)
@click.option(
    "--step",
    type=POSITIVE,
    metavar="S",
    help="Also in discrete time: the step in seconds (in --json: Phi, Gamma).",
)
@click.option(
    "--cyclic",
    metavar="a,b|none",
    help="Coordinates to leave out of the eigenvalues (default: all cyclic ones).",
)
def linearize(
    model: str, sweep: Sequence[str], settings: Sequence[str], cyclic: str | None, **options: Any
) -> Any:
    """Linearise MODEL along a steady motion in minimal states, and find its eigenvalues."""
    ranges = values_by_name(sweep, "--sweep")
    left_out = None if cyclic is None else () if cyclic.strip() == "none" else name_list(cyclic)
    if not click.get_current_context().params["as_json"]:
        options["out"] = options["out"] or "."
    return hamel.linearize(
        model,
        sweep=ranges,
        values=values_by_name(settings),
        cyclic=left_out,
        **options,
    )


@verb
@model_argument
@CHOICE
@FORMULATION
@click.option(
    "-o",
    "--out",
    metavar="DIR",
    help="Where derivation.html and derivation.tex go (default: here).",
)
@click.option(
    "--road",
    metavar="NAME[,NAME]",
    default="block_inversion",
    show_default=True,
    help="The way to the equations, or two side by side: block_inversion, maggi, kane, "
    "boltzmann_hamel, gibbs_appell, multipliers, udwadia_kalaba.",
)
@click.option(
    "--pdf", is_flag=True, help="Typeset derivation.pdf too, where pdflatex is installed."
)
@click.option(
    "--live",
    is_flag=True,
    help="The page computes: sliders, the mechanism moving, numbers of every equation. It needs a "
    "compiler for WebAssembly.",
)
def derive(model: str, road: str, **options: Any) -> Any:
    """Write the derivation of MODEL to read."""
    return hamel.derive(model, road=name_list(road), **options)


@verb
@model_argument
@click.option(
    "-o",
    "--out",
    metavar="FILE",
    help="FILE.svg, or FILE.tex for a TikZ picture (default: <model>.svg here).",
)
def draw(model: str, out: str | None) -> Any:
    """Draw the mechanism of MODEL as a textbook does."""
    return hamel.draw(model, out=out)


@verb
@click.argument("models", nargs=-1, required=True, metavar="MODEL...")
@click.option(
    "-o", "--out", metavar="DIR", default="book", show_default=True, help="The folder of the book."
)
@click.option("--title", default="Mechanisms", show_default=True, metavar="TEXT", help="On top.")
@click.option(
    "--pdf/--no-pdf", default=True, help="Print book.pdf too, where a Chromium is installed."
)
@click.option("--workers", type=click.IntRange(1), metavar="N", help="Processes (default: cores).")
def book(models: Sequence[str], **options: Any) -> Any:
    """Write a book with a chapter for every MODEL: derivation, motion, exercises with solutions."""
    from hamel.progress import bar

    with bar(1.0) as progress:
        return hamel.book(models, progress=progress, **options)


@verb
@functools.partial(model_argument, name="robot")
@click.option(
    "-o", "--out", metavar="FILE.yaml", help="Write the model to FILE (default: print it)."
)
def import_(robot: str, out: str | None) -> Any:
    """Turn ROBOT, a URDF or MJCF file, into a model file to go on editing."""
    return hamel.import_(robot, out=out)


@verb
@model_argument
@click.option(
    "--time", is_flag=True, help="Compile each choice and measure how long its dynamics take."
)
@click.option(
    "--plot", metavar="FILE", help="Draw cond [A; B] of each choice along the motion to FILE.svg."
)
@click.option(
    "--until",
    type=POSITIVE,
    default=10.0,
    show_default=True,
    metavar="S",
    help="The end of that motion, in seconds.",
)
def choices(model: str, **options: Any) -> Any:
    """Rank MODEL's choices of quasi-velocities, and say why."""
    return hamel.choices(model, **options)


@verb
@functools.partial(model_argument, required=False)
def list_(model: str | None) -> Any:
    """Name all that hamel knows, or all that MODEL names."""
    return hamel.list(model)


@verb
@model_argument
@CHOICE
@CONSTANTS
def explain(model: str, choice: str | None, constants: str) -> Any:
    """Say why MODEL's module looks as it does."""
    return hamel.explain(model, choice=choice, constants=constant_names(constants))


@verb
@click.option("--page", is_flag=True, help="The reference of the language in Markdown instead.")
def schema(page: bool) -> Any:
    """Print the JSON Schema of model files, or their reference."""
    return hamel.schema(page=page)


def main(arguments: Sequence[str] | None = None) -> None:
    """The command `hamel`; ends the process with a documented exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(
                errors="replace"
            )  # a terminal without φ gets a question mark, not a traceback
    if arguments is None:  # this process is ours
        gc.set_threshold(YOUNG)
        os.environ.setdefault(
            "OPENBLAS_THREAD_TIMEOUT", "4"
        )  # NumPy's threads sleep at once; others have work for the cores
    code = failures.guarded(
        lambda: group.main(given, prog_name="hamel", standalone_mode=False), given
    )
    if arguments is None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is done and said: too late to interrupt,
        # and nothing is worth looking for garbage in, which Python does several times when it ends
        gc.freeze()
        if code == failures.INTERRUPTED:  # Python itself may end by the signal, with another code
            sys.stdout.flush()
            os._exit(code)
    sys.exit(code)
