"""The stages on the road from a model file to a program; the other verbs take them, too."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from os import PathLike
from types import MappingProxyType

from codegen.emit import misfit, on_request
from codegen.integrators import INTEGRATORS
from codegen.passes import in_precision, program
from codegen.passes.folding.roll import ALWAYS, AUTO, NEVER
from codegen.program import Program
from codegen.targets.records import Target, affordable, ambiguity
from derive.diagnostics import AssumptionError, ModelError, did_you_mean, listed
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.formulations.requests import request_of
from derive.linearize.minimal import with_linearization
from derive.mechanics.records import System
from derive.model.records import Model
from derive.robots.reading import load
from derive.states import system
from hamel.build.clock import Clock
from hamel.build.fix import fixed
from hamel.build.options import BuildOptions, Constants, Fixed


def model_of(
    path: str | PathLike[str], constants: Constants = (), fix: Fixed = MappingProxyType({})
) -> tuple[Model, Constants]:
    """File → Model, with the inputs and parameters of `fix` as numbers; and what is constant in
    it."""
    return fixed(load(path), constants, fix)


def mechanics_of(model: Model, constants: Constants = ()) -> System:
    """Model → System; ModelError where a constant is no parameter."""
    known = [parameter.name for parameter in model.parameters]
    unknown = [name for name in (() if constants == "all" else constants) if name not in known]
    if unknown:
        near = did_you_mean(unknown[0], known) or f"it has {listed(known)}"
        raise ModelError(
            f"'{unknown[0]}' is to be a constant, but {model.name} has no such parameter; {near}"
        )
    return system(model, constants)


def equations_of(
    path: str | PathLike[str],
    choice: str | None = None,
    constants: Constants = (),
    formulation: str = "quasi_velocities",
    clock: Clock | None = None,
    fix: Fixed = MappingProxyType({}),
    check: Callable[[System], None] = lambda mechanics: None,
) -> Equations:
    """File → Equations of one formulation and choice; the first choice of the file when none is
    named. `check` refuses a System that would be made equations of for nothing."""
    clock = clock or Clock()
    with clock("model", "file → Model"):
        model, constants = model_of(path, constants, fix)
    with clock("mechanics", "Model → System"):
        mechanics = mechanics_of(model, constants)
        check(mechanics)
    with clock("formulation", "System → Equations"):
        return with_linearization(
            equations(mechanics, choice, formulation, charts=True, moving=True)
        )


def usable_choices(
    mechanics: System, formulation: str = "quasi_velocities"
) -> tuple[dict[str, Equations], dict[str, str]]:
    """Equations of every choice of the file, and why the others are refused. The first has to be a
    choice: it is the default.

    A formulation in the generalized velocities makes no choice: its equations stand alone, under
    its own name.
    """
    usable, refused = {}, {}
    for number, choice in enumerate(mechanics.model.choices):
        try:
            formed = with_linearization(equations(mechanics, choice.name, formulation, moving=True))
        except AssumptionError as error:
            if number == 0:
                raise
            refused[choice.name] = str(error)
            continue
        usable[formed.choice] = formed
        if formed.generalized_velocities:
            break
    return usable, refused


def program_of(
    equations: Equations,
    functions: Collection[str] | None = None,
    integrators: Iterable[str] = (),
    enforcements: Collection[str] | None = None,
    real: str = "float64",
    roll: str = AUTO,
) -> Program:
    """Equations → Program: the straight-line statements of each function, counted. `integrators`:
    the default one when empty."""
    methods = tuple(integrators) or (INTEGRATORS[0].name,)
    names = None if functions is None else tuple(functions)
    held = None if enforcements is None else tuple(enforcements)
    return in_precision(program(equations, names, methods, held, roll), real)


def program_for(equations: Equations, options: BuildOptions) -> Program:
    """Equations → Program with all that was asked for, and what the targets need of it."""
    asked = on_request(options.targets)
    _check_state(equations, asked)
    states = {argument.name: len(argument.labels) for argument in equations.arguments}["x"]
    wanted = [n for target in asked for n in affordable(target.needs, states)]
    needs = [n for n in dict.fromkeys(wanted) if _is_possible(equations, n)]
    functions = (*(options.functions or ("default",)), *needs) if needs else options.functions
    straight = options.header or any(target.straight for target in asked)
    if options.header and options.roll == ALWAYS:
        raise AssumptionError("loops over links are in no header of inline functions")
    roll = NEVER if straight and options.roll == AUTO else options.roll
    result = program_of(equations, functions, options.integrators, real=options.real, roll=roll)
    return replace(result, inline=options.header, targets=tuple(target.name for target in asked))


def _check_state(equations: Equations, asked: Sequence[Target]) -> None:
    """Raise AssumptionError where a target takes a state of one meaning and the choice has none;
    the passes may take minutes."""
    charts = [each.choice for each in (equations, *equations.charts)]
    for target in asked:
        reason = target.taker and ambiguity(
            charts, equations.choice, equations.frame is not None, target.taker
        )
        if reason:
            raise misfit(equations.system.model.name, target, reason)


def _is_possible(equations: Equations, name: str) -> bool:
    """Whether the model has that function; inputs that give every ẇ it may not have."""
    if any(function.name == name for function in equations.functions):
        return True
    request = request_of(equations, name)
    return request is not None and request.refusal is None


def with_emitted(equations: Equations, program: Program) -> Equations:
    """With the functions that were emitted on request, in every chart: they are verified like the
    rest."""
    emitted = [kernel.name for kernel in program.kernels]
    charts = tuple(
        _with_requested(chart, emitted, f"_chart{number}")
        for number, chart in enumerate(equations.charts, 1)
    )
    return replace(_with_requested(equations, emitted, ""), charts=charts)


def _with_requested(equations: Equations, emitted: Collection[str], suffix: str) -> Equations:
    known = {function.name for function in equations.functions}
    names = [name.removesuffix(suffix) for name in emitted if name.endswith(suffix)]
    asked = [request_of(equations, name) for name in names if name not in known]
    further = tuple(x.function for x in asked if x is not None and x.make is not None)
    return replace(equations, functions=(*equations.functions, *further))
