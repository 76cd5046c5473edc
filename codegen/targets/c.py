"""C99: a header and source files, straight-line code, no allocation, nothing but libm behind it.

NAME.c has every function for one state, NAME_batch.c the same for several states side by side, in
loops that compilers turn into vector instructions.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from codegen import text
from codegen.passes.angles import Turn, spelled, spelled_sums, turns
from codegen.passes.folding.split import Part, names, split
from codegen.passes.lanes import (
    CONSTRAINTS,
    DYNAMICS,
    GUARDS,
    POWER,
    SHORTER,
    has_looked,
    has_pairs,
    has_rates,
    has_slope,
    is_batched,
    most_lanes,
    side_by_side,
    stack_lanes,
)
from codegen.program import (
    BASE,
    PREVIOUS,
    Expression,
    Kernel,
    Program,
)
from codegen.targets.c_functions import (
    ALONE,
    SIDE_BY_SIDE,
    Body,
    batch_body,
    body_of,
    copied_lines,
    is_written,
    load_lines,
    output_line,
    rest_of,
    steps_of,
    value_text,
)
from codegen.targets.records import Target, is_apart
from codegen.targets.turns import Step, angles_of, fresh, is_turn

_CALL = re.compile(r"_sincos\((.*), &\w+, &\w+\);$")  # of a sine with its cosine in lanes
WIDEST = 512  # bits of a vector
# what a processor may have: the register and the bit of cpuid that say so, and what it takes of the
# system; those of leaf 1 first
FEATURES = {
    "avx": ("ecx", 28, "vectors"),
    "fma": ("ecx", 12, "vectors"),
    "avx2": ("ebx", 5, "vectors"),
    "bmi": ("ebx", 3, "1u"),
    "bmi2": ("ebx", 8, "1u"),
    "avx512f": ("ebx", 16, "wide"),
    "avx512dq": ("ebx", 17, "wide"),
    "avx512bw": ("ebx", 30, "wide"),
    "avx512vl": ("ebx", 31, "wide"),
}


@dataclass(frozen=True)
class Moved:
    """What steps of motions side by side call: kernels at once, each into a result of its own."""

    name: str
    parts: tuple[tuple[Body, str], ...]  # and the names of the results
    guarded: bool  # may a pivot be near zero?
    twice: bool = False  # also for two groups of lanes at a time


def files(program: Program) -> dict[str, str]:
    """NAME.h, NAME.c, NAME_batch.c, and a NAME_FUNCTION.c for every long function, so that several
    are compiled at a time."""
    widths = {argument.name: len(argument.names) for argument in program.arguments}
    data: dict[str, Any] = {
        "program": program,
        "prefix": program.name,
        "PREFIX": program.name.upper(),
        "widths": widths,
    }
    bodies = [body_of(program, kernel, ALONE) for kernel in program.kernels]
    hoisted = [(kernel, kernel.hoisted) for kernel in program.kernels if kernel.hoisted]
    data["hoisted"] = [
        (k, body_of(program, h.precompute, ALONE), body_of(program, h.rest, ALONE))
        for k, h in hoisted
    ]
    batches = [batch_body(program, kernel) for kernel in program.kernels if is_batched(kernel)]
    stepped = [
        _beside(program, kernel) for kernel in side_by_side(program) if not is_batched(kernel)
    ]
    short = [body for body in bodies if not is_apart(body.kernel)]
    widest = WIDEST // program.real.bits
    stack = stack_lanes(program)
    data |= {"previous": PREVIOUS, "base": BASE, "stack": stack, "far": stack < widest}
    long = {
        f"{program.name}_{body.kernel.name}.c": text.render("long.c.j2", bodies=[body], **data)
        for body in bodies
        if is_apart(body.kernel) and not body.rolled
    }
    long |= {
        f"{program.name}_{body.kernel.name}.c": text.render("loops.c.j2", bodies=[body], **data)
        for body in bodies
        if body.rolled
    }
    return {
        f"{program.name}.h": text.render("header.h.j2", bodies=bodies, batches=batches, **data),
        f"{program.name}.c": text.render("source.c.j2", bodies=short, features=FEATURES, **data),
        f"{program.name}_cpu.c": text.render("cpu.c.j2", features=FEATURES, **data),
        **(
            {f"{program.name}_inline.h": text.render("inline.h.j2", bodies=bodies, **data)}
            if program.inline
            else {}
        ),
        **(
            {
                f"{program.name}_batch.c": text.render(
                    "batch.c.j2",
                    bodies=batches,
                    stepped=stepped,
                    moved=_moved(program),
                    looked=_looked(program),
                    plain=_plain(program),
                    called=_called([*batches, *stepped]),
                    repeated=any(x.again for body in (*batches, *stepped) for x in body.pieces),
                    **data,
                ),
                f"{program.name}_lanes.h": text.render(
                    "lanes.h.j2",
                    room=most_lanes(program),
                    bodies=batches,
                    stepped=stepped,
                    moved=_moved(program),
                    looked=_looked(program),
                    **data,
                ),
            }
            if batches
            else {}
        ),
        **long,
    }


# The functions of text.LANES that are made of another one: templates/lane_functions.c.j2.
_MADE_OF = {
    **dict.fromkeys(("EXPM1", "TANH", "SINH", "COSH"), "quarter_expm1"),
    **dict.fromkeys(("ATAN", "ATAN2"), "turned"),
    **dict.fromkeys(("ASIN", "ACOS"), "arc"),
    "LOG1P": "LOG",
}


def _called(bodies: Sequence[Body]) -> list[str]:
    """Which functions of text.LANES occur, and what these are made of."""
    lines = [line for body in bodies for piece in body.pieces for line in piece.lines]
    values = [value for body in bodies for piece in body.pieces for value, *_ in piece.guards]
    lines += [line for body in bodies if body.rolled for line in body.rolled.lines]
    written = " ".join([*lines, *values, *(body.residual for body in bodies)])
    found = set(re.findall(r"\b[A-Z][A-Z0-9]+(?=\()", written)) & set(text.IN_LANES)
    return sorted(found | {_MADE_OF[name] for name in found if name in _MADE_OF})


def _moved(program: Program) -> list[Moved]:
    """What steps of motions call instead of dynamics, and of dynamics and power."""
    if not has_rates(program):
        return []
    rates = (_moving(program, DYNAMICS), "out")
    found = [_at_once("rates", (rates,), has_pairs(program))]
    if has_slope(program):
        slope = (rates, (_moving(program, POWER, DYNAMICS), "power"))
        found.append(_at_once("slope", slope, has_pairs(program)))
    return found


def _at_once(name: str, parts: tuple[tuple[Body, str], ...], twice: bool) -> Moved:
    guarded = any(piece.guards for body, _ in parts for piece in body.pieces)
    return Moved(name, parts, guarded, twice)


def _beside(program: Program, kernel: Kernel) -> Body:
    """What a step calls besides."""
    return (
        _moving(program, kernel.name, checked=True)
        if kernel.name in SHORTER and not kernel.rolled
        else body_of(program, kernel, SIDE_BY_SIDE)
    )


def _looked(program: Program) -> Moved | None:
    """Constraints and guards at once, where there are both."""
    if not has_looked(program):
        return None
    first = _moving(program, CONSTRAINTS, checked=True)
    second = _moving(program, GUARDS, CONSTRAINTS, checked=True)
    return Moved("looked", ((first, "out"), (second, "seen")), guarded=True)


def _moving(program: Program, name: str, before: str = "", checked: bool = False) -> Body:
    """With shorter sines and cosines, those of sums from those of their parts. How large angles are
    is looked at where it is `checked`; in dynamics that is done once for a step. Behind another
    kernel what that has is made as it was there."""
    kernel, constants = _taken(program, name)
    (part,) = split(kernel).parts
    loads, angles = part.loads, ()
    if before:
        (other,) = split(_taken(program, before)[0]).parts
        loads = tuple(
            dict.fromkeys((*loads, *(load for load in other.loads if load.argument == "x")))
        )
        angles = tuple(_spelled_angles(other))
    given = {load.name for load in loads}
    steps = list(_moving_steps(program, part, given, angles, checked))
    body = body_of(program, kernel, SIDE_BY_SIDE)
    lines = _lines(kernel, replace(part, loads=loads), steps)
    pieces = (replace(body.pieces[0], lines=tuple(lines)),)
    return replace(body, pieces=pieces, constants=constants)


def _spelled_angles(part: Part) -> list[Expression]:
    values = {s.name: s.value for section in part.sections for s in section.statements}
    angles = [angle for section in part.sections for angle in angles_of(section)]
    return spelled_sums(angles, values, {load.name for load in part.loads})


def _plain(program: Program) -> list[Body]:
    """What is looked at once for a step: angles that are not too large, and what has to be
    finite."""
    names = (DYNAMICS, POWER) if has_slope(program) else (DYNAMICS,) if has_rates(program) else ()
    return [_looking(program, name) for name in names]


def _looking(program: Program, name: str) -> Body:
    """The angles of a kernel, and what they need."""
    kernel, constants = _taken(program, name)
    (part,) = split(kernel).parts
    body = body_of(program, kernel, SIDE_BY_SIDE)
    steps: list[Step] = []
    for step in steps_of(program, part, SIDE_BY_SIDE):
        call = _CALL.search(step.lines[-1])
        if call:
            steps.append(Step([_in_reach(program, call[1])], step.reads, ()))
        steps.append(step)
    kept = [step for step in _live(steps, set()) if step.reads or step.makes]
    reads = {name for step in kept for name in step.reads}
    loads = [line for name, line in load_lines(part, SIDE_BY_SIDE).items() if name in reads]
    if "t" in {*reads, *(name for name, _ in kernel.watched)}:
        loads.insert(0, "const double t = t_[lane];")
    lines = (*loads, *(line for step in kept for line in step.lines))
    pieces = (replace(body.pieces[0], lines=lines, guards=()),)
    return replace(body, pieces=pieces, constants=constants)


def _taken(program: Program, name: str) -> tuple[Kernel, int]:
    """As the loops over lanes take it: the constants of dynamics are precomputed."""
    kernel = program.kernel(name)
    return rest_of(kernel) if name == DYNAMICS else (kernel, 0)


def _live(steps: Sequence[Step], wanted: set[str]) -> list[Step]:
    """Without those whose locals nobody reads."""
    kept: list[Step] = []
    for step in reversed(steps):
        if not step.makes or wanted & set(step.makes):
            kept.insert(0, step)
            wanted |= set(step.reads)
    return kept


def _lines(kernel: Kernel, part: Part, steps: Sequence[Step]) -> Iterator[str]:
    """As _far, without what is not read."""
    results = [value for _, value in part.outputs if is_written(kernel, value)]
    values = [*results, *(guard.value for guard in part.guards)]
    values += [part.residual] if part.residual is not None else []
    kept = _live(steps, {name for value in values for name in names(value)})
    reads = {name for step in kept for name in step.reads} | {n for v in values for n in names(v)}
    yield from (line for name, line in load_lines(part, SIDE_BY_SIDE).items() if name in reads)
    for step in kept:
        yield from step.lines
    yield ""
    yield from (
        output_line(kernel, i, SIDE_BY_SIDE)
        for i, value in part.outputs
        if is_written(kernel, value)
    )
    yield from copied_lines(kernel, part.copies, SIDE_BY_SIDE)


def _moving_steps(
    program: Program,
    part: Part,
    given: set[str],
    before: Sequence[Expression],
    checked: bool,
) -> Iterator[Step]:
    """As steps_of; sums of angles stand behind their parts, all of them at the first of them."""
    statements = [s for section in part.sections for s in section.statements]
    taken = {s.name for s in statements}
    values = {s.name: s.value for s in statements}
    for section in part.sections:
        yield Step(("", f"/* {text.comment(section.title)} */"), (), ())
        own = angles_of(section)
        sums = turns(list(own), values, given, before) if own else []
        more = [turn.angle for turn in sums if turn.angle not in own]
        pairs = own | {angle: {"sin": fresh("sine", taken)} for angle in more}
        places = {angle: _pair(pair, taken) for angle, pair in pairs.items()}
        together = [s for turn in sums for s in _turned(program, turn, places, values, checked)]
        steps = {
            next(iter(own[angle].values())): [_short(program, angle, places[angle], checked)]
            for angle in own
            if angle not in [turn.angle for turn in sums]
        }
        firsts = [next(iter(pair.values())) for pair in own.values()]
        late = [name for name in firsts if name not in steps]
        steps |= dict.fromkeys(late[:1], together)
        for statement in section.statements:
            if is_turn(statement):
                yield from steps.get(statement.name, ())
                continue
            line = f"const double {statement.name} = {value_text(statement.value, SIDE_BY_SIDE)};"
            yield Step([line], list(names(statement.value)), [statement.name])


def _turned(
    program: Program,
    turn: Turn,
    places: Mapping[Expression, tuple[str, str]],
    values: Mapping[str, Expression],
    checked: bool,
) -> Iterator[Step]:
    """The sine and the cosine of a sum of angles."""
    sin, cos = places[turn.angle]
    if not turn.of:
        yield _short(program, spelled(turn.angle, values), places[turn.angle], checked)
        return
    (sin_a, cos_a), (sin_b, cos_b) = (places[angle] for angle in turn.of)
    plus, minus = ("+", "-") if turn.sign > 0 else ("-", "+")
    reads = (sin_a, cos_a, sin_b, cos_b)
    yield Step([f"const double {sin} = {sin_a} * {cos_b} {plus} {cos_a} * {sin_b};"], reads, [sin])
    yield Step([f"const double {cos} = {cos_a} * {cos_b} {minus} {sin_a} * {sin_b};"], reads, [cos])


def _short(program: Program, angle: Expression, place: tuple[str, str], checked: bool) -> Step:
    sin, cos = place
    value = value_text(angle, SIDE_BY_SIDE)
    lines = [
        f"double {sin}, {cos};",
        f"{program.name}_sincos_short({value}, &{sin}, &{cos});",
        *([_in_reach(program, value)] if checked else []),
    ]
    return Step(lines, list(names(angle)), place)


def _in_reach(program: Program, value: str) -> str:
    return f"bad += fabs({value}) <= {program.real.reach} ? 0.0 : 1.0;"


def _pair(pair: dict[str, str], taken: set[str]) -> tuple[str, str]:
    """Names of the sine and the cosine of an angle."""
    first = next(iter(pair.values()))
    sin, cos = (pair.get(name) or fresh(f"{first}_{name}", taken) for name in ("sin", "cos"))
    return sin, cos


C = Target("c", "C99 source and header", files)
