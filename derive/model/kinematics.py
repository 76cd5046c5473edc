"""Where bodies and frames are and how they move, in formulas: position(load), distance(a, b) …

A formula with such functions is rewritten into one of numbers. What stands for the mechanics in it
are measures, one number each: the x of the position of a point. They are names with a meaning that
derive.mechanics and the reference of verify each know from kinematics of their own.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from itertools import islice

from derive.diagnostics import did_you_mean, listed
from derive.expressions import tree
from derive.expressions.differentiate import rate
from derive.expressions.dimensions import Inferred
from derive.expressions.evaluate import is_constant, number
from derive.expressions.functions import KINEMATIC_FUNCTIONS
from derive.expressions.linearity import Degree
from derive.expressions.mistakes import FormulaError
from derive.expressions.tree import ONE, ZERO, Call, Expression, Name
from derive.expressions.units import LENGTH, NUMBER, TIME, quotient_of
from derive.model.limits import LONGEST_RATE
from derive.model.quantities import minus, negated, plus, times
from derive.model.records import GROUND, Measure, Vector3
from derive.model.scope import (
    ACCELERATION,
    COORDINATE,
    PARAMETER,
    STATE,
    VELOCITY,
    Scope,
    Symbol,
)
from derive.model.space import ORIGIN, Space, normalised

WORDS = re.compile(rf"\b(?:{'|'.join(KINEMATIC_FUNCTIONS)})\s*\(|\bder\s*\(")
Parts = tuple[Expression, ...]  # of a vector, along the axes of the model
Rewritten = Expression | Parts
SPEED = quotient_of(LENGTH, TIME)
PER_TIME = quotient_of(NUMBER, TIME)
ALONE = "accelerations can stand in `outputs:` alone"
SPEEDING = "speeding"  # of the rate of a coordinate, or of a generalized velocity
# what a measure is, its rate, and its dimension
POSITIONS: Mapping[str, str] = {
    "position": "velocity",
    "orientation": "turning",
    "angle": "angular_velocity",
    "length": "lengthening",
}
VELOCITIES: Mapping[str, str] = {
    "velocity": "acceleration",
    "turning": "second_turning",
    "angular_velocity": "angular_acceleration",
    "lengthening": "second_lengthening",
}
ACCELERATIONS = frozenset({*VELOCITIES.values(), SPEEDING})
DIMENSIONS: Mapping[str, Inferred] = {
    "position": LENGTH,
    "velocity": SPEED,
    "orientation": NUMBER,
    "turning": PER_TIME,
    "angle": NUMBER,
    "angular_velocity": PER_TIME,
    "length": LENGTH,
    "lengthening": SPEED,
    "acceleration": quotient_of(SPEED, TIME),
    "second_turning": quotient_of(PER_TIME, TIME),
    "angular_acceleration": quotient_of(PER_TIME, TIME),
    "second_lengthening": quotient_of(SPEED, TIME),
}


@dataclass(frozen=True)
class Spot:
    """A point of a body or frame, in its own axes."""

    frame: str
    point: Vector3


class Measures:
    """The measures that the formulas of a file use, by name; `frames`: whatever has a place;
    `paths`: whatever has a length."""

    def __init__(self) -> None:
        self.frames: tuple[str, ...] = (GROUND,)
        self.paths: tuple[str, ...] = ()
        self.found: dict[str, Measure] = {}

    def named(self, measure: Measure) -> str:
        """The name of a measure, which is a new one unless it is there already."""
        stem = measure.name
        for count in range(1, len(self.found) + 2):
            name = stem if count == 1 else f"{stem}#{count}"
            other = self.found.get(name)
            if other is None:
                self.found[name] = Measure(name, *_meaning(measure))
                return name
            if _meaning(other) == _meaning(measure):
                return name
        raise AssertionError("unreachable")

    def of(self, accelerations: bool) -> tuple[Measure, ...]:
        """Those that are accelerations, or the others."""
        found = self.found.values()
        return tuple(x for x in found if (x.quantity in ACCELERATIONS) == accelerations)


def _meaning(
    measure: Measure,
) -> tuple[str, str, Vector3, str, tuple[int, ...]]:
    return (
        measure.quantity,
        measure.frame,
        measure.point,
        measure.relative,
        measure.component,
    )


def _is_rate(node: Expression) -> bool:
    return isinstance(node, tree.Rate) or (isinstance(node, Call) and node.function == "der")


def _is_long(given: Rewritten) -> bool:
    parts = given if isinstance(given, tuple) else (given,)
    return any(any(islice(tree.walk(part), LONGEST_RATE, None)) for part in parts)


def speaks_of_motion(text: str) -> bool:
    """Whether a formula uses functions of this module."""
    return WORDS.search(text) is not None


@dataclass(frozen=True)
class Rewriting:
    """One formula on its way; `point_entry` reads an entry of a point and checks its unit. With
    `accelerations` velocities have rates, which depend on v̇. `own` are functions of the model that
    may be called as some of the motion."""

    measures: Measures
    scope: Scope
    space: Space
    definitions: Mapping[str, Expression]
    point_entry: Callable[[Expression, str], Expression]
    text: str
    accelerations: bool = False
    own: Collection[str] = ()
    rates: dict[str, Expression] = field(default_factory=dict[str, Expression])  # of definitions

    def scalar(self, node: Expression) -> Expression:
        """The formula as one of numbers. Raises FormulaError where it is a vector."""
        result = self.rewritten(node)
        if isinstance(result, tuple):
            letters = " or ".join(f".{letter}" for letter in self.space.letters)
            raise FormulaError(
                "a vector where a number is needed",
                self.text,
                node.at,
                f"a component, {letters}, or norm(…) or dot(…, …)",
            )
        return result

    def vector(self, node: Expression) -> Parts:
        """The formula as components. Raises FormulaError where it is a number."""
        result = self.rewritten(node)
        if not isinstance(result, tuple):
            raise FormulaError(
                "a number where a vector is needed", self.text, node.at, "position(…), a list, …"
            )
        return result

    def rewritten(self, node: Expression) -> Rewritten:
        """A number, or the components of a vector."""
        match node:
            case tree.Vector(entries):
                return self._list(node, entries)
            case tree.Sum(terms, at):
                return self._sum(terms, at)
            case tree.Negative(argument, at):
                inner = self.rewritten(argument)
                if isinstance(inner, tuple):
                    return tuple(negated(x) for x in inner)
                return tree.Negative(inner, at)
            case tree.Product(factors, at):
                return self._product(factors, at)
            case tree.Quotient(above, below, at):
                return self._quotient(above, below, at)
            case tree.Power(base, exponent, at):
                return tree.Power(self.scalar(base), self.scalar(exponent), at)
            case Call():
                return self._call(node)
            case tree.Rate(name) if name in self.definitions or self._is_velocity(name):
                return self._rate_of(Name(name, node.at), node.at)
            case _:
                pass
        return node

    def _list(self, node: Expression, entries: Parts) -> Parts:
        if len(entries) != self.space.size:
            raise self._fault(f"a vector with {len(entries)} components", node, self._components())
        return tuple(self.scalar(entry) for entry in entries)

    def _sum(self, terms: Parts, at: int) -> Rewritten:
        result = [self.rewritten(term) for term in terms]
        vectors = [x for x in result if isinstance(x, tuple)]
        if not vectors:
            return tree.Sum(tuple(x for x in result if not isinstance(x, tuple)), at)
        for term, x in zip(terms, result):
            if not isinstance(x, tuple):
                raise self._fault("cannot add a number to a vector", term, "a vector")
        return tuple(plus(*parts) for parts in zip(*vectors))

    def _product(self, factors: Parts, at: int) -> Rewritten:
        result = [self.rewritten(factor) for factor in factors]
        vectors = [x for x in result if isinstance(x, tuple)]
        numbers = [x for x in result if not isinstance(x, tuple)]
        if not vectors:
            return tree.Product(tuple(numbers), at)
        if len(vectors) > 1:
            raise self._fault("a product of vectors", factors[-1], "dot(…, …) or cross(…, …)")
        return tuple(times(*numbers, x) for x in vectors[0])

    def _quotient(self, above: Expression, below: Expression, at: int) -> Rewritten:
        numerator, denominator = self.rewritten(above), self.scalar(below)
        if isinstance(numerator, tuple):
            return tuple(tree.Quotient(x, denominator) for x in numerator)
        return tree.Quotient(numerator, denominator, at)

    def _call(self, node: Call) -> Rewritten:
        if node.function.startswith("."):
            return self._component(node)
        if node.function == "der":
            return self._rate(node)
        if node.function in KINEMATIC_FUNCTIONS and node.function not in self.own:
            return _MEANINGS[node.function](self, node)
        arguments = tuple(self.scalar(argument) for argument in node.arguments)
        return Call(node.function, arguments, node.at)

    def _component(self, node: Call) -> Expression:
        letters, inner = node.function[1:], node.arguments[0]
        axes = self.space.letters
        if isinstance(inner, Call) and inner.function == "orientation":
            if len(letters) != 2 or any(letter not in axes for letter in letters):
                expected = f".{axes[0]}{axes[-1]}: the {axes[0]} of the {axes[-1]} axis, …"
                raise self._fault(f"unknown entry '.{letters}' of an orientation", node, expected)
            row, column = letters
            return self._orientation(inner, row, column)
        parts = self.vector(inner)
        if len(letters) != 1 or letters not in axes:
            raise self._fault(f"unknown component '.{letters}'", node, self._components())
        return parts[axes.index(letters)]

    def _components(self) -> str:
        return f"{self.space.size}: {', '.join(self.space.letters)}"

    def _fault(self, message: str, node: Expression, expected: str, hint: str = "") -> FormulaError:
        return FormulaError(message, self.text, node.at, expected, hint)

    # measures

    def measure(
        self, quantity: str, spot: Spot, relative: str, letters: str, node: Expression
    ) -> Expression:
        """One number of the mechanics as a name that formulas can use. The same frame twice moves
        not against itself."""
        if spot.frame == relative:
            return self._at_rest(quantity, spot, letters)
        component = tuple("xyz".index(letter) for letter in letters)
        against = "" if relative == GROUND else f", {relative}"
        suffix = f".{letters}" if letters else ""
        stem = f"{quantity}({spot.frame}{against}){suffix}"
        name = self.measures.named(
            Measure(stem, quantity, spot.frame, spot.point, relative, component)
        )
        kind = COORDINATE if quantity in POSITIONS else VELOCITY
        kind = ACCELERATION if quantity in ACCELERATIONS else kind
        degree = Degree(1, 1) if kind == VELOCITY else Degree(0, 0)
        unit = "rad/s" if quantity == "angular_velocity" else ""
        self.scope.add(name, Symbol(frozenset({kind}), DIMENSIONS[quantity], degree, unit=unit))
        return Name(name, node.at)

    def _speeding(self, name: str, speed: Symbol, node: Name | tree.Rate) -> Expression:
        """The rate of the rate of a coordinate, or of a generalized velocity."""
        stem = f"der({name})" if "." in name else f"der(der({name}))"
        given = self.measures.named(Measure(stem, SPEEDING, name, ORIGIN, GROUND, ()))
        known = speed.dimension
        dimension = quotient_of(known, TIME) if isinstance(known, tuple) else known
        self.scope.add(given, Symbol(frozenset({ACCELERATION}), dimension))
        return Name(given, node.at)

    @staticmethod
    def _at_rest(quantity: str, spot: Spot, letters: str) -> Expression:
        if quantity == "position":
            return spot.point["xyz".index(letters)]
        if quantity == "orientation" and letters[0] == letters[1]:
            return ONE
        return ZERO

    def _vector_of(self, quantity: str, spot: Spot, relative: str, node: Expression) -> Parts:
        return tuple(
            self.measure(quantity, spot, relative, letter, node) for letter in self.space.letters
        )

    def _rate(self, node: Call) -> Rewritten:
        """Of a number, or of each component of a vector. A rate of rates grows with the product of
        all: refused where it has too many terms, before and after it is written out."""
        (argument,) = node.arguments
        given = self.rewritten(argument)
        again = any(_is_rate(x) for x in tree.walk(argument))
        if again and _is_long(given):
            raise self._too_long("what is itself a rate", node)
        if not isinstance(given, tuple):
            found = self._rate_of(given, node.at)
        else:
            rates = tuple(rate(x, self._leaf_rate, self.text) for x in given)
            found = self._changing(rates, node.at)
        if again and _is_long(found):
            raise self._too_long("what is itself a rate", node)
        return found

    def _too_long(self, what: str, node: Expression) -> FormulaError:
        message = f"der() of {what}, which is written out in {LONGEST_RATE} terms"
        return self._fault(message, node, "shorter definitions, or a rate in formulas of its own")

    def _rate_of(self, expression: Expression, at: int) -> Expression:
        (derivative,) = self._changing((rate(expression, self._leaf_rate, self.text),), at)
        return derivative

    def _changing(self, rates: Parts, at: int) -> Parts:
        if all(x == ZERO for x in rates):
            raise FormulaError(
                "der() of what does not change", self.text, at, "a formula of coordinates or t"
            )
        return rates

    def _is_velocity(self, name: str) -> bool:
        """Whether it is a generalized velocity, as base.vx, or how one may be called: hinge.w."""
        symbol = self.scope.symbols.get(name) if "." in name else None
        own = symbol is not None and symbol.kinds == frozenset({VELOCITY})
        return name in self.scope.aliases or (own and name not in self.measures.found)

    def _leaf_rate(self, node: Name | tree.Rate) -> Expression:
        if isinstance(node, tree.Rate):
            return self._rate_of_speed(node, node.name, f"the rate of '{node.name}'")
        if node.name == "t":
            return ONE
        measure = self.measures.found.get(node.name)
        if measure is not None and measure.quantity not in ACCELERATIONS:
            return self._rate_of_measure(measure, node)
        if node.name in self.definitions:
            return self._definition_rate(node)
        if self._is_velocity(node.name):
            of = self.scope.aliases.get(node.name, node.name)
            return self._rate_of_speed(node, of, f"'{node.name}', a velocity")
        symbol = self.scope.symbols.get(node.name)
        if symbol is None:
            return node  # reported when names are looked up
        if symbol.kinds == frozenset({PARAMETER}):
            return ZERO
        if STATE in symbol.kinds:
            raise self._fault(
                f"der() of the state '{node.name}'",
                node,
                self._smooth(),
                "a rate that needs rates of states, its own or others', is no explicit equation",
            )
        if symbol.kinds == frozenset({COORDINATE}):
            return tree.Rate(node.name, node.at)
        kind = min(symbol.kinds)
        raise self._fault(f"der() of '{node.name}', {kind}", node, self._smooth())

    def _smooth(self) -> str:
        """What has a rate."""
        return "coordinates, velocities and t" if self.accelerations else "coordinates and t"

    def _rate_of_measure(self, measure: Measure, node: Name) -> Expression:
        if measure.quantity in VELOCITIES:
            self._check_place(f"der() of '{measure.name}', a velocity", node)
        quantity = {**POSITIONS, **VELOCITIES}[measure.quantity]
        letters = "".join("xyz"[k] for k in measure.component)
        spot = Spot(measure.frame, measure.point)
        return self.measure(quantity, spot, measure.relative, letters, node)

    def _rate_of_speed(self, node: Name | tree.Rate, name: str, what: str) -> Expression:
        """Of the rate of a coordinate or of a generalized velocity; `what` it is, for the
        message."""
        speed = self.scope.symbols.get(name if "." in name else f"der({name})")
        if speed is None:
            return node  # reported when names are looked up
        self._check_place(f"der() of {what}", node)
        return self._speeding(name, speed, node)

    def _check_place(self, what: str, node: Expression) -> None:
        if not self.accelerations:
            raise self._fault(what, node, self._smooth(), ALONE)

    def _definition_rate(self, node: Name) -> Expression:
        """It is written out, and each product of definitions makes it longer: refused where it has
        too many terms to be walked through."""
        found = self.rates.get(node.name)
        if found is None:
            found = rate(self.definitions[node.name], self._leaf_rate, self.text)
            if _is_long(found):
                raise self._too_long(f"'{node.name}'", node)
            self.rates[node.name] = found
        return found

    # what the arguments are

    def frame(self, node: Expression) -> str:
        """The name of a body, frame, joint or the ground."""
        known = self.measures.frames
        name = node.name if isinstance(node, Name) else ""
        if name not in known:
            said = f"unknown body or frame '{name}'" if name else "this is no body or frame"
            raise self._fault(said, node, listed(known), did_you_mean(name, known) if name else "")
        return name

    def point(self, node: Expression) -> Vector3:
        """A point of a frame: numbers and parameters in m."""
        if not isinstance(node, tree.Vector) or len(node.entries) != self.space.size:
            raise self._fault(
                "the second argument is not a point",
                node,
                f"[{', '.join(self.space.letters)}]",
            )
        return self.space.embedded([self.point_entry(x, self.text) for x in node.entries])

    def spot(self, arguments: list[Expression]) -> Spot:
        """Takes a frame and, where it follows, a point of it."""
        frame = self.frame(arguments.pop(0))
        if arguments and isinstance(arguments[0], tree.Vector):
            return Spot(frame, self.point(arguments.pop(0)))
        return Spot(frame, ORIGIN)

    def rest(self, node: Call, arguments: list[Expression]) -> str:
        """The frame that is left to be seen from; the ground where there is none."""
        if not arguments:
            return GROUND
        if len(arguments) > 1:
            raise self._fault(
                f"{node.function}() does not take this", arguments[1], "a body, a point, a frame"
            )
        return self.frame(arguments[0])

    def axis(self, node: Expression) -> tuple[float, float, float]:
        """A constant direction of length one: a letter, with or without a minus, or numbers."""
        letters = self.space.letters
        if isinstance(node, tree.Negative):
            x, y, z = self.axis(node.argument)
            return (0.0 - x, 0.0 - y, 0.0 - z)
        if isinstance(node, Name) and node.name in letters:
            x, y, z = (float(letter == node.name) for letter in "xyz")
            return x, y, z
        sized = isinstance(node, tree.Vector) and len(node.entries) == self.space.size
        if not sized or not is_constant(node):
            raise self._fault(
                "this is no direction",
                node,
                f"{', '.join(letters)}, with or without a minus, or a list of numbers",
            )
        assert isinstance(node, tree.Vector)
        embedded = self.space.embedded(list(node.entries))
        a, b, c = (number(entry, {}, self.text) for entry in embedded)
        unit = normalised((a, b, c))
        if unit is None:
            raise self._fault("a direction of length zero", node, "a direction")
        x, y, z = (entry.value if isinstance(entry, tree.Number) else 0.0 for entry in unit)
        return (x, y, z)

    # what the functions mean

    def moving(self, node: Call) -> Parts:
        """position, velocity or acceleration of a point, seen from a frame and along its axes."""
        self._check_function(node)
        arguments = list(node.arguments)
        spot = self.spot(arguments)
        return self._vector_of(node.function, spot, self.rest(node, arguments), node)

    def orientation(self, node: Call) -> Parts:
        """Only entries of a matrix are numbers."""
        raise self._fault("a matrix where a number is needed", node, "an entry, such as .xx")

    def _orientation(self, node: Call, row: str, column: str) -> Expression:
        frame, *others = node.arguments
        spot = Spot(self.frame(frame), ORIGIN)
        return self.measure("orientation", spot, self.rest(node, others), row + column, node)

    def direction(self, node: Call) -> Parts:
        """A direction fixed in a frame: R d."""
        frame, along, *others = node.arguments
        axis = dict(zip("xyz", self.axis(along)))
        spot, relative = Spot(self.frame(frame), ORIGIN), self.rest(node, others)
        letters = self.space.letters
        return tuple(
            plus(
                *(
                    times(
                        tree.Number(axis[column]),
                        self.measure("orientation", spot, relative, row + column, node),
                    )
                    for column in letters
                    if axis[column]
                )
            )
            for row in letters
        )

    def angle(self, node: Call) -> Expression:
        """In a plane the angle against a frame; in space that about an axis of the frame: the twist
        of R into a turn about the axis and one across it, tan θ = e·[R]ˣ/(tr R − e·R e)."""
        frame, *others = node.arguments
        spot = Spot(self.frame(frame), ORIGIN)
        if self.space.plane:
            return self.measure("angle", spot, self.rest(node, others), "", node)
        if not others:
            raise self._fault(
                "angle() of a body in space without an axis", node, "angle(body, z) or such"
            )
        axis, relative = self.axis(others[0]), self.rest(node, others[1:])

        def entry(i: int, j: int) -> Expression:
            """R_ij of the frame."""
            return self.measure("orientation", spot, relative, "xyz"[i] + "xyz"[j], node)

        turned: list[Expression] = []
        along: list[Expression] = []
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            if axis[k]:
                skew = minus(entry(j, i), entry(i, j))
                turned.append(times(tree.Number(axis[k]), skew))
            for m in range(3):
                weight = float(k == m) - axis[k] * axis[m]
                if weight:
                    along.append(times(tree.Number(weight), entry(k, m)))
        return Call("atan2", (plus(*turned), plus(*along)), node.at)

    def turning(self, node: Call) -> Rewritten:
        """ω against a frame and along its axes, or the rate of that; a number about the normal in a
        plane."""
        self._check_function(node)
        frame, *others = node.arguments
        spot, relative = Spot(self.frame(frame), ORIGIN), self.rest(node, others)
        if self.space.plane:
            return self.measure(node.function, spot, relative, "", node)
        return self._vector_of(node.function, spot, relative, node)

    def _check_function(self, node: Call) -> None:
        if node.function in ACCELERATIONS and not self.accelerations:
            raise self._fault(f"{node.function}() in this formula", node, "velocities", ALONE)

    def distance(self, node: Call) -> Expression:
        """Between two points: |r₂ − r₁|."""
        arguments = list(node.arguments)
        ends = [self._end(arguments, node) for _ in range(2)]
        if arguments:
            raise self._fault("distance() does not take this", arguments[0], "two points")
        if ends[0] == ends[1]:
            raise self._fault("a length that is always zero", node, "two points that differ")
        return self.size(tuple(minus(b, a) for a, b in zip(*ends)), node)

    def _end(self, arguments: list[Expression], node: Call) -> Parts:
        if not arguments:
            raise self._fault("distance() takes two points", node, "distance(a, b)")
        if isinstance(arguments[0], Name):
            return self._vector_of("position", self.spot(arguments), GROUND, node)
        return self.vector(arguments.pop(0))

    def length(self, node: Call) -> Expression:
        """Of a path."""
        (path,), known = node.arguments, self.measures.paths
        name = path.name if isinstance(path, Name) else ""
        if name not in known:
            said = f"unknown path '{name}'" if name else "this is no path"
            hint = did_you_mean(name, known) if name else ""
            raise self._fault(said, path, listed(known) or "a path of `paths:`", hint)
        return self.measure("length", Spot(name, ORIGIN), GROUND, "", node)

    def size(self, parts: Parts, node: Call) -> Expression:
        """|a|. Raises FormulaError where it is zero at every position."""
        square = plus(*(tree.Power(x, tree.Number(2.0)) for x in parts if x != ZERO))
        if square == ZERO:
            raise self._fault("a length that is always zero", node, "two points that differ")
        return Call("sqrt", (square,), node.at)

    def norm(self, node: Call) -> Expression:
        """|a|."""
        return self.size(self.vector(node.arguments[0]), node)

    def dot(self, node: Call) -> Expression:
        """a · b."""
        a, b = (self.vector(argument) for argument in node.arguments)
        return plus(*(times(x, y) for x, y in zip(a, b)))

    def cross(self, node: Call) -> Rewritten:
        """a × b; in a plane its component along the normal."""
        a, b = (self.vector(argument) for argument in node.arguments)

        def entry(i: int, j: int) -> Expression:
            """aᵢ bⱼ − aⱼ bᵢ."""
            return minus(times(a[i], b[j]), times(a[j], b[i]))

        if self.space.plane:
            return entry(0, 1)
        return (entry(1, 2), entry(2, 0), entry(0, 1))


_MEANINGS: dict[str, Callable[[Rewriting, Call], Rewritten]] = {
    "position": Rewriting.moving,
    "velocity": Rewriting.moving,
    "acceleration": Rewriting.moving,
    "direction": Rewriting.direction,
    "orientation": Rewriting.orientation,
    "angle": Rewriting.angle,
    "angular_velocity": Rewriting.turning,
    "angular_acceleration": Rewriting.turning,
    "distance": Rewriting.distance,
    "length": Rewriting.length,
    "dot": Rewriting.dot,
    "cross": Rewriting.cross,
    "norm": Rewriting.norm,
}
