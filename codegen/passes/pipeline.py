"""program: the pipeline from Equations to Program. Each pass is Work → Work; the ledger says what
each one did."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import casadi as ca

from codegen.passes import hoist as parameters
from codegen.passes.folding.roll import AUTO, NEVER, WORTH_LANES, is_sure, refusal, rolled
from codegen.passes.folding.split import is_long, split
from codegen.passes.hoist import hoist
from codegen.passes.initial import initial
from codegen.passes.lanes import BATCHED, DYNAMICS, is_wide
from codegen.passes.names import Names, identifier
from codegen.passes.rewriting.graph import Mark
from codegen.passes.rewriting.improve import Candidate, count, improve, used_operations
from codegen.passes.rewriting.lower import Lowered
from codegen.passes.rewriting.trace import Tape, record
from codegen.passes.schedule import schedule
from codegen.passes.selection import chart_suffix, contents, spelled_out
from codegen.passes.steppers import with_steppers
from codegen.passes.taylor import SERIES, check_series, series_refusal
from codegen.passes.turns import turns
from codegen.passes.watch import watch
from codegen.program import (
    CALLED,
    Argument,
    Chart,
    Entry,
    Event,
    Expression,
    Hoisted,
    Kernel,
    Loop,
    Pattern,
    Pivot,
    Program,
    Repeats,
    Solving,
)
from derive.formulations import records
from derive.formulations.projection import positions
from derive.formulations.records import Equations, Function
from derive.model.memory import without_collections

# Statements from which those that come again are written once, where they are so large a part of
# them. Straight code takes a tenth less time for one state, but dynamics have no lanes where it is
# too wide for them: there, too, they are written once.
MANY, WORTH = 1_500, 0.5


@without_collections()
def program(
    equations: Equations,
    functions: Sequence[str] | None = None,
    integrators: Sequence[str] = ("dop853",),
    enforcements: Sequence[str] | None = None,
    roll: str = AUTO,
) -> Program:
    """The Program of the named functions; the default ones when None, and in place of the name
    "default".

    `integrators` and `enforcements` are those that `simulate` of the module can use (projection,
    where there is anything to project on, and none, where `enforcements` is None); functions that
    they need are added. `roll` says whether a function becomes loops over links where that is
    possible (never, always, where it is long). Raises HamelError for a name that the model or the
    program does not know, AssumptionError where a Jacobian is too large for the stack or a series
    was asked for that does not exist.
    """
    arguments = _arguments(equations.arguments, equations.parameters)
    named, integrators = integrators, spelled_out(integrators)
    if SERIES in named and roll == AUTO:
        roll = NEVER  # loops over links have no recurrences
    held = contents(equations, functions, integrators, enforcements, roll)
    kernels: list[Kernel] = []
    ledger: list[Entry] = []
    turning = _Turning(
        len(arguments[1].names) - len(equations.w) - len(equations.z) if held.simulates else 0
    )
    rolling: list[tuple[str, str]] = []
    for source, function in held.emitted:
        kernel, entries, how = _straight_or_rolled(source, function, turning, roll)
        if how:
            rolling.append((function.name, how))
        kernels.append(kernel)
        ledger += entries
    model = equations.system.model
    result = Program(
        name=identifier(model.name),
        description=model.description,
        formulation=equations.formulation,
        choice=equations.choice,
        reason=equations.reason,
        pivots=equations.pivots,
        quasi_velocities=equations.w,
        states=equations.z,
        assumptions=equations.assumptions,
        constants=equations.system.constants,
        fixed=model.fixed,
        arguments=arguments,
        kernels=tuple(kernels),
        ledger=tuple(ledger),
        positions=positions(equations.system),
        nominal=initial(equations),
        left_out=_left_out(equations, arguments, kernels),
        integrators=tuple(integrators) if held.simulates else (),
        enforcements=held.enforcements,
        turning=turning.found,
        frame=len(equations.frame.labels) if equations.frame and held.simulates else 0,
        events=_events(equations) if held.simulates else (),
        charts=_charts((equations, *equations.charts)),
        rolling=tuple(rolling),
    )
    result = with_steppers(result, held.loops)
    if SERIES in named and result.integrators:
        check_series(result)
    # by name it was asked for and refused above; as a part of `auto` it is left out
    elif SERIES in result.integrators and series_refusal(result):
        return replace(result, integrators=tuple(x for x in result.integrators if x != SERIES))
    return result


def _charts(charts: Sequence[Equations]) -> tuple[Chart, ...]:
    """What is known of each chart, where there are several."""
    if len(charts) == 1:
        return ()
    return tuple(Chart(x.choice, chart_suffix(k), x.w, x.largest) for k, x in enumerate(charts))


@dataclass
class _Turning:
    """Which of the first `count` entries of x go round in what a simulation calls, and which show
    their turns there."""

    count: int
    round: set[int] = field(default_factory=set[int])
    seen: set[int] = field(default_factory=set[int])

    def look(self, function: Function, tape: Tape) -> None:
        """At the result and the guards: a residual only says when an iteration may stop."""
        name = function.name.split("_chart")[0]
        if self._matters(name):
            roots = tape.roots[: function.result.size + len(function.guards)]
            rotations = turns(tape, roots, self.count, name in ("project", "state"))
            self.round |= rotations[0]
            self.seen |= rotations[1]

    def look_at_links(self, kernel: Kernel) -> None:
        """A coordinate that is read for its angle alone."""
        of = kernel.rolled
        if of is None or not self._matters(kernel.name):
            return
        for kind, coordinate in zip(of.kinds, of.indices["coordinate"]):
            bodies = [sweep.visits[kind] for sweep in of.sweeps]
            seen = any(load.argument == "q" for body in bodies for load in body.loads)
            (self.seen if seen or of.angles[kind] is None else self.round).add(coordinate)

    def _matters(self, name: str) -> bool:
        called = name in (*CALLED, "velocity", "state") and not name.startswith("jacobian")
        return bool(self.count) and called

    @property
    def found(self) -> tuple[int, ...]:
        """Entries of x that occur within sines and cosines and are seen nowhere else, sorted: whole
        turns of these may be taken off during a simulation."""
        return tuple(sorted(self.round - self.seen))


def _events(equations: Equations) -> tuple[Event, ...]:
    """What the entries of the function `events` are, where there is one."""
    if not equations.has("events"):
        return ()
    return tuple(Event(x.name, x.direction, x.stop) for x in equations.system.model.events)


def _arguments(
    slots: Sequence[records.Argument], parameters: tuple[float, ...]
) -> tuple[Argument, ...]:
    names = Names()
    arguments: list[Argument] = []
    for slot in slots:
        local = tuple(
            names(identifier(label)) if slot.name != "t" else "t" for label in slot.labels
        )
        arguments.append(
            Argument(
                slot.name, slot.labels, local, slot.units, parameters if slot.name == "p" else ()
            )
        )
    return tuple(arguments)


def _slots(equations: Equations, function: Function) -> tuple[records.Argument, ...]:
    """t, x, u, p as this function takes them: its own x may be something else than the state."""
    return tuple(
        function.x if slot.name == "x" and function.x is not None else slot
        for slot in equations.arguments
    )


def _left_out(
    equations: Equations, arguments: Sequence[Argument], kernels: Sequence[Kernel]
) -> tuple[str, ...]:
    """Functions that were not asked for or are empty, and arguments that no function uses."""
    names = {kernel.name for kernel in kernels}
    used = {name for kernel in kernels for name in kernel.uses}
    functions = [f"function {f.name}" for f in equations.functions if f.name not in names]
    return (*functions, *(f"argument {a.name}" for a in arguments if a.name not in used))


def _kernel(
    equations: Equations, function: Function, turning: _Turning
) -> tuple[Kernel, list[Entry]]:
    size = function.result.size
    slots = _slots(equations, function)
    symbols = [(slot.name, slot.symbols) for slot in slots]
    tape = record(symbols, _roots(function), [(n.name, n.about, n.value) for n in function.named])
    turning.look(function, tape)
    best, entries = improve(function.name, tape, _loose(function, size))
    kernel = _finish(function, best, _arguments(slots, equations.parameters), size)
    if kernel.hoisted:
        entries.append(
            Entry(function.name, "hoist", best.total, kernel.hoisted.rest.operations["total"])
        )
    return kernel, entries


def _straight_or_rolled(
    equations: Equations, function: Function, turning: _Turning, roll: str
) -> tuple[Kernel, list[Entry], str]:
    """The kernel, and how it was decided; nothing where loops were not thought of."""
    links = len(equations.system.links)
    refused = refusal(function, roll, links)
    if refused is not None:
        kernel, entries = _kernel(equations, function, turning)
        kernel, how = (kernel, "") if roll == NEVER else _repeating(kernel)
        return kernel, entries, how or (f"unrolled: {refused}" if refused else "")
    loops, entries = _rolled(equations, function, turning)
    if not is_sure(function, roll, links):
        straight, its_entries = _kernel(equations, function, turning)
        lost = function.name in BATCHED and is_wide(straight)  # loops alone have lanes there
        most = WORTH_LANES if lost else 1.0
        if loops.operations["total"] > most * straight.operations["total"]:
            straight, how = _repeating(straight) if is_wide(straight) else (straight, "")
            return straight, its_entries, how
    return loops, entries, _how(loops)


def _repeating(kernel: Kernel) -> tuple[Kernel, str]:
    """A long function whose statements come again and again as one body for each kind of them, and
    how much of it that is."""
    total = sum(len(section.statements) for section in kernel.sections)
    wide = kernel.name == DYNAMICS and is_wide(kernel)
    if kernel.solving or (total < MANY and not wide):
        return kernel, ""
    parts = split(replace(kernel, repeats=Repeats(0, 0)))
    bodies = [len(part.repeat.makes[0]) for part in parts.parts if part.repeat]
    many = sum(len(p.repeat.makes) * len(p.repeat.makes[0]) for p in parts.parts if p.repeat)
    if many < WORTH * total:
        return kernel, ""
    repeats = Repeats(total - many + sum(bodies), parts.size)
    how = f"rolled: {many} of {total} statements are repetitions of {sum(bodies)}"
    return replace(kernel, repeats=repeats), how


def _rolled(
    equations: Equations, function: Function, turning: _Turning
) -> tuple[Kernel, list[Entry]]:
    """As loops over links. Angles of links are seen in sines and cosines alone."""
    slots = _slots(equations, function)
    loops = rolled(function, _arguments(slots, equations.parameters))
    turning.look_at_links(loops.kernel)
    return loops.kernel, list(loops.entries)


def _how(kernel: Kernel) -> str:
    of = kernel.rolled
    if of is None:
        return ""
    kinds = f"{len(of.tables)} kind{'s' if len(of.tables) > 1 else ''}"
    return f"rolled: {of.links} links of {kinds}, {of.workspace} numbers of workspace"


def _roots(function: Function) -> list[ca.SX]:
    """Result entries row by row, then guards, then the residual or what solving takes."""
    solving = function.solving
    value = function.result.value if solving is None else solving.unsolved
    entries = ca.densify(ca.vec(value.T))
    last = [] if function.residual is None else [function.residual]
    last += [] if solving is None else [ca.densify(solving.values), ca.densify(solving.added)]
    return [entries, *(guard.value for guard in function.guards), *last]


def _loose(function: Function, size: int) -> range:
    return range(size, size + len(function.guards))


def _finish(
    function: Function, best: Candidate, arguments: Sequence[Argument], size: int
) -> Kernel:
    kernel = _written(function, best.lowered, best.marks, arguments, _names(arguments), size)
    if function.name not in BATCHED or kernel.solving or is_long(kernel):
        return kernel
    parts = hoist(best.lowered)
    hoisted = _hoisted(function, parts, best.marks, arguments, size) if parts else None
    return (
        kernel
        if hoisted is None or is_long(hoisted.precompute) or is_long(hoisted.rest)
        else replace(kernel, hoisted=hoisted)
    )


def _names(arguments: Sequence[Argument]) -> dict[tuple[str, int], str]:
    return {
        (argument.name, i): name for argument in arguments for i, name in enumerate(argument.names)
    }


def _hoisted(
    function: Function,
    parts: parameters.Hoisted,
    marks: tuple[Mark, ...],
    arguments: Sequence[Argument],
    size: int,
) -> Hoisted:
    """c holds parameters that are used as they are under their own names, results of the hoisted
    work as c1, c2, …"""
    names = _names(arguments)
    count = len(parts.precompute.roots)
    free = Names([*Names().taken, *names.values(), identifier(function.result.name)])
    labels = tuple(
        names["p", parts.entries[k]] if k in parts.entries else free(f"c{k + 1}")
        for k in range(count)
    )
    about = f"constants of {function.name}, from parameters alone"
    work = Function(
        f"{function.name}_precompute",
        about,
        records.Result("c", ca.SX(count, 1), labels, ()),
        x=function.x,
    )
    precompute = _written(work, parts.precompute, (), arguments, names, count)
    rest = _written(
        replace(function, name=f"{function.name}_precomputed"),
        parts.rest,
        marks,
        [a for a in arguments if a.name != "p"],
        {key: name for key, name in names.items() if key[0] != "p"}
        | {("c", k): label for k, label in enumerate(labels)},
        size,
    )
    return Hoisted(precompute, rest)


def _written(
    function: Function,
    lowered: Lowered,
    marks: tuple[Mark, ...],
    arguments: Sequence[Argument],
    inputs: dict[tuple[str, int], str],
    size: int,
) -> Kernel:
    free = Names([*Names().taken, *inputs.values(), identifier(function.result.name)])
    title = f"{function.result.name}: {function.about}"
    by_columns = function.name in BATCHED and function.result.matrix
    shape = function.result.value.shape if by_columns else (0, 1)
    done = schedule(lowered, marks, title, inputs, free, shape)
    # the value stands there over `factor`, for guards are only compared, and so does its bound
    guards = [
        Pivot(guard.name, value, abs(guard.tolerance / factor), guard.tolerance, guard.part)
        for guard, value, factor in zip(function.guards, done.roots[size:], lowered.factors[size:])
    ]
    loop = function.iteration and Loop(
        function.iteration.tolerance, function.iteration.most, done.roots[-1]
    )
    solving = _solving(function, done.roots[size + len(guards) :])
    rows, columns = function.result.value.shape
    uses = tuple(a.name for a in arguments if any(load.argument == a.name for load in done.loads))
    watched = watch(lowered, size, {a.name: len(a.names) for a in arguments if a.name in uses})
    return Kernel(
        name=function.name,
        about=function.about,
        result=function.result.name,
        shape=(rows,) if columns == 1 and not function.result.matrix else (rows, columns),
        labels=function.result.labels,
        units=function.result.units,
        x=next(argument for argument in arguments if argument.name == "x"),
        uses=uses,
        loads=done.loads,
        sections=done.sections,
        outputs=done.roots[:size],
        guards=tuple(guards),
        loop=loop,
        watched=watched.entries,
        results=watched.outputs,
        operations=_counts(lowered, solving),
        pattern=function.result.pattern and Pattern(**vars(function.result.pattern)),
        solving=solving,
    )


def _solving(function: Function, values: Sequence[Expression]) -> Solving | None:
    of = function.solving
    if of is None:
        return None
    size = of.values.numel() + of.added.numel()
    return Solving(
        function.result.value.size2(),
        of.order,
        of.pairs,
        tuple(values[:size]),
        of.first,
        of.ranges,
        of.places,
    )


def _counts(lowered: Lowered, solving: Solving | None) -> dict[str, int]:
    counts = count(used_operations(lowered))
    for kind, more in (solving.operations if solving else {}).items():
        counts[kind] += more
        counts["total"] += more
    return counts
