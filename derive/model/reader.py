"""Formulas, points and directions of a file → trees with resolved names and checked units.

A Reader collects problems instead of stopping at the first: a bad formula is reported and read as
zero, and `finish` raises.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from functools import cache
from typing import TypeVar

from derive.diagnostics import Diagnostic, ModelError, did_you_mean, distinct, listed
from derive.expressions import tree
from derive.expressions.dimensions import SHORT, Inferred, infer, with_unit
from derive.expressions.evaluate import is_constant, number
from derive.expressions.functions import FUNCTIONS, KINEMATIC_FUNCTIONS, Function
from derive.expressions.limits import too_large
from derive.expressions.mistakes import FormulaError
from derive.expressions.parser import expression
from derive.expressions.piece_order import check_pieces
from derive.expressions.quantities import plain_number, quantity, unit
from derive.expressions.tables import Table
from derive.expressions.tree import Expression, Number
from derive.expressions.units import (
    ENERGY,
    NUMBER,
    TIME,
    Dimension,
    named,
    pretty,
    product_of,
    quotient_of,
)
from derive.model.document import Items, Key, Scalar, Source
from derive.model.kinematics.arguments import Arguments
from derive.model.kinematics.measures import Measures
from derive.model.kinematics.rates import Rates
from derive.model.kinematics.rewriting import Rewriting, speaks_of_motion
from derive.model.mechanism.space import ORIGIN, Space, normalised
from derive.model.names import objection
from derive.model.records import Path, Span, Vector3
from derive.model.scope import CONSTANT, Scope

T = TypeVar("T")
ANY_UNIT = None
# a number without a unit, which is read as a formula
PLAIN = re.compile(r"[+-]?[0-9]+(\.[0-9]*)?([eE][+-]?[0-9]+)?")
ANSWERS = {"true": True, "false": False}
WITH_KINEMATICS = FUNCTIONS | KINEMATIC_FUNCTIONS
ANGLE = "a plain number or an angle"
UNREAD = tree.Name(
    "?"
)  # stands for a formula that was reported; it has no value, so nothing more is said about it


class Reader:
    """`values`: defaults of the parameters and of what follows from them alone, for checks that
    need numbers."""

    def __init__(self, source: Source, space: Space) -> None:
        self.source, self.space = source, space
        self.scope = Scope()
        self.values: dict[str, float] = {}
        self.units: dict[str, str] = {}  # of the parameters
        self.definitions: dict[str, Expression] = {}
        self.measures = Measures()
        self.functions: dict[str, Function] = dict(FUNCTIONS)  # and the model's tables
        self.curves: dict[str, Table] = {}  # the tables by name
        self.paths: dict[str, Path] = {}
        self.problems: list[Diagnostic] = []
        self.notes: list[str] = []  # what is taken otherwise than a reader might expect
        # what was read of a text, with the names as they are: repetitions say the same many times
        self._read: dict[tuple[object, ...], Expression] = {}
        self._version = 0

    def report(self, span: Span, message: str, expected: str = "", hint: str = "") -> None:
        """Note a problem and go on."""
        self.problems.append(self.source.diagnostic(span, message, expected, hint))

    def finish(self) -> None:
        """Raise what was noted."""
        if self.problems:
            raise ModelError(distinct(self.problems))

    def fault(self, scalar: Scalar, error: FormulaError) -> None:
        """Note a formula's error at its place in the file."""
        message, expected, hint = error.detail
        self.report(scalar.at(error.at, error.length), message, expected, hint)

    def word(self, scalar: Scalar, known: Iterable[str], what: str) -> str | None:
        """A name out of `known`, or None after reporting it with the nearest."""
        known = known if isinstance(known, Collection) else list(known)
        if scalar.text in known:
            return scalar.text
        candidates = list(known)
        self.report(
            scalar.span,
            f"unknown {what} '{scalar.text}'",
            listed(candidates),
            did_you_mean(scalar.text, candidates),
        )
        return None

    def answer(self, scalar: Scalar | None, otherwise: bool) -> bool:
        """Whether `true` or `false` stands there; `otherwise` where nothing does."""
        return self.choice(scalar, ANSWERS, "answer", otherwise)

    def choice(self, scalar: Scalar | None, known: Mapping[str, T], what: str, otherwise: T) -> T:
        """What a word of `known` stands for; `otherwise` where no word stands or it is none."""
        if scalar is None:
            return otherwise
        word = self.word(scalar, known, what)
        return otherwise if word is None else known[word]

    def name(self, key: Key | Scalar) -> str:
        """A name that the model introduces; reported where it cannot be one."""
        text = key.text if isinstance(key, Scalar) else str(key)
        if problem := objection(text):
            self.report(key.span, *problem)
        return text

    def unit(self, scalar: Scalar) -> str:
        """A unit on its own, in SI; the model's numbers are in SI, so only coherent units can be
        declared."""
        try:
            given = unit(scalar.text)
        except FormulaError as error:
            self.fault(scalar, error)
            return ""
        if given.factor != 1.0:
            self.report(
                scalar.span,
                f"'{scalar.text}' is not an SI unit",
                given.si,
                f"the generated functions use SI: write {given.si}",
            )
        return given.si

    def formula(
        self,
        scalar: Scalar,
        where: str,
        allowed: frozenset[str] = CONSTANT,
        unit: str | None = ANY_UNIT,
        functions: dict[str, Function] = FUNCTIONS,
    ) -> Expression:
        """A scalar formula; `where` names the place ("a mass") for messages, `unit` is the SI unit
        it must have, `allowed` are the kinds of names it may use. A bad one is reported and read as
        UNREAD."""
        plain = plain_number(scalar.text)
        if plain is not None:
            return plain  # it fits every unit, and is a value by itself
        if self.scope.version != self._version:
            self._read, self._version = {}, self.scope.version
        asked = (scalar.text, where, allowed, unit, id(functions))
        if asked in self._read:
            return self._read[asked]
        try:
            self._read[asked] = self._formula(scalar, where, allowed, unit, functions)
            return self._read[asked]
        except FormulaError as error:
            self.fault(scalar, error)
            return UNREAD

    def _formula(
        self,
        scalar: Scalar,
        where: str,
        allowed: frozenset[str],
        wanted: str | None,
        functions: dict[str, Function],
    ) -> Expression:
        plain = None if PLAIN.fullmatch(scalar.text) else quantity(scalar.text)
        bracketed = "(" in scalar.text  # 10 N/(m) may be a unit, or a force by the model's own m
        of_place = wanted is not None or allowed == CONSTANT
        if plain is not None and plain.unit and of_place and not bracketed:
            return self._of_unit(plain, scalar.text, where, wanted)
        text = scalar.text
        names = self.scope.usable(allowed)
        known = self.functions if functions is FUNCTIONS else functions
        if functions is FUNCTIONS and speaks_of_motion(text):
            every = WITH_KINEMATICS | self.functions
            parsed = self.rewritten(expression(text, names, every, vectors=True), text)
        else:
            parsed = expression(text, names=names, functions=known)
        if allowed == CONSTANT:
            _check_calls(parsed, where, text)
        resolved = self.scope.resolved(parsed, allowed, where, text)
        self.check_unit(resolved, where, wanted, text)
        if functions is FUNCTIONS:
            self._check_value(resolved, text)
            check_pieces(resolved, self.values, text)
        return resolved

    def rewritten(self, parsed: Expression, text: str) -> Expression:
        """A formula with functions of the motion as one of numbers. Raises FormulaError where it
        is none."""
        return self.rewriting(text).scalar(parsed)

    def rewriting(self, text: str, accelerations: bool = False) -> Rewriting:
        """What functions of the motion mean in the formula `text`; in one with `accelerations`
        velocities have rates."""
        tables = self.measures, self.scope, self.space
        arguments = Arguments(*tables, self._point_entry, text, accelerations)
        return Rewriting(arguments, Rates(arguments, self.definitions), self.curves.keys())

    def _point_entry(self, entry: Expression, text: str) -> Expression:
        resolved = self.scope.resolved(entry, CONSTANT, "a point", text)
        self.check_unit(resolved, "a point", "m", text, entry.at)
        return resolved

    def _check_value(self, formula: Expression, text: str) -> None:
        """FormulaError where a formula of parameters alone has no admissible value at their
        defaults."""
        leaves = (n for n in tree.walk(formula) if isinstance(n, tree.Name | tree.Rate))
        known = all(isinstance(n, tree.Name) and n.name in self.values for n in leaves)
        if known and not _tabulated(formula):
            number(formula, self.values, text)

    def _of_unit(self, plain: Number, text: str, where: str, wanted: str | None) -> Number:
        """A number with a unit: where the unit is right, or where a constant of any unit can stand,
        its symbols are units, even if the model has parameters called m or s."""
        if wanted is None or _fits(dimension_of(plain.unit), dimension_of(wanted)):
            return plain
        own = [word for word in re.findall(r"[A-Za-z_]\w*", text) if word in self.scope.symbols]
        hint = (
            f"'{own[-1]}' is read as a unit here; in (2 N)*{own[-1]} it is the model's own name"
            if own
            else ""
        )
        raise FormulaError(
            f"{where} in {plain.unit}", text, _first_place(text), _unit_of_formula(wanted), hint
        )

    def of_parameters(self, scalar: Scalar, where: str, unit: str | None) -> Expression:
        """A formula of numbers and parameters alone: for values that are needed without the model
        around them."""
        formula = self.formula(scalar, where, unit=unit)
        for node in tree.walk(formula):
            if isinstance(node, tree.Name) and node.name in self.definitions:
                self.report(
                    scalar.at(node.at, len(node.name)),
                    f"the definition '{node.name}' in {where}",
                    "numbers and parameters",
                )
        return formula

    def check_unit(
        self, resolved: Expression, where: str, wanted: str | None, text: str, at: int | None = None
    ) -> Inferred:
        """FormulaError where a resolved formula does not have the wanted unit, or mixes units."""
        dimension = infer(resolved, self.scope.dimensions, text)
        if wanted is not None and not _fits(dimension, dimension_of(wanted)):
            assert isinstance(dimension, tuple)  # whatever else fits
            missing = quotient_of(dimension_of(wanted), dimension)
            raise FormulaError(
                f"{where} in {named(dimension)}",
                text,
                _first_place(text) if at is None else at,
                _unit_of_formula(wanted),
                _advice(resolved, missing, text) if dimension == NUMBER else "",
            )
        return dimension

    def refuse_tables(self, formula: Expression, scalar: Scalar, where: str) -> None:
        """Note a table where none can stand."""
        try:
            _check_calls(formula, where, scalar.text)
        except FormulaError as error:
            self.fault(scalar, error)

    def value(self, formula: Expression, scalar: Scalar) -> float | None:
        """The number a formula of parameters has with their defaults; None where it was reported or
        has none."""
        if isinstance(formula, Number) and not too_large(formula.value):
            return formula.value
        if _tabulated(formula) or any(
            (isinstance(n, tree.Name) and n.name not in self.values) or isinstance(n, tree.Rate)
            for n in tree.walk(formula)
        ):
            return None
        try:
            return number(formula, self.values, scalar.text)
        except FormulaError as error:
            self.fault(scalar, error)
            return None

    def point(
        self,
        items: Items | None,
        where: str,
        unit: str | None = "m",
        allowed: frozenset[str] = CONSTANT,
    ) -> Vector3:
        """Components on the model's axes → a vector in space; the origin when left out."""
        if items is None:
            return ORIGIN
        if not self.sized(items, self.space.size, where):
            return ORIGIN
        return self.space.embedded([self.formula(entry, where, allowed, unit) for entry in items])

    def sized(self, items: Items, size: int, where: str) -> bool:
        """Whether a list has as many components as vectors of this model have: two in a plane,
        three in space. Reports it where not."""
        if len(items) == size:
            return True
        kind = f"a planar model, plane: {self.space.plane}" if self.space.plane else "space"
        letters = (
            ", ".join(self.space.letters[:size])
            if size == self.space.size
            else ", ".join("…" * size)
        )
        self.report(
            items.span,
            f"{where} with {len(items)} component{'s' * (len(items) != 1)}",
            f"{size} in {kind}: [{letters}]",
        )
        return False

    def direction(self, node: Scalar | Items, where: str, constant: bool = True) -> Vector3:
        """A direction as a letter, `-x`, or components; of length one where it is constant, which
        `constant` demands. Rodrigues' formula and the joints' motions take unit axes for granted.
        """
        if isinstance(node, Scalar):
            return self._letter(node, where)
        if not self.sized(node, self.space.size, where):
            return self.space.normal
        given = self.space.embedded([self.formula(entry, where) for entry in node])
        if UNREAD in given:
            return self.space.normal
        if not all(is_constant(component) for component in given):
            if constant:
                self.report(
                    node.span,
                    f"{where} that depends on parameters",
                    "numbers",
                    "a frame turned with `angle` or `rpy`: of the joint, or of a body fixed so to "
                    "the one meant",
                )
            return given
        return self._normalised(given, node.span, where)

    def _letter(self, scalar: Scalar, where: str) -> Vector3:
        text = scalar.text.replace("+", "")
        known = [sign + letter for letter in self.space.letters for sign in ("", "-")]
        if text not in known:
            self.report(
                scalar.span,
                f"{where} '{scalar.text}'",
                f"{', '.join(self.space.letters)}, with or without a minus, or a list",
            )
            return self.space.normal
        return self.space.along(text)

    def _normalised(self, given: Vector3, span: Span, where: str) -> Vector3:
        a, b, c = (number(component, {}) for component in given)
        direction = normalised((a, b, c))
        if direction is None:
            self.report(span, f"{where} of length zero", "a direction")
        return direction or self.space.normal


def _tabulated(formula: Expression) -> bool:
    """Whether the formula uses a table."""
    calls = (node for node in tree.walk(formula) if isinstance(node, tree.Call))
    return any(call.function not in FUNCTIONS for call in calls)


def _check_calls(parsed: Expression, where: str, text: str) -> None:
    """A number that is needed before anything moves is no value of a table."""
    for node in tree.walk(parsed):
        if isinstance(node, tree.Call) and node.function not in FUNCTIONS:
            message = f"the table '{node.function}' in {where}"
            raise FormulaError(message, text, node.at, "a formula without tables")


def _advice(formula: Expression, missing: Dimension, text: str) -> str:
    """How a plain number becomes a quantity: by the unit of a factor, or by a factor of one."""
    if hint := with_unit(formula, missing, text):
        return hint
    factor = isinstance(formula, tree.Call | tree.Name | tree.Product) and len(text) <= SHORT
    return f"with a unit that is (1 {pretty(missing)})*{text.strip()}" if factor else ""


@cache
def dimension_of(written: str) -> Dimension:
    """The dimension of a unit's text; "" is the plain number."""
    return unit(written).dimension if written else NUMBER


def _fits(found: Inferred, wanted: Inferred) -> bool:
    return not isinstance(found, tuple) or found == wanted


def _unit_of_formula(unit: str) -> str:
    return ANGLE if unit in ("", "1") else unit


def _first_place(text: str) -> int:
    return len(text) - len(text.lstrip())


@cache
def force_unit(unit_of_velocity: str) -> str:
    """The unit of the force conjugate to a velocity, such that force times velocity is a power in
    W: N for m/s, N*m for rad/s."""
    coordinate = product_of(dimension_of(unit_of_velocity), TIME)
    return "N*m" if coordinate == NUMBER else pretty(quotient_of(ENERGY, coordinate))
