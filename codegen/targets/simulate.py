"""Simulation: a loop of steps around `dynamics`, with the integrators asked for, in C and, without
a compiler, in NumPy."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
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
from codegen.integrators.records import centred, collocated
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
from codegen.program import CALLED, Chart, Program
from codegen.reals import Real, recast
from codegen.targets.nullspace import framed
from codegen.targets.records import Target
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
KINDS: dict[type, str] = {
    Tableau: "explicit",
    Rosenbrock: "rosenbrock",
    Collocation: "collocation",
    Midpoint: "midpoint",
    Taylor: "taylor",
}
MANIFOLDS = ("invariants", "invariants_euclidean")  # enforcements by invariants


@dataclass(frozen=True)
class Choice:
    """A chart as text: the C function that stands for each name, and how many guards it has."""

    choice: str
    suffix: str
    functions: dict[str, str]
    guards: int


@dataclass(frozen=True)
class Scheme:
    """An integrator as text: the function of runtime_steps.h that steps, its coefficients as C, and
    its step control."""

    method: Integrator
    kind: str  # of the function KIND_step
    grow: str
    damp: str
    safety: str
    data: tuple[str, ...] = ()  # lines of C that define the coefficients
    coefficients: str = "NULL"  # their address


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
    return {x.name: _python(x) for x in chosen if isinstance(x, Tableau)}


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
        "nq": nq,
        "turn": _turn(program.real),
        "turning_names": ", ".join(program.argument("x").labels[i] for i in program.turning),
        "chosen": chosen,
        "schemes": [_scheme(x, bool(side_by_side(program))) for x in chosen],
        "implicit": _scheme(ROSENBROCK),
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
        "HAS_MANIFOLD": int(has["manifold"]),
        "HAS_COORDINATES": int(has["charts"]),
        "HAS_CHOICES": int(bool(program.charts)),
        "HAS_LANES": int(bool(side_by_side(program))),
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
    scalars = ("collocated_t", "collocated_h", "side", "series_t")
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
    ]


def _turn(real: Real) -> tuple[str, str]:
    """2π in two parts: the nearest number, and what is left."""
    nearest = float(real.nearest(2 * math.pi))
    return repr(nearest), repr(2 * math.pi - nearest + 2.4492935982947064e-16)


def _scheme(method: Integrator, lanes: bool = False) -> Scheme:
    """The method as text, with what several motions side by side need of it where there are
    `lanes`."""
    grow, damp, safety = _control(method)
    kind, name = KINDS[type(method)], method.name
    if isinstance(method, Midpoint | Taylor):
        return Scheme(method, kind, grow, damp, safety)
    if isinstance(method, Tableau):
        data = [*(_sums(method) if lanes else []), *_tableau(method, lanes)]
    elif isinstance(method, Rosenbrock):
        data = _initialised("Rosenbrock", name, _rosenbrock(method))
    else:
        data = _initialised("Collocation", name, _collocation(method))
    return Scheme(method, kind, grow, damp, safety, tuple(data), f"&{name}")


def _initialised(kind: str, name: str, values: Sequence[str]) -> list[str]:
    return [f"static const {kind} {name} = {{", *(f"    {value}," for value in values), "};"]


Term = tuple[int, Fraction]  # a slope and its weight


def _terms(method: Tableau) -> list[list[Term]]:
    """Rows without their zeros: stages, estimates of the error, stages of the continuous output and
    its powers."""
    dense = method.dense or Dense(0, (), (), ())
    powers = (
        centred(((Fraction(0),) * len(dense.powers[0]), *dense.powers))
        if dense.c or dense.powers
        else ()
    )
    rows = [*method.a[1:], *method.errors, *dense.a, *powers]
    return [[(j, weight) for j, weight in enumerate(row) if weight] for row in rows]


def _sums(method: Tableau) -> list[str]:
    """A function with the sums of all rows written out, for several motions side by side."""
    terms = _terms(method)
    extra = len(method.dense.c) if method.dense else 0
    stages, errors = len(method.a) - 1, len(method.errors)
    powers = stages + errors + extra
    inside = {*range(stages - 1), *range(stages + errors, powers)}  # where nobody asks for the work
    macros = {n: "INSIDE" if n in inside else "MOVED" for n in (*inside, stages - 1, powers)}
    return [
        f"static void {method.name}_sums(int n, const double *restrict k, "
        "const double *restrict h, const double *restrict y, double *restrict z)",
        "{",
        "    int i;",
        "    switch (n) {",
        *(line for n, row in enumerate(terms) for line in _sum(n, row, macros.get(n, "CHANGE"))),
        "    }",
        "}",
    ]


def _sum(n: int, row: Sequence[Term], macro: str) -> list[str]:
    """Row n as a case of the function of sums. Compilers that contract take the first product into
    the first sum: with the second one there, roundings are those of the loop over the row."""
    turned = [*row[1:2], *row[:1], *row[2:]]
    products = [f"{number(weight)} * SLOPE({j})" for j, weight in turned] or ["0.0 * SLOPE(0)"]
    lines = textwrap.wrap(" + ".join(products), 120, break_long_words=False)
    last = len(lines) - 1
    return [
        f"    case {n}:",
        *(
            f"        {f'{macro}(' if i == 0 else '    '}{line}{')' if i == last else ''}"
            for i, line in enumerate(lines)
        ),
        "        break;",
    ]


def _tableau(method: Tableau, lanes: bool) -> list[str]:
    """Rows without their zeros, one after the other."""
    dense = method.dense or Dense(0, (), (), ())
    terms = _terms(method)
    starts = [sum(map(len, terms[:n])) for n in range(len(terms) + 1)]
    used = {j for row in (method.a[-1], *method.errors) for j, weight in enumerate(row) if weight}
    stages, name = len(method.c) - 1, method.name
    weighted = sum(1 << n for n in used | {stages})
    weights = [number(weight) for row in terms for _, weight in row]
    (a, b), rough = _insides(method) if method.dense else (0, 0), "NULL"
    through: list[str] = []
    if lanes and method.dense:
        rough = f"{name}_rough[0]"
        rows = (_list(row) for row in _rough(method.c[a], method.c[b]))
        through = [f"static const double {name}_rough[8][6] = {{{', '.join(rows)}}};"]
    return [
        *through,
        f"static const double {name}_c[] = {_list((*method.c[1:], *dense.c))};",
        f"static const int {name}_row[] = {_listed(starts)};",
        f"static const unsigned char {name}_at[] = {_listed(j for row in terms for j, _ in row)};",
        f"static const double {name}_weight[] = {_listed(weights)};",
        f"static const Tableau {name} = {{{stages}, {len(method.errors)}, {weighted}ul, "
        f"{name}_c, {name}_row, {name}_at, {name}_weight, {len(dense.c)}, {len(dense.powers)}"
        f"{f', {name}_sums, {int(_is_late(method))}, {{{a}, {b}}}, {rough}' if lanes else ''}}};",
    ]


def _insides(method: Tableau) -> tuple[int, int]:
    """The stages that the step is made of nearest to its first and to its third quarter."""
    used = [j for j, weight in enumerate(method.a[-1]) if weight and 0 < method.c[j] < 1]
    first, third = (min(used, key=lambda j: abs(method.c[j] - Fraction(k, 4))) for k in (1, 3))
    return first, third


def _rough(first: Fraction, third: Fraction) -> list[list[Fraction]]:
    """The polynomial of degree 5 through both ends of a step, with their slopes and those of two
    stages: its powers of sigma = 2 theta - 1 from y, z and h times the slopes, and its values after
    one and two thirds of the step."""
    places = [Fraction(-1), Fraction(1)]
    slopes = [*places, 2 * first - 1, 2 * third - 1]
    rows = [[place**n for n in range(6)] for place in places]
    rows += [[n * place ** (n - 1) if n else Fraction(0) for n in range(6)] for place in slopes]
    scales = [Fraction(1)] * 2 + [Fraction(1, 2)] * 4  # a slope by sigma is half of one by theta
    unit = [[scales[i] if i == k else Fraction(0) for k in range(6)] for i in range(6)]
    powers = _solved([row + right for row, right in zip(rows, unit)])
    thirds = [Fraction(-1, 3), Fraction(1, 3)]
    return [*powers, *([_polynomial(each, sigma) for each in zip(*powers)] for sigma in thirds)]


def _polynomial(coefficients: Sequence[Fraction], sigma: Fraction) -> Fraction:
    return sum((a * sigma**n for n, a in enumerate(coefficients)), Fraction(0))


def _solved(rows: list[list[Fraction]]) -> list[list[Fraction]]:
    """The right halves, by Gauss and Jordan."""
    count = len(rows)
    for i in range(count):
        pivot = next(k for k in range(i, count) if rows[k][i])
        rows[i], rows[pivot] = rows[pivot], rows[i]
        rows[i] = [value / rows[i][i] for value in rows[i]]
        for k in range(count):
            if k != i:
                rows[k] = [a - rows[k][i] * b for a, b in zip(rows[k], rows[i])]
    return [row[count:] for row in rows]


def _is_late(method: Tableau) -> bool:
    """Whether the last slope counts in no error, and the one before it is at the end, too."""
    return method.c[-2] == 1 and not any(row[-1] for row in method.errors)


def _listed(values: Iterable[object]) -> str:
    return "{" + ", ".join(map(str, values)) + "}"


def _rosenbrock(method: Rosenbrock) -> list[str]:
    width = len(method.alpha)
    return [
        number(method.gamma),
        _list(method.alpha),
        _list(method.gammas),
        _table(method.a, width),
        _table(method.c, width),
        _table(method.dense, width),
    ]


def _collocation(method: Collocation) -> list[str]:
    width = len(method.c)
    return [
        _list(method.c),
        _list(method.b),
        _table(method.T, width),
        _table(method.inverse, width),
        number(method.real),
        _table(method.pairs, 2),
        _list(method.error),
        _table(centred(collocated(method.c)), width),
    ]


def _control(method: Integrator) -> tuple[str, str, str]:
    """Exponents of the error and of the one before, and the safety."""
    grow = Fraction(1, method.estimate) - Fraction(3, 4) * method.damping
    return number(grow), number(method.damping), number(method.safety)


def number(value: Fraction) -> str:
    """A constant expression: 3.0 / 40.0, or a decimal where the fraction is long."""
    if value.denominator == 1:
        return f"{value.numerator}.0"
    if max(abs(value.numerator), value.denominator) < 10**6:
        return f"{value.numerator}.0 / {value.denominator}.0"
    return repr(float(value))


def _list(values: Sequence[Fraction]) -> str:
    return "{" + ", ".join(number(value) for value in values) + "}"


def _table(rows: Sequence[Sequence[Fraction]], width: int) -> str:
    """Rows filled up with zeros."""
    return "{" + ", ".join(_list([*row, *[Fraction(0)] * (width - len(row))]) for row in rows) + "}"


def _python(tableau: Tableau) -> dict[str, object]:
    """A tableau as text of Python numbers."""

    def numbers(values: Sequence[Fraction]) -> str:
        return "[" + ", ".join(number(value) for value in values) + "]"

    return {
        **dict(zip(("grow", "damp", "safety"), _control(tableau))),
        "c": numbers(tableau.c),
        "a": [numbers(row) for row in tableau.a],
        "errors": [numbers(row) for row in tableau.errors],
        "dense": tableau.dense
        and {
            "c": numbers(tableau.dense.c),
            "a": [numbers(row) for row in tableau.dense.a],
            "powers": [numbers(row) for row in tableau.dense.powers],
        },
    }


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
