"""Choices of quasi-velocities, names of what moves, and outputs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TypeGuard

from derive.diagnostics import did_you_mean, listed
from derive.expressions import tree
from derive.expressions.dimensions import infer
from derive.expressions.functions import OUTPUT_FUNCTIONS
from derive.expressions.mistakes import FormulaError
from derive.expressions.parser import expression
from derive.expressions.piece_order import check_pieces
from derive.expressions.tree import ZERO, Expression
from derive.expressions.units import pretty
from derive.model.constraints.nonideal import velocity_degree
from derive.model.document import Items, Key, Scalar
from derive.model.kinematics.measures import SPEEDING
from derive.model.kinematics.rewriting import speaks_of_motion
from derive.model.language.shape import Document
from derive.model.mechanism.frames import Names
from derive.model.mechanism.space import ORIGIN
from derive.model.names import identifier
from derive.model.reader import UNREAD, WITH_KINEMATICS, Reader
from derive.model.records import CHOICE_KINDS, Choice, Measure, Output, Span
from derive.model.scope import COORDINATE, INPUT, OUTPUT, PARAMETER, ROW, STATE, VELOCITY

AUTO = Choice("auto", "auto", (), Span(1, 1))
Rows = list[tuple[str, Expression, Span]]


def choices(reader: Reader, document: Document) -> tuple[Choice, ...]:
    """The declared choices of quasi-velocities; `auto` where there are none. Rows that are not
    linear and homogeneous in the velocities, or the same as another, are reported."""
    result = tuple(_choice(reader, key, entry) for key, entry in document.quasi_velocities.items())
    return result or (AUTO,)


def _choice(reader: Reader, key: Key, entry: Scalar | Items | dict[Key, Scalar]) -> Choice:
    name = str(key)
    if name not in CHOICE_KINDS:
        reader.name(key)
    if isinstance(entry, Scalar):
        if entry.text not in CHOICE_KINDS and not entry.text.strip().isidentifier():
            reader.report(
                entry.span,
                f"a formula in the place of the choice '{key}'",
                listed(CHOICE_KINDS),
                f"a choice has a name, and its rows below it: NAME: {{{key}: {entry.text}}}",
            )
            return Choice(name, "auto", (), key.span)
        return Choice(
            name, reader.word(entry, CHOICE_KINDS, "kind of choice") or "auto", (), key.span
        )
    rows = _named_rows(reader, entry) if isinstance(entry, dict) else _listed_rows(reader, entry)
    if not rows:
        reader.report(
            key.span,
            f"the choice '{key}' has no rows",
            f"formulas linear in the velocities, or {listed(CHOICE_KINDS)}",
        )
    return Choice(name, "rows", tuple((row, formula) for row, formula, _ in rows), key.span)


def _named_rows(reader: Reader, entry: dict[Key, Scalar]) -> Rows:
    rows = [(reader.name(key), _row(reader, scalar), key.span) for key, scalar in entry.items()]
    taken = {
        identifier(name): name
        for name, symbol in reader.scope.symbols.items()
        if symbol.kinds != frozenset({VELOCITY})
    }
    for name, _, span in rows:
        if identifier(name) in taken:
            reader.report(
                span,
                f"the quasi-velocity '{name}' has the name of "
                f"{_kind(reader, taken[identifier(name)])}",
                "another name",
            )
    _check_twice(reader, rows)
    return rows


def _kind(reader: Reader, name: str) -> str:
    kinds = reader.scope.symbols[name].kinds
    return next(iter(kinds)) if len(kinds) == 1 else "a definition"


def _listed_rows(reader: Reader, entry: Items) -> Rows:
    taken = {identifier(name) for name in reader.scope.symbols}
    rows: Rows = []
    for number, scalar in enumerate(entry, 1):
        formula = _row(reader, scalar)
        rows.append((_row_name(formula, number, taken), formula, scalar.span))
    _check_twice(reader, rows)
    return rows


def _row_name(formula: Expression, number: int, taken: set[str]) -> str:
    """A readable name: q1_dot for der(q1), base_vx for base.vx, else w and its number."""
    match formula:
        case tree.Rate(name):
            natural = f"{name}_dot"
        case tree.Name(name):
            return identifier(name)
        case _:
            natural = f"w{number}"
    while natural in taken:
        natural += "_w"
    return natural


def _check_twice(reader: Reader, rows: Rows) -> None:
    for index, (name, formula, span) in enumerate(rows):
        if formula is UNREAD:
            continue  # reported where it was read
        same = [other for other, earlier, _ in rows[:index] if earlier == formula]
        if same:
            reader.report(
                span, f"the row '{name}' is the same as the row '{same[0]}'", "independent rows"
            )
        elif any(identifier(other) == identifier(name) for other, _, _ in rows[:index]):
            reader.report(span, f"two rows are called '{name}'", "another name")


def _row(reader: Reader, scalar: Scalar) -> Expression:
    before = len(reader.problems)
    formula = reader.formula(scalar, "a quasi-velocity", ROW)
    lowest, highest = velocity_degree(reader, formula)
    if len(reader.problems) > before or lowest == highest == 1:
        return formula
    if highest <= 0:
        problem = "a quasi-velocity without velocities"
    elif highest > 1:
        problem = "a quasi-velocity that is not linear in the velocities"
    else:
        problem = "a quasi-velocity with a part that holds no velocity"
    reader.report(scalar.span, problem, "a formula linear in der(q) and the generalized velocities")
    return formula


def state_name(
    reader: Reader, key: Key, inputs: bool = False, more: Iterable[str] = ()
) -> str | None:
    """The coordinate, rate or generalized velocity (or input) that a key such as `q1`, `der(q1)` or
    `base.vx` names, in its canonical spelling; `more` is what the place knows besides."""
    scalar = Scalar(str(key), key.span, True, True)
    scope = reader.scope
    kinds: tuple[frozenset[str], ...] = tuple(
        frozenset({kind}) for kind in (COORDINATE, VELOCITY, *((INPUT, STATE) if inputs else ()))
    )

    def known() -> list[str]:
        return [name for name, symbol in scope.symbols.items() if symbol.kinds in kinds]

    try:
        node = expression(scalar.text)
        if not isinstance(node, tree.Name | tree.Rate):
            raise FormulaError(
                f"'{key}' is not a coordinate or velocity", str(key), 0, listed(known())
            )
        if isinstance(node, tree.Rate):
            return f"der({scope.resolved(node, ROW, '', str(key)).name})"  # type: ignore[union-attr]
        name = f"der({scope.aliases[node.name]})" if node.name in scope.aliases else node.name
        if name not in scope.symbols or scope.symbols[name].kinds not in kinds:
            if name in scope.of_kind(STATE):
                message = f"the initial value of the state '{key}'"
                raise FormulaError(message, str(key), 0, "`initial:` of its entry under `states:`")
            message = (
                f"'{key}' is not a coordinate or velocity"
                if name in scope.symbols
                else f"unknown coordinate or velocity '{key}'"
            )
            names = [*known(), *more]
            rate = f"der({name.removesuffix('_dot')})"
            near = f"did you mean '{rate}'?" if rate in names else did_you_mean(name, names)
            raise FormulaError(message, str(key), 0, listed(names), near)
    except FormulaError as error:
        reader.fault(scalar, error)
        return None
    return name


def output(reader: Reader, document: Document, names: Names, key: Key, scalar: Scalar) -> Output:
    """A formula of a number or of a vector, or position, velocity, angle or reaction of
    something."""
    reader.name(key)
    try:
        parsed = expression(
            scalar.text,
            reader.scope.symbols,
            WITH_KINEMATICS | reader.functions | OUTPUT_FUNCTIONS,
            vectors=True,
        )
        formula, unit = _output(reader, document, parsed, scalar.text)
        check_pieces(formula, reader.values, scalar.text)
    except FormulaError as error:
        reader.fault(scalar, error)
        formula, unit = ZERO, ""
    unit = _angle_unit(formula, names, reader.measures.found) or unit
    return Output(str(key), formula, scalar.text, unit, key.span)


def _output(
    reader: Reader, document: Document, parsed: Expression, text: str
) -> tuple[Expression, str]:
    if _is_of_body(parsed, reader, document):
        return _geometric(reader, document, parsed, text)
    for node in tree.walk(parsed):
        if isinstance(node, tree.Call) and node.function == "reaction":
            raise FormulaError("reaction() inside a formula", text, node.at, "reaction(…) alone")
    if speaks_of_motion(text):
        rewritten = reader.rewriting(text, accelerations=True).rewritten(parsed)
        if isinstance(rewritten, tuple):
            return _vector(reader, rewritten, parsed.at, text)
        parsed = rewritten
    elif any(isinstance(node, tree.Vector) for node in tree.walk(parsed)):
        node = next(node for node in tree.walk(parsed) if isinstance(node, tree.Vector))
        raise FormulaError(
            "a list inside a formula",
            text,
            node.at,
            "position(…), velocity(…), angle(…) or reaction(…) alone",
        )
    resolved = reader.scope.resolved(parsed, OUTPUT, "an output", text)
    dimension = infer(resolved, reader.scope.dimensions, text)
    return resolved, pretty(dimension) if isinstance(dimension, tuple) else ""


def _vector(
    reader: Reader, parts: tuple[Expression, ...], at: int, text: str
) -> tuple[Expression, str]:
    """The components, which are of one kind; zeros are of any."""
    entries = tuple(reader.scope.resolved(x, OUTPUT, "an output", text) for x in parts)
    # a sum has the dimension that all its terms have
    dimension = infer(tree.Sum(entries, at), reader.scope.dimensions, text)
    unit = pretty(dimension) if isinstance(dimension, tuple) else ""
    return tree.Vector(entries, at), unit


def _is_of_body(parsed: Expression, reader: Reader, document: Document) -> TypeGuard[tree.Call]:
    """Whether the whole output is a point, velocity or angle of a body against the ground, or a
    reaction: those have functions of their own. All else of the kind is a formula."""
    if not isinstance(parsed, tree.Call) or parsed.function not in OUTPUT_FUNCTIONS:
        return False
    subject, *others = parsed.arguments
    if parsed.function == "reaction":
        return True
    other_frame = isinstance(subject, tree.Name) and subject.name in reader.measures.frames
    own = isinstance(subject, tree.Name) and subject.name in document.bodies
    if parsed.function == "angle":
        return (own or not other_frame) and not others
    return (own or not other_frame) and len(others) < 2 and not _is_frame(reader, others)


def _is_frame(reader: Reader, arguments: list[Expression]) -> bool:
    return any(isinstance(x, tree.Name) and x.name in reader.measures.frames for x in arguments)


def _geometric(
    reader: Reader, document: Document, call: tree.Call, text: str
) -> tuple[Expression, str]:
    subject, *rest = call.arguments
    known = (
        [*document.closures, *document.constraints]
        if call.function == "reaction"
        else list(document.bodies)
    )
    what = "closure or constraint" if call.function == "reaction" else "body"
    if not isinstance(subject, tree.Name) or subject.name not in known:
        name = subject.name if isinstance(subject, tree.Name) else text[subject.at :]
        raise FormulaError(
            f"unknown {what} '{name}'", text, subject.at, listed(known), did_you_mean(name, known)
        )
    if call.function == "angle" and not reader.space.plane:
        raise FormulaError(
            "angle() of a body in space",
            text,
            call.at,
            "angle(body, z), about an axis, or a coordinate: only planar bodies have one angle",
        )
    if call.function in ("angle", "reaction"):
        return call, "rad" if call.function == "angle" else ""
    return _with_point(
        reader, call, subject, rest, text
    ), "m" if call.function == "position" else "m/s"


def _with_point(
    reader: Reader, call: tree.Call, subject: Expression, rest: list[Expression], text: str
) -> Expression:
    """The call with its point in space; the body's origin when left out."""
    if not rest:
        return tree.Call(call.function, (subject, tree.Vector(ORIGIN, call.at)), call.at)
    point, size = rest[0], reader.space.size
    if not isinstance(point, tree.Vector) or len(point.entries) != size:
        raise FormulaError(
            "the second argument is not a point",
            text,
            point.at,
            f"[{', '.join(reader.space.letters)}]",
        )
    entries: list[Expression] = []
    for entry in point.entries:
        resolved = reader.scope.resolved(entry, frozenset({PARAMETER}), "a point", text)
        reader.check_unit(resolved, "a point", "m", text, entry.at)
        entries.append(resolved)
    return tree.Call(
        call.function, (subject, tree.Vector(reader.space.embedded(entries), point.at)), call.at
    )


def _angle_unit(formula: Expression, names: Names, measures: Mapping[str, Measure]) -> str:
    """A coordinate, velocity or its rate on its own keeps its unit, for rad, rad/s and rad/s^2 are
    not seen in dimensions."""
    if not isinstance(formula, tree.Name | tree.Rate):
        return ""
    measure = measures.get(formula.name)
    if measure is not None and measure.quantity == SPEEDING:
        speed = names.unit(f"der({measure.frame})") or names.unit(measure.frame)
        return f"{speed}^2" if speed == "rad/s" else ""
    wanted = f"der({formula.name})" if isinstance(formula, tree.Rate) else formula.name
    return names.unit(wanted)
