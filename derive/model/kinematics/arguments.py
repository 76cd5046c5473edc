"""What the arguments of functions of the motion are: a body, a point of it, a frame to be seen
from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from derive.diagnostics import did_you_mean, listed
from derive.expressions import tree
from derive.expressions.evaluate import is_constant, number
from derive.expressions.linearity import Degree
from derive.expressions.mistakes import FormulaError
from derive.expressions.tree import ONE, ZERO, Call, Expression, Name
from derive.model.kinematics.measures import (
    ACCELERATIONS,
    DIMENSIONS,
    POSITIONS,
    Measures,
    Spot,
)
from derive.model.mechanism.space import ORIGIN, Space, normalised
from derive.model.records import GROUND, Measure, Vector3
from derive.model.scope import ACCELERATION, COORDINATE, VELOCITY, Scope, Symbol

Parts = tuple[Expression, ...]  # of a vector, along the axes of the model
Rewritten = Expression | Parts
ALONE = "accelerations can stand in `outputs:` alone"


@dataclass(frozen=True)
class Arguments:
    """Those in one formula; `point_entry` reads an entry of a point and checks its unit. With
    `accelerations` velocities have rates, which depend on v̇."""

    measures: Measures
    scope: Scope
    space: Space
    point_entry: Callable[[Expression, str], Expression]
    text: str
    accelerations: bool = False

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

    @staticmethod
    def _at_rest(quantity: str, spot: Spot, letters: str) -> Expression:
        if quantity == "position":
            return spot.point["xyz".index(letters)]
        if quantity == "orientation" and letters[0] == letters[1]:
            return ONE
        return ZERO

    def vector_of(self, quantity: str, spot: Spot, relative: str, node: Expression) -> Parts:
        """A measure along each axis of the model."""
        return tuple(
            self.measure(quantity, spot, relative, letter, node) for letter in self.space.letters
        )

    def frame(self, node: Expression) -> str:
        """The name of a body, frame, joint or the ground."""
        known = self.measures.frames
        name = node.name if isinstance(node, Name) else ""
        if name not in known:
            said = f"unknown body or frame '{name}'" if name else "this is no body or frame"
            raise self.fault(said, node, listed(known), did_you_mean(name, known) if name else "")
        return name

    def point(self, node: Expression) -> Vector3:
        """A point of a frame: numbers and parameters in m."""
        if not isinstance(node, tree.Vector) or len(node.entries) != self.space.size:
            expected = f"[{', '.join(self.space.letters)}]"
            raise self.fault("the second argument is not a point", node, expected)
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
            raise self.fault(
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
            raise self.fault(
                "this is no direction",
                node,
                f"{', '.join(letters)}, with or without a minus, or a list of numbers",
            )
        assert isinstance(node, tree.Vector)
        embedded = self.space.embedded(list(node.entries))
        a, b, c = (number(entry, {}, self.text) for entry in embedded)
        unit = normalised((a, b, c))
        if unit is None:
            raise self.fault("a direction of length zero", node, "a direction")
        x, y, z = (entry.value if isinstance(entry, tree.Number) else 0.0 for entry in unit)
        return (x, y, z)

    def check_function(self, node: Call) -> None:
        """Raises FormulaError for accelerations where none can stand."""
        if node.function in ACCELERATIONS and not self.accelerations:
            raise self.fault(f"{node.function}() in this formula", node, "velocities", ALONE)

    def components(self) -> str:
        """How many a vector has, and their letters."""
        return f"{self.space.size}: {', '.join(self.space.letters)}"

    def fault(self, message: str, node: Expression, expected: str, hint: str = "") -> FormulaError:
        """What is wrong at this place of the formula."""
        return FormulaError(message, self.text, node.at, expected, hint)
