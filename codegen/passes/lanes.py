"""lanes: which functions exist for several states side by side."""

from __future__ import annotations

from codegen.passes.folding.split import is_long
from codegen.program import CHART, Expression, Kernel, Program, Rolled, Section

DYNAMICS = "dynamics"
BATCHED = (DYNAMICS, "derivatives", "steady")  # worth the time to compile them twice
POWER = "power"
CONSTRAINTS, GUARDS = "constraints", "guards"
SHORTER = ("project", CONSTRAINTS, GUARDS)  # what a step calls besides, with shorter sines
# and what enforcements along directions solve at every stage: rows of positions, of velocities
SOLVED = ("closure", "slip")
STEPPED = (POWER, *SHORTER, *SOLVED)
WATCHED = "events"  # and where something is looked for; without it motions with events go alone
PLAIN = frozenset({
    "add", "sub", "mul", "div", "neg", "sqrt", "sin", "cos", "fabs", "sign", "lt", "le", "eq", "ne",
    "and", "or", "not", "where", "copysign", "fmin", "fmax",
})  # fmt: skip
# Of the C library, and written anew without branches where they stand in lanes.
LIBRARY = frozenset({
    "exp", "expm1", "log", "log1p", "tanh", "sinh", "cosh", "atan", "atan2", "asin", "acos", "pow",
})  # fmt: skip
NO_TURNS = (PLAIN | LIBRARY) - {"sin", "cos"}
# statements, inputs and outputs together: longer loops over lanes take compilers too long. What is
# asked for by name is in parts. Of code that comes again what is left counts.
WIDEST, LONGEST = 1_500, 12_000
# Numbers that functions of loops over links take on the stack, all lanes together: 3.2 MB. What is
# longer has a place of its own for each thread, of 12.8 MB, which a third cache still holds; beyond
# them mechanisms go in fewer lanes, and alone where not even two have room.
MOST_ROLLED, MOST_APART = 400_000, 1_600_000
FEWEST = 2
SHORT = 120  # operations of dynamics, those of sines and cosines besides


def is_stepped(kernel: Kernel) -> bool:
    """Does a step of several motions call it, of whichever chart it is?"""
    return kernel.name.partition(CHART)[0] in (DYNAMICS, *STEPPED)


def is_batched(kernel: Kernel) -> bool:
    """Worth it, no iteration, no calls of the C library, not too long: compilers make vector
    instructions of it."""
    alone = kernel.loop is None and kernel.solving is None
    return kernel.name in BATCHED and alone and _is_straight(kernel)


def most_lanes(program: Program) -> int:
    """As many lanes as have room in a place of their own, a power of two; 16 where there is room
    for all."""
    return _lanes_within(program, MOST_APART)


def stack_lanes(program: Program) -> int:
    """As many as have room on the stack."""
    return _lanes_within(program, MOST_ROLLED)


def _lanes_within(program: Program, most: int) -> int:
    rolled = [k for k in program.kernels if k.rolled and (is_batched(k) or is_stepped(k))]
    rolled += [k for k in program.kernels if k.repeats and is_batched(k)]
    numbers = max((_numbers(kernel) for kernel in rolled), default=1)
    lanes = 16
    while lanes > 1 and lanes * numbers > most:
        lanes //= 2
    return lanes


def _numbers(kernel: Kernel) -> int:
    """What a lane of a loop over links takes: workspace, result and arguments."""
    workspace = kernel.rolled.workspace if kernel.rolled else 0
    workspace += kernel.repeats.numbers if kernel.repeats else 0
    return workspace + kernel.size + len(kernel.watched)


def side_by_side(program: Program) -> tuple[Kernel, ...]:
    """What a step of several motions side by side calls; nothing where motions have to go one by
    one: in another precision, where a function is not plain."""
    kernels = tuple(k for k in program.kernels if is_stepped(k))
    if not program.simulates or program.real.words:
        return ()
    # steps look through all sums of angles for shorter ones, which takes long of very many
    short = not any(kernel.repeats for kernel in kernels) and all(
        kernel.name == DYNAMICS or not is_long(kernel) for kernel in kernels
    )
    if not short or not is_batched(program.kernel(DYNAMICS)):
        return ()
    if not all(map(_is_straight, kernels)):
        return ()
    watched = [k for k in program.kernels if k.name.partition(CHART)[0] == WATCHED]
    looks = all(_is_straight(k) and not is_long(k) for k in watched)
    return (*kernels, *watched) if looks else kernels


def has_rates(program: Program) -> bool:
    """Are dynamics written once more, for steps of motions? Sines and cosines are shorter there.
    Charts have theirs as they are."""
    there = any(kernel.name == DYNAMICS for kernel in side_by_side(program))
    return there and not program.charts and _is_whole(program.kernel(DYNAMICS))


def has_slope(program: Program) -> bool:
    """And together with the power? A compiler then makes sines, cosines and inverses of both
    once."""
    return (
        has_rates(program)
        and program.has(POWER)
        and does_work(program)
        and _is_whole(program.kernel(POWER))
    )


def has_looked(program: Program) -> bool:
    """Are there constraints and guards, which are looked at together?"""
    straight = (kernel.name for kernel in side_by_side(program) if not kernel.rolled)
    return not program.charts and {CONSTRAINTS, GUARDS} <= set(straight)


def has_pairs(program: Program) -> bool:
    """And for two groups of lanes at a time? The operations of one fill the time in which those of
    the other wait for each other; longer functions run out of registers."""
    kernel = program.kernel(DYNAMICS)
    counts = (kernel.hoisted.rest if kernel.hoisted else kernel).operations
    return has_rates(program) and counts["total"] + 5 * counts["sin"] <= SHORT


def _is_whole(kernel: Kernel) -> bool:
    """Is it one straight piece of code in lanes?"""
    rest = kernel.hoisted.rest if kernel.hoisted else kernel
    return not rest.rolled and not is_long(rest)


def does_work(program: Program) -> bool:
    """Is there a power that is not zero whatever the state?"""
    names = {f"{POWER}{chart.suffix}" for chart in program.charts} | {POWER}
    powers = [kernel for kernel in program.kernels if kernel.name in names]
    return any(kernel.rolled or any(kernel.outputs) for kernel in powers)


def _is_straight(kernel: Kernel) -> bool:
    if kernel.rolled:
        short = FEWEST * _numbers(kernel) <= MOST_APART
        ends = all(is_plain(value, NO_TURNS) for value in _ends(kernel.rolled))
        return short and ends and all(map(_is_lane, _statements(kernel.rolled)))
    if is_wide(kernel) or (kernel.repeats and FEWEST * _numbers(kernel) > MOST_APART):
        return False
    return all(is_plain(value, PLAIN | LIBRARY) for value in _values(kernel))


def _is_lane(value: Expression) -> bool:
    """Plain, with a sine or cosine as a statement of its own alone: in loops over links they come
    two at a time."""
    if isinstance(value, tuple) and value[0] in ("sin", "cos"):
        value = value[1]
    return is_plain(value, NO_TURNS)


def is_wide(kernel: Kernel) -> bool:
    """Is it too long for lanes as it is written?"""
    most = LONGEST if kernel.name in BATCHED[1:] else WIDEST
    if kernel.repeats:
        return kernel.repeats.statements > most
    return len(kernel.x.names) + len(_values(kernel)) > most


def _values(kernel: Kernel) -> list[Expression]:
    """All expressions of straight-line code."""
    values = [s.value for section in kernel.sections for s in section.statements]
    return [*values, *kernel.outputs, *(guard.value for guard in kernel.guards)]


def values_of(of: Rolled) -> list[Expression]:
    """All expressions in the bodies of loops."""
    return [*_statements(of), *_ends(of)]


def _statements(of: Rolled) -> list[Expression]:
    return [s.value for section in sections_of(of) for s in section.statements]


def _ends(of: Rolled) -> list[Expression]:
    """What bodies of loops leave behind."""
    values = [angle.value for angle in of.angles if angle]
    for visit in of.visits:
        values += [*(x for _, x in visit.kept), *visit.handed, *(x for _, x in visit.results)]
    return values


def sections_of(of: Rolled) -> list[Section]:
    """All sections of the bodies of loops."""
    return [section for visit in of.visits for section in visit.sections]


def is_plain(value: Expression, plain: frozenset[str]) -> bool:
    """Is it made of these operations alone?"""
    if not isinstance(value, tuple):
        return True
    return value[0] in plain and all(is_plain(operand, plain) for operand in value[1:])
