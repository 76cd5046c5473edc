"""Simulation: a loop of steps around `dynamics`, with the integrators asked for, in C and, without
a compiler, in NumPy."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from codegen import text
from codegen.integrators import (
    INTEGRATORS,
    ROSENBROCK,
    TIGHT,
    Collocation,
    Dense,
    Integrator,
    Midpoint,
    Rosenbrock,
    Tableau,
    Taylor,
)
from codegen.passes.lanes import (
    WATCHED,
    does_work,
    has_looked,
    has_pairs,
    has_rates,
    has_slope,
    side_by_side,
)
from codegen.passes.taylor import HIGHEST, faster_from, in_pieces, series_in_lanes
from codegen.program import CALLED, CHART, Chart, Program
from codegen.reals import Real, recast
from codegen.targets.nullspace import framed, has_lengths
from codegen.targets.records import Target
from codegen.targets.schemes import python_numbers, scheme
from derive.enforcement import ENFORCEMENTS

# The head of a simulation: kind, name, meaning.
ENTRIES = (
    ("int", "integrator", "which integrator, by number"),
    ("int", "enforcement", "which enforcement, by number"),
    ("double", "step_size", "of equal steps; 0 lets the tolerance decide"),
    ("double", "t", "time"),
    ("long", "done", "output times reached"),
    ("long", "steps", "accepted steps"),
    ("long", "rejected", "rejected steps"),
    ("long", "calls", "evaluations of dynamics"),
    ("long", "crossings", "singular positions that were crossed"),
    ("long", "landings", "steps that end where forces go on to another piece"),
    ("long", "charts", "charts that an enforcement used"),
    ("double", "position_violation", "the largest of a position constraint after a step"),
    ("double", "velocity_violation", "the largest of a velocity constraint after a step"),
    ("double", "next_step", "size of the next step"),
    ("double", "error", "of the last step, for the step control; negative where it must not grow"),
)
# More of it where there are inputs.
OF_INPUTS = (
    ("int", "stale", "1 where u is another than in the call before: the slope is computed again"),
    ("{name}_inputs", "inputs", "what changes u on the way, NULL where nothing does"),
)
OF_EVENTS = (("{name}_watch", "events", "what is looked for on the way, NULL where nothing is"),)
# Where forces are in pieces.
OF_KINKS = (("int", "landed", "number of the kink that the last step ended at, from 1 on, or 0"),)
# Where the module has several charts.
OF_CHARTS = (
    ("int", "choice", "the chart that the state is in, by number"),
    ("long", "switches", "changes of the chart"),
)
# And where it has a frame.
OF_FRAMES = (("long", "bases", "how often the frame was based anew"),)
# And where it goes along Taylor series.
OF_SERIES = (
    ("int", "series_order", "order of the series that the last step went along"),
    ("int", "expanded", "is that the series from the state on?"),
)
# The smallest pivot of A, rows of length one, from which a stop is the choice's own: farther from a
# loss of rank than a motion stops before one.
INDEPENDENT = 0.02
NEARLY_BASED = 0.9  # where a step fails the frame is based anew unless it is as good as new
STEPPED = ("jacobian_u", "jacobian_forward")  # what the sensitivity of a step calls besides
CHARTS = tuple(e.name for e in ENFORCEMENTS if e.level == "stages")  # those by coordinates
STOPS = {e.name: e.stop for e in ENFORCEMENTS if e.stop}
FOLDER = Path(__file__).parents[1] / "runtime"
STEP = "runtime_step.h"  # for modules that have a step alone
OTHERS = ("runtime_fmi", "runtime_module")  # headers of FMUs and of the extension
RUNTIME = tuple(p for p in sorted(FOLDER.glob("runtime_*.h")) if not p.name.startswith(OTHERS))
# Python files that are the same in every folder
SHARED = (
    "simulation",
    "inputs",
    "events",
    "error",
    "runge_kutta",
    "model_facts",
    "simulate_face",
    "one_motion",
    "many_motions",
    "numpy_motion",
    "numpy_guards",
    "numpy_changes",
    "numpy_kinks",
    "numpy_loop",
)
_BESIDE = re.compile(r"^from \.(?=[a-z])", re.MULTILINE)  # imports of each other
MANIFOLDS = ("invariants", "invariants_euclidean")  # enforcements by invariants


@dataclass(frozen=True)
class Choice:
    """A chart as text: the C function that stands for each name, and how many guards it has."""

    choice: str
    suffix: str
    functions: dict[str, str]
    guards: int


def files(program: Program) -> dict[str, str]:
    """NAME_simulate.h, NAME_simulate.c, the runtime that it includes, and _simulate.py."""
    if not program.simulates:
        return {}
    data = _data(program)
    return {
        f"{program.name}_simulate.h": text.render("simulate.h.j2", **data),
        f"{program.name}_simulate.c": text.render("simulate.c.j2", **data),
        "_simulate.py": text.render("simulate.py.j2", tableaux=_tableaux(data["chosen"]), **data),
        **{f"_{name}.py": _python_file(name) for name in _python_files(program)},
        **{path.name: recast(path.read_text("utf-8"), program.real) for path in _runtime(program)},
    }


def _python_files(program: Program) -> tuple[str, ...]:
    return (*SHARED, *(("steps",) if program.steppers else ()))


def _python_file(name: str) -> str:
    """A file of the runtime as it stands in a folder, where the names of all begin with _."""
    return _BESIDE.sub("from ._", (FOLDER / f"{name}.py").read_text("utf-8"))


def _runtime(program: Program) -> list[Path]:
    return [path for path in RUNTIME if program.steppers or path.name != STEP]


def _tableaux(chosen: Sequence[Integrator]) -> dict[str, dict[str, object]]:
    return {x.name: python_numbers(x) for x in chosen if isinstance(x, Tableau)}


def _data(program: Program) -> dict[str, Any]:
    """What the templates are filled with."""
    sizes = {kernel.name: kernel.shape[0] for kernel in program.kernels}
    tabled = _tabled(program, sizes)
    charts = [_choice(program, chart, sizes, tabled) for chart in program.charts]
    if most := max((chart.guards for chart in charts), default=0):
        sizes["guards"] = most
    chosen = [x for name in program.integrators for x in INTEGRATORS if x.name == name]
    has, rows = _parts(program, sizes, chosen), _rows(program, sizes)
    nq = program.coordinates
    number_of_frame = framed(program) if program.frame else 0
    return {
        "program": program,
        "prefix": program.name,
        "PREFIX": program.name.upper(),
        "has": has,
        "flags": _flags(program, has, chosen),
        "positions": program.positions,
        "size": len(program.argument("x").names) + 1,
        "fields": fields(program),
        "charts": charts,
        "framed": number_of_frame,
        "suffix": program.charts[number_of_frame].suffix if program.charts else "",
        "independent": INDEPENDENT,
        "nearly": NEARLY_BASED,
        "tabled": tabled,
        "calls": _calls(program, sizes, tabled, has["constants"]),
        "enforcements": _numbered(program.enforcements),
        "faster_from": faster_from(program) if _highest(chosen) else 0.0,
        "tight": TIGHT,
        "staged": [name for name in program.enforcements if name in CHARTS],
        "stops": {name: STOPS[name] for name in program.enforcements if name in STOPS},
        "rows": rows,
        "lengths": _lengths(program, has, rows),
        "guards": [chart.guards for chart in charts] or [rows["guards"]],
        "lanes": side_by_side(program),
        "beside": _beside(program),
        "nq": nq,
        "turn": _turn(program.real),
        "turning_names": ", ".join(program.argument("x").labels[i] for i in program.turning),
        "chosen": chosen,
        "schemes": [scheme(x, bool(side_by_side(program))) for x in chosen],
        "implicit": scheme(ROSENBROCK),
        "alike": alike(program),
    }


def alike(program: Program) -> list[int]:
    """The first entry of x with the same unit as each."""
    units = program.argument("x").units
    first: dict[str, int] = {}
    return [first.setdefault(unit, i) for i, unit in enumerate(units)]


def _called(program: Program) -> tuple[str, ...]:
    """What `simulate` calls, and a step."""
    return (*CALLED, *(STEPPED if program.steppers else ()))


def _parts(
    program: Program, sizes: Mapping[str, int], chosen: Sequence[Integrator]
) -> dict[str, bool]:
    """Which parts of the runtime a module needs."""
    named = ("power", "project", "constraints", "guards", "manifold")
    has = {name: name in sizes for name in named}
    has["power"] = does_work(program)
    has["project"] &= has["manifold"] or "projection" in program.enforcements
    has["charts"] = any(name in CHARTS for name in program.enforcements)
    has["constants"] = (
        not program.charts and not program.frame and program.kernel("dynamics").hoisted is not None
    )
    has["rows"] = "constraint_rows" in sizes
    has["linear"] = has["charts"] or bool(program.steppers) or any(x.needs for x in chosen)
    return has


def _rows(program: Program, sizes: Mapping[str, int]) -> dict[str, int]:
    """Lengths of results; `closing`: rows of velocities that belong to a position."""
    named = ("constraints", "closure", "slip", "manifold", "guards", "velocity")
    rows = {name: sizes.get(name, 0) for name in named}
    closure = _labels(program, "closure")
    return {**rows, "closing": sum(label in closure for label in _labels(program, "slip"))}


def _lengths(program: Program, has: Mapping[str, bool], rows: Mapping[str, int]) -> dict[str, int]:
    """Of the results that the loop in NumPy asks for, 0 where it does not."""
    return {
        "velocity": rows["velocity"],
        "constraints": rows["constraints"],
        "power": int(has["power"]),
        "kinks": _kinks(program)["KINKS"],
        "project": len(program.argument("x").names) if has["project"] else 0,
    }


def _flags(
    program: Program, has: Mapping[str, bool], chosen: Sequence[Integrator]
) -> dict[str, int]:
    """Macros of the runtime."""
    explicit = [len(x.c) - 1 for x in chosen if isinstance(x, Tableau)]
    implicit = [*chosen, *([ROSENBROCK] if program.steppers else [])]
    rosenbrock = [len(x.alpha) for x in implicit if isinstance(x, Rosenbrock)]
    return {
        "HAS_INPUTS": int(bool(program.argument("u").names)),
        "HAS_POWER": int(has["power"]),
        "HAS_CONSTANTS": int(has["constants"]),
        "HAS_PROJECT": int(has["project"]),
        "HAS_CONSTRAINTS": int(has["constraints"]),
        "HAS_POSITIONS": int(has["constraints"] and program.positions > 0),
        "HAS_GUARDS": int(has["guards"]),
        "HAS_LENGTHS": int(bool(_highest(chosen)) and has_lengths(program)),
        "HAS_MANIFOLD": int(has["manifold"]),
        "HAS_COORDINATES": int(has["charts"]),
        "HAS_CHOICES": int(bool(program.charts)),
        "HAS_LANES": int(bool(side_by_side(program))),
        "HAS_LANES_CONSTANTS": int(program.kernel("dynamics").hoisted is not None),
        "HAS_LANES_RATES": int(has_rates(program)),
        "HAS_LANES_LOOKED": int(has_looked(program)),
        "HAS_LANES_PAIRS": int(has_pairs(program)),
        "HAS_LANES_SLOPE": int(has_slope(program)),
        "HAS_LANES_EVENTS": int(any(k.name == WATCHED for k in side_by_side(program))),
        "HAS_LANES_TAYLOR": int(bool(_highest(chosen)) and series_in_lanes(program)),
        "HAS_ROWS": int(has["rows"]),
        "FRAME": program.frame,
        "HAS_MIDPOINT": int(any(isinstance(x, Midpoint) for x in chosen)),
        "TURNING": len(program.turning),
        "EXPLICIT_STAGES": max(explicit, default=0),
        "ROSENBROCK_STAGES": max(rosenbrock, default=0),
        "COLLOCATION_STAGES": _stages(chosen),
        "HIGHEST_ORDER": _highest(chosen),
        "SERIES_IN_PIECES": int(bool(_highest(chosen)) and in_pieces(program)),
        "EVENTS": len(program.events),
        **_kinks(program),
        "DENSE_DEGREE": max(
            3, _stages(chosen), _highest(chosen), *(len(dense.powers) for dense in _dense(chosen))
        ),
        "DENSE_STAGES": max(0, 0, *(len(dense.c) for dense in _dense(chosen))),
    }


def _kinks(program: Program) -> dict[str, int]:
    """How many there are, and whether they depend on inputs."""
    kernel = program.kernel("kinks") if program.has("kinks") else None
    by_inputs = kernel is not None and "u" in kernel.uses
    return {"KINKS": kernel.shape[0] if kernel else 0, "KINKS_BY_INPUTS": int(by_inputs)}


def _dense(chosen: Sequence[Integrator]) -> list[Dense]:
    return [x.dense for x in chosen if isinstance(x, Tableau) and x.dense]


def _stages(chosen: Sequence[Integrator]) -> int:
    return max((len(x.c) for x in chosen if isinstance(x, Collocation)), default=0)


def _highest(chosen: Sequence[Integrator]) -> int:
    """Order of the Taylor series that are kept."""
    return HIGHEST if any(isinstance(x, Taylor) for x in chosen) else 0


def _calls(
    program: Program, sizes: Mapping[str, int], tabled: Sequence[str], constants: bool
) -> dict[str, str]:
    """The function that stands for each name."""
    own = {name: f"{program.name}_{name}" for name in _called(program) if name in sizes}
    if constants:
        own["dynamics"] += "_precomputed"
    return own | {name: f"here(r)->{name}" for name in tabled}


def _numbered(enforcements: Sequence[str]) -> list[str]:
    """Constants of an enumeration."""
    numbers = {name: i for i, name in enumerate(enforcements)}
    known = ("projection", "none", *MANIFOLDS, *CHARTS)
    return [f"{name.upper()} = {numbers.get(name, -1)}" for name in known]


def _tabled(program: Program, sizes: Mapping[str, int]) -> tuple[str, ...]:
    """What differs between the charts."""
    return tuple(
        name
        for name in _called(program)
        if any(chart.suffix and name + chart.suffix in sizes for chart in program.charts)
    )


def _choice(
    program: Program, chart: Chart, sizes: Mapping[str, int], tabled: Sequence[str]
) -> Choice:
    own = {name: name + chart.suffix for name in (*tabled, "velocity")}
    there = {name: full if full in sizes else name for name, full in own.items()}
    functions = {name: f"{program.name}_{full}" for name, full in there.items()}
    if f"guards{chart.suffix}" not in sizes:
        functions["guards"] = "none"
    return Choice(chart.choice, chart.suffix, functions, sizes.get(f"guards{chart.suffix}", 0))


def _beside(program: Program) -> dict[str, list[str]]:
    """For each function of a step side by side that of every chart, NULL where a chart has none."""
    there = [kernel.name for kernel in side_by_side(program) if kernel.name != "project"]
    found: dict[str, list[str]] = {}
    for name in dict.fromkeys(name.partition(CHART)[0] for name in there):
        shared = "" if name == "guards" else name  # guards are a chart's own
        own = [f"{name}{chart.suffix}" for chart in program.charts]
        named = [full if full in there else shared for full in own]
        found[name] = [f"{program.name}_{each}_lanes" if each else "NULL" for each in named]
    return found


def _labels(program: Program, name: str) -> tuple[str, ...]:
    return program.kernel(name).labels if program.has(name) else ()


def fields(program: Program) -> list[tuple[str, str, int, str]]:
    """Of a simulation, in their order: kind in C, name, length (0 of a number), meaning."""
    sizes = {kernel.name: kernel.shape[0] for kernel in program.kernels}
    chosen = [x for name in program.integrators for x in INTEGRATORS if x.name == name]
    has, rows = _parts(program, sizes, chosen), _rows(program, sizes)
    nx, nq = len(program.argument("x").names), program.coordinates
    guards = [
        sum(k.name == f"guards{chart.suffix}" and k.shape[0] for k in program.kernels)
        for chart in program.charts
    ]
    blocks = [
        ("x", nx + 1, "the state, then the work of forces without potential since the start"),
        ("slope", nx + 1, "its time derivative"),
        *_guarded(max(guards, default=rows["guards"])),
    ]
    if has["manifold"]:
        held = rows["manifold"] - rows["closure"] - rows["slip"]
        blocks.append(("held", held, "the invariants at the start"))
    if has["charts"]:
        nw = nx - nq - len(program.states)
        blocks += _coordinates(rows["closure"], rows["slip"], nq, nw)
    if stages := _stages(chosen):
        blocks += [
            ("collocated_t", 0, "the last implicit step, which foretells the next: its start"),
            ("collocated_h", 0, "its size"),
            ("collocated", (stages + 1) * nx, "its state at the start, then at its stages"),
        ]
    if highest := _highest(chosen):
        blocks += [
            ("series_t", 0, "where the series starts that the last step went along"),
            ("series", (highest + 1) * (nx + 1), "its coefficients, order by order"),
        ]
    if program.frame:
        blocks.append(("frame", program.frame, "the frame in force, as at the end of p"))
    if program.turning:
        blocks.append(("turns", nq, "whole turns that were taken out of each coordinate"))
    entries = (
        *ENTRIES,
        *(OF_INPUTS if program.argument("u").names else ()),
        *OF_EVENTS,
        *(OF_KINKS if program.has("kinks") else ()),
        *(OF_CHARTS if program.charts else ()),
        *(OF_FRAMES if program.frame else ()),
        *(OF_SERIES if _highest(chosen) else ()),
    )
    head = [(kind.format(name=program.name), name, 0, about) for kind, name, about in entries]
    scalars = ("collocated_t", "collocated_h", "side", "velocity_side", "series_t")
    body = [("double", *block) for block in blocks if block[1] or block[0] in scalars]
    return [*head, *body]


def _guarded(count: int) -> list[tuple[str, int, str]]:
    return [
        ("guard", count, "what must not vanish on the way, at the last step"),
        ("guard_size", count, "the largest sizes of these"),
        ("guard_rate", count, "the rates of their sizes"),
    ]


def _coordinates(closure: int, slip: int, nq: int, nw: int) -> list[tuple[str, int, str]]:
    return [
        ("position_directions", closure * nq, "along which positions are solved"),
        ("position_inverse", closure * closure, "of their Jacobian along these"),
        ("velocity_directions", slip * nw, "along which velocities are solved"),
        ("side", 0, "of the position constraints, where the directions were chosen"),
        ("velocity_side", 0, "of the velocity constraints likewise"),
    ]


def _turn(real: Real) -> tuple[str, str]:
    """2π in two parts: the nearest number, and what is left."""
    nearest = float(real.nearest(2 * math.pi))
    return repr(nearest), repr(2 * math.pi - nearest + 2.4492935982947064e-16)


SIMULATE = Target("simulate", "integration in C and NumPy", files)


def run_data(program: Program) -> dict[str, Any]:
    """What templates of a whole run need: what `simulate` gives besides x and the work, by name
    and width of a row."""
    nx, nw = len(program.argument("x").names), len(program.quasi_velocities)
    rows = {"x": nx, "work": 1}
    if program.charts:
        rows |= {"v": program.kernel("velocity").shape[0], "chart": 1}
    if program.frame:
        rows["frame"] = program.frame
    return {
        "prefix": program.name,
        "PREFIX": program.name.upper(),
        "nx": nx,
        "nu": len(program.argument("u").names),
        "np": len(program.argument("p").names),
        "nw": nw,
        "rows": rows,
    }
