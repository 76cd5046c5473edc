"""Simulation: a loop of steps around `dynamics`, with the integrators asked for, in C and, without
a compiler, in NumPy."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from codegen import text
from codegen.integrators import INTEGRATORS, Collocation, Integrator, Rosenbrock, Tableau
from codegen.program import CALLED, Chart, Program
from codegen.reals import Real
from codegen.targets.nullspace import framed
from codegen.targets.records import Target

# The head of a simulation's array.
ENTRIES = (
    ("INTEGRATOR", "which integrator, by number"),
    ("ENFORCEMENT", "which enforcement, by number"),
    ("FIXED", "the size of equal steps; 0 lets the tolerance decide"),
    ("T", "time"),
    ("DONE", "output times reached"),
    ("STEPS", "accepted steps"),
    ("REJECTED", "rejected steps"),
    ("CALLS", "evaluations of dynamics"),
    ("POSITION", "largest violation of a position constraint after a step"),
    ("VELOCITY", "largest violation of a velocity constraint after a step"),
    ("PASSED", "singular positions that were crossed"),
    ("CHARTS", "charts that were used"),
    ("STEP", "size of the next step"),
    ("ERROR", "error of the last step, for the step control"),
)
# More of it where the module has several charts.
OF_CHARTS = (
    ("CHOICE", "the chart that the state is in, by number"),
    ("SWITCHES", "changes of the chart"),
)
# And where it has a frame.
OF_FRAMES = (("BASES", "how often the frame was based anew"),)
# The smallest pivot of A, rows of length one, from which a stop is the choice's own: farther from a
# loss of rank than a motion stops before one.
INDEPENDENT = 0.02
NEARLY_BASED = 0.9  # where a step fails the frame is based anew unless it is as good as new
CHARTS = ("partitioning", "selective", "tangent")  # enforcements of simulate_charts.c.j2
MANIFOLDS = ("invariants", "invariants_euclidean")  # enforcements of simulate_enforcements.c.j2


@dataclass(frozen=True)
class Choice:
    """A chart as text: the C function that stands for each name, and how many guards it has."""

    choice: str
    suffix: str
    functions: dict[str, str]
    guards: int


@dataclass(frozen=True)
class Scheme:
    """An integrator as text. A tableau has C expressions: per stage after the first c and Σ a k,
    and the error estimates."""

    method: Integrator
    kind: str  # the macro of simulate_steps.c.j2
    grow: str
    damp: str
    safety: str
    stages: tuple[tuple[str, str], ...] = ()
    errors: tuple[str, ...] = ()
    weighted: frozenset[int] = (
        frozenset()
    )  # stages that count in the step or its error: the work is wanted there
    tables: dict[str, str] = field(default_factory=dict)  # of numbers, as C initialisers


def files(program: Program) -> dict[str, str]:
    """NAME_simulate.h, NAME_simulate.c and _simulate.py."""
    if not program.simulates:
        return {}
    sizes = {kernel.name: kernel.shape[0] for kernel in program.kernels}
    tabled = _tabled(program, sizes)
    charts = [_choice(program, chart, sizes, tabled) for chart in program.charts]
    if most := max((chart.guards for chart in charts), default=0):
        sizes["guards"] = most
    chosen = [x for name in program.integrators for x in INTEGRATORS if x.name == name]
    has = {
        name: name in sizes for name in ("power", "project", "constraints", "guards", "manifold")
    }
    has["project"] &= has["manifold"] or "projection" in program.enforcements
    has["charts"] = any(name in CHARTS for name in program.enforcements)
    has["constants"] = (
        not program.charts and not program.frame and program.kernel("dynamics").hoisted is not None
    )
    has["rows"] = "constraint_rows" in sizes
    has["linear"] = has["charts"] or any(x.needs for x in chosen)
    rows = {name: sizes.get(name, 0) for name in ("closure", "slip", "manifold", "guards")}
    rows["closing"] = sum(
        label in _labels(program, "closure") for label in _labels(program, "slip")
    )
    nq = len(program.argument("x").names) - len(program.quasi_velocities)
    has["rosenbrock"] = any(isinstance(x, Rosenbrock) for x in chosen)
    stages = max((len(x.c) for x in chosen if isinstance(x, Collocation)), default=0)
    number_of_frame = framed(program) if program.frame else 0
    data = {
        "program": program,
        "prefix": program.name,
        "PREFIX": program.name.upper(),
        "has": has,
        "positions": program.positions,
        "size": len(program.argument("x").names) + 1,
        "entries": (
            *ENTRIES,
            *(OF_CHARTS if charts else ()),
            *(OF_FRAMES if program.frame else ()),
        ),
        "framed": number_of_frame,
        "suffix": program.charts[number_of_frame].suffix if program.charts else "",
        "independent": INDEPENDENT,
        "nearly": NEARLY_BASED,
        "charts": charts,
        "tabled": tabled,
        "calls": {
            name: f"here(r)->{name}" if name in tabled else f"{program.name}_{name}"
            for name in CALLED
        },
        "guards": _guards(program),
        "rows": rows,
        "nq": nq,
        "chart_names": CHARTS,
        "manifold_names": MANIFOLDS,
        "blocks": _blocks(has, rows, nq, len(program.quasi_velocities), stages, program),
        "turn": _turn(program.real),
        "turning_names": ", ".join(program.argument("x").labels[i] for i in program.turning),
        "schemes": [_scheme(x) for x in chosen],
    }
    return {
        f"{program.name}_simulate.h": text.render("simulate.h.j2", **data),
        f"{program.name}_simulate.c": text.render("simulate.c.j2", **data),
        "_simulate.py": text.render(
            "simulate.py.j2",
            tableaux=[_python(x) for x in chosen if isinstance(x, Tableau)],
            **data,
        ),
    }


def _tabled(program: Program, sizes: Mapping[str, int]) -> tuple[str, ...]:
    """What differs between the charts."""
    return tuple(
        name
        for name in CALLED
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


def _guards(program: Program) -> dict[str, str]:
    """How many guards there are at most, and in the chart that is used."""
    count = f"{program.name.upper()}_N_GUARDS"
    return (
        {"most": "MOST_GUARDS", "here": "here(r)->count"}
        if program.charts
        else {"most": count, "here": count}
    )


def _labels(program: Program, name: str) -> tuple[str, ...]:
    return next((kernel.labels for kernel in program.kernels if kernel.name == name), ())


def _blocks(
    has: dict[str, bool], rows: dict[str, int], nq: int, nw: int, stages: int, program: Program
) -> list[tuple[str, int, str]]:
    """What a simulation's array holds after state and slope: name, size, meaning."""
    found = []
    if has["guards"]:
        found.append(
            (
                "GUARDS",
                3 * rows["guards"],
                "what tells the branch: last values, largest sizes, rates",
            )
        )
    if has["manifold"]:
        held = rows["manifold"] - rows["closure"] - rows["slip"]
        found.append(("HELD", held, "the invariants at the start"))
    if has["charts"]:
        size = rows["closure"] * (nq + rows["closure"]) + rows["slip"] * nw + 1
        found.append(
            ("CHART", size, "the directions of the chart, and the inverse that goes with them")
        )
    if stages:
        size = 2 + (stages + 1) * (nq + nw)
        found.append(
            (
                "COLLOCATED",
                size,
                "the last implicit step, which foretells the next: time, size, start, stages",
            )
        )
    if program.frame:
        found.append(("FRAME", program.frame, "the frame in force, as at the end of p"))
    if program.turning:  # the last
        found.append(("TURNS", nq, "whole turns that were taken out of each coordinate"))
    return found


def _turn(real: Real) -> tuple[str, str]:
    """2π in two parts: the nearest number, and what is left."""
    nearest = float(real.nearest(2 * math.pi))
    return repr(nearest), repr(2 * math.pi - nearest + 2.4492935982947064e-16)


def _scheme(method: Integrator) -> Scheme:
    grow, damp, safety = _control(method)
    kind = type(method).__name__.lower()
    if isinstance(method, Tableau):
        stages = tuple((number(c), combination(a)) for c, a in zip(method.c[1:], method.a[1:]))
        weighted = frozenset(
            i for row in (method.a[-1], *method.errors) for i, weight in enumerate(row) if weight
        )
        return Scheme(
            method,
            kind,
            grow,
            damp,
            safety,
            stages,
            tuple(combination(error) for error in method.errors),
            weighted,
        )
    if isinstance(method, Rosenbrock):
        tables = {
            "a": _table(method.a, len(method.alpha)),
            "c": _table(method.c, len(method.alpha)),
            "alpha": _list(method.alpha),
            "gammas": _list(method.gammas),
            "gamma": number(method.gamma),
        }
        return Scheme(method, kind, grow, damp, safety, tables=tables)
    if isinstance(method, Collocation):
        tables = {
            "c": _list(method.c),
            "b": _list(method.b),
            "T": _table(method.T, len(method.c)),
            "inverse": _table(method.inverse, len(method.c)),
            "real": number(method.real),
            "pairs": _table(method.pairs, 2),
            "error": _list(method.error),
        }
        return Scheme(method, kind, grow, damp, safety, tables=tables)
    return Scheme(method, kind, grow, damp, safety)


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


def combination(weights: Sequence[Fraction]) -> str:
    terms = [(weight, f"k[{i}][i]") for i, weight in enumerate(weights) if weight]
    first = f"{number(terms[0][0])} * {terms[0][1]}"
    return first + "".join(f" {'-' if w < 0 else '+'} {number(abs(w))} * {k}" for w, k in terms[1:])


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
        "name": tableau.name,
        "order": tableau.order,
        **dict(zip(("grow", "damp", "safety"), _control(tableau))),
        "c": numbers(tableau.c),
        "a": [numbers(row) for row in tableau.a],
        "errors": [numbers(row) for row in tableau.errors],
    }


SIMULATE = Target("simulate", "integration in C and NumPy", files)
