"""An FMU for Model Exchange and Co-Simulation by FMI 3.0 (fmi-standard.org): a table of the model
for the C of the runtime, modelDescription.xml, and the script that packs them with the library and
its sources into NAME.fmu."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import codegen.runtime.build_fmu
from codegen import text
from codegen.integrators import INTEGRATORS
from codegen.program import Kernel, Program
from codegen.targets.records import Target, unsteady
from derive.expressions.quantities import unit as unit_of
from derive.expressions.units import BASE

FOLDER = Path(__file__).parents[1] / "runtime"
RUNTIME = tuple(
    path.name for path in sorted(FOLDER.glob("runtime_fmi*.h")) if "fmi2" not in path.name
)
# functions whose results are variables, the outputs first and what makes event indicators last
GROUPS = ("outputs", "reactions", "energy", "power", "events")
NAMED = {"energy": ("kinetic_energy", "potential_energy"), "power": ("power",)}
TABLED = (
    "dynamics",
    "project",
    "constraints",
    "dynamics_forward",
    "dynamics_adjoint",
    "jacobian",
    "jacobian_u",
    "jacobian_p",
    "outputs_jacobian",
)
DERIVATIVES = TABLED[3:]
TAKER = "an FMU"
NEEDS = ("dynamics_forward", "dynamics_adjoint", "outputs", "outputs_jacobian")
SHORTEST = 1e-9  # m, of a nominal length
STOP_TIME = 10.0  # s, of the experiment that a tool proposes; a model says nothing of it


@dataclass(frozen=True)
class Variable:
    """A variable of modelDescription.xml. `start` is text; `derivative` refers to the state whose
    rate it is."""

    reference: int
    name: str
    causality: str
    variability: str
    initial: str = ""
    start: str = ""
    unit: str = ""
    derivative: int | None = None
    about: str = ""
    reinit: bool = False  # may an event change it?
    nominal: str = ""


@dataclass(frozen=True)
class Unknown:
    """An entry of ModelStructure; `dependencies` None stands for all there are."""

    reference: int
    dependencies: tuple[int, ...] | None = None

    @property
    def listed(self) -> str:
        """The dependencies as the text of an attribute."""
        return " ".join(map(str, self.dependencies or ()))


@dataclass(frozen=True)
class References:
    """The first value reference of each kind; time is 0."""

    states: int
    rates: int
    inputs: int
    parameters: int
    groups: int
    constants: int


def files(program: Program) -> dict[str, str]:
    """NAME_fmi.c, modelDescription.xml, build_fmu.py and the runtime."""
    data = described(program)
    script = Path(codegen.runtime.build_fmu.__file__).read_text("utf-8")
    return {
        f"{program.name}_fmi.c": text.render("fmi.c.j2", older=False, **data),
        "modelDescription.xml": text.render("model_description.xml.j2", **data),
        "build_fmu.py": script.replace('NAME = ""', f'NAME = "{program.name}"', 1),
        **{name: (FOLDER / name).read_text("utf-8") for name in RUNTIME},
    }


def refusal(program: Program) -> str:
    """Why there is no FMU of a program; nothing where there is one."""
    reason = unsteady(program, TAKER)
    if reason:
        return reason
    if program.real.words:
        return f"an FMU computes in float64, not in {program.real.name}"
    if _integrator(program) is None:
        return "Co-Simulation needs an integrator with step control, such as dop853"
    return ""


def _integrator(program: Program) -> int | None:
    """The first one with step control, by number."""
    adaptive = {method.name for method in INTEGRATORS if method.adaptive}
    numbers = [n for n, name in enumerate(program.integrators) if name in adaptive]
    return numbers[0] if numbers else None


def described(program: Program) -> dict[str, Any]:
    """What the templates are filled with."""
    groups = [program.kernel(name) for name in GROUPS if program.has(name)]
    at = _references(program, groups)
    variables = _variables(program, groups, at)
    derivatives = _has_derivatives(program)
    tabled = {name: program.has(name) for name in TABLED}
    for name in DERIVATIVES:
        tabled[name] &= derivatives
    violations = program.kernel("constraints").shape[0] if program.has("constraints") else 0
    return {
        "program": program,
        "prefix": program.name,
        "PREFIX": program.name.upper(),
        "groups": groups,
        "tabled": tabled,
        "violations": violations,
        "derivatives": derivatives,
        "integrator": _integrator(program),
        "variables": variables,
        "units": _units(variables),
        "structure": _structure(program, variables, groups, at),
        "starts": _starts(program),
        "nominals": _nominals(program),
        "stops": any(event.stop for event in program.events),
        "stop_time": STOP_TIME,
    }


def _references(program: Program, groups: Sequence[Kernel]) -> References:
    nx, nu, np = (len(program.argument(name).names) for name in "xup")
    inputs = 1 + 2 * nx
    behind = inputs + nu + np
    count = sum(kernel.shape[0] for kernel in groups)
    return References(1, 1 + nx, inputs, inputs + nu, behind, behind + count)


def _has_derivatives(program: Program) -> bool:
    """Whether all of ẋ and of the outputs can be had by all of x and u."""
    rates = program.has("dynamics_forward") and program.has("dynamics_adjoint")
    if not rates and program.has("jacobian"):
        rates = not program.argument("u").names or program.has("jacobian_u")
    if not program.has("outputs"):
        return rates
    return rates and program.has("outputs_jacobian") and "u" not in program.kernel("outputs").uses


def _starts(program: Program) -> tuple[float, ...]:
    return program.nominal or (0.0,) * len(program.argument("x").names)


def _nominals(program: Program) -> list[float]:
    """What absolute tolerances go by: 1, but of lengths the largest at the start where that is
    less. Mechanisms of micrometres are none of metres."""
    units, starts = program.argument("x").units, _starts(program)
    lengths = [abs(start) for start, unit in zip(starts, units) if unit == "m"]
    length = max(lengths, default=0.0)
    length = min(1.0, max(SHORTEST, length)) if length else 1.0
    return [length if unit == "m" else 1.0 for unit in units]


# ---- variables


def _variables(program: Program, groups: Sequence[Kernel], at: References) -> list[Variable]:
    free = _Names()
    return [
        Variable(0, free("time"), "independent", "continuous", unit="s"),
        *_states(program, at, free),
        *_rates(program, at, free),
        *_given(program, at, free),
        *_results(program, groups, at, free),
        *_constants(program, at, free),
    ]


class _Names:
    """Gives out names of variables, each only once."""

    def __init__(self) -> None:
        self._taken: set[str] = set()

    def __call__(self, wanted: str) -> str:
        name, number = text.printable(wanted) or "variable", 1
        while name in self._taken:
            number += 1
            name = f"{text.printable(wanted)} ({number})"
        self._taken.add(name)
        return name


def _states(program: Program, at: References, free: _Names) -> Iterable[Variable]:
    """Start values are guesses where constraints decide what is near them."""
    x = program.argument("x")
    initial = "approx" if program.has("project") else "exact"
    known = zip(x.labels, x.units, _starts(program), _nominals(program))
    for k, (label, unit, start, nominal) in enumerate(known):
        name, value = free(label), text.number(start)
        reference, moves = at.states + k, initial == "approx"
        state = Variable(reference, name, "output", "continuous", initial, value, unit)
        yield replace(state, reinit=moves, nominal=text.number(nominal))


def _rates(program: Program, at: References, free: _Names) -> Iterable[Variable]:
    kernel = program.kernel("dynamics")
    labels, units = program.argument("x").labels, _units_of(kernel)
    for k, (label, unit) in enumerate(zip(labels, units)):
        name, state = free(f"der({label})"), at.states + k
        yield Variable(
            at.rates + k, name, "local", "continuous", "calculated", unit=unit, derivative=state
        )


def _given(program: Program, at: References, free: _Names) -> Iterable[Variable]:
    """Inputs, and parameters that may be tuned on the way."""
    u, p = program.argument("u"), program.argument("p")
    for k, (label, unit) in enumerate(zip(u.labels, u.units)):
        yield Variable(at.inputs + k, free(label), "input", "continuous", start="0.0", unit=unit)
    for k, (label, unit, value) in enumerate(zip(p.labels, p.units, p.defaults)):
        start, reference = text.number(value), at.parameters + k
        yield Variable(reference, free(label), "parameter", "tunable", "exact", start, unit)


def _results(
    program: Program, groups: Sequence[Kernel], at: References, free: _Names
) -> Iterable[Variable]:
    reference = at.groups
    for kernel in groups:
        causality = "output" if kernel.name == "outputs" else "local"
        for label, unit in zip(_labels(program, kernel), _units_of(kernel), strict=True):
            about = text.printable(kernel.about)
            name = free(label)
            yield Variable(
                reference, name, causality, "continuous", "calculated", unit=unit, about=about
            )
            reference += 1


def _labels(program: Program, kernel: Kernel) -> Sequence[str]:
    if kernel.name == "events":
        return [f"event {event.name}" for event in program.events]
    if kernel.name == "reactions":
        return [f"reaction {label}" for label in kernel.labels]
    named = NAMED.get(kernel.name, ())
    return named if len(named) == kernel.size else kernel.labels


def _units_of(kernel: Kernel) -> Sequence[str]:
    return kernel.units or ("",) * kernel.size


def _constants(program: Program, at: References, free: _Names) -> Iterable[Variable]:
    """What was given a value when the module was built."""
    for k, (name, value) in enumerate(program.fixed):
        about = "fixed when the module was built"
        reference, start = at.constants + k, text.number(value)
        yield Variable(reference, free(name), "local", "constant", "exact", start, about=about)


# ---- structure


def _structure(
    program: Program, variables: Sequence[Variable], groups: Sequence[Kernel], at: References
) -> dict[str, list[Unknown]]:
    """Outputs, rates, unknowns of the initialization and event indicators."""
    rates = [v.reference for v in variables if v.derivative is not None]
    initial = [
        v.reference
        for v in variables
        if v.initial in ("approx", "calculated") and (v.causality == "output" or v.derivative)
    ]
    return {
        "Output": [*_outputs(program, variables, groups, at)],
        "ContinuousStateDerivative": [Unknown(reference) for reference in rates],
        "InitialUnknown": [Unknown(reference) for reference in initial],
        "EventIndicator": [Unknown(v) for v in _indicators(groups, at)],
    }


def _outputs(
    program: Program, variables: Sequence[Variable], groups: Sequence[Kernel], at: References
) -> Iterable[Unknown]:
    """A state depends on itself; an output that takes no inputs must not look like a loop."""
    others = [kernel for kernel in groups if kernel.name == "outputs"]
    uses = others[0].uses if others else ()
    known = {
        "t": (0,),
        "x": tuple(range(at.states, at.rates)),
        "u": tuple(range(at.inputs, at.parameters)),
    }
    taken = tuple(reference for name in "txu" if name in uses for reference in known[name])
    for variable in variables:
        if variable.causality == "output":
            own = (variable.reference,) if variable.reference < at.rates else taken
            yield Unknown(variable.reference, own)


def _indicators(groups: Sequence[Kernel], at: References) -> range:
    """Value references of the events, which come last."""
    count = groups[-1].shape[0] if groups and groups[-1].name == "events" else 0
    return range(at.constants - count, at.constants)


# ---- units


@dataclass(frozen=True)
class Dimension:
    """A unit by its name, and its exponents of SI units; the names of none are written."""

    name: str
    exponents: tuple[tuple[str, int], ...]


def _units(variables: Sequence[Variable]) -> list[Dimension]:
    """All units that occur."""
    names = dict.fromkeys(variable.unit for variable in variables if variable.unit)
    return [Dimension(name, _exponents(name)) for name in names]


def _exponents(name: str) -> tuple[tuple[str, int], ...]:
    """Angles are plain numbers in formulas; FMI counts them."""
    known = dict(zip(("m", "kg", "s", "A"), unit_of(name).dimension)) | {"rad": _angles(name)}
    whole = [known[symbol] for symbol in (*BASE, "rad")]
    if any(n != int(n) for n in whole):
        return ()
    return tuple((symbol, int(known[symbol])) for symbol in (*BASE, "rad") if known[symbol])


def _angles(name: str) -> int:
    """The exponent of radians in kg*m^2/rad^2."""
    total = 0
    for sign, symbol, power in re.findall(r"([*/]?)(\w+)(?:\^(\d+))?", name):
        if symbol == "rad":
            total += int(power or 1) * (-1 if sign == "/" else 1)
    return total


FMU = Target(
    "fmu",
    "FMI 3.0, Model Exchange and Co-Simulation: NAME.fmu",
    files,
    needs=NEEDS,
    refusal=refusal,
    taker=TAKER,
    readme="fmu.md.j2",
)
