"""The functions a formula may call: a whitelist, with how each treats units."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Function:
    """`arity` is (least, most). `units`: "number" takes and gives plain numbers, "same" keeps the
    unit of its arguments, "pieces" that of every other one, "root" halves it, "ratio" takes equal
    units and gives a number, "sign" takes any and gives a number."""

    name: str
    arity: tuple[int, int]
    units: str
    about: str


_TABLE = (
    Function("sin", (1, 1), "number", "sine of an angle"),
    Function("cos", (1, 1), "number", "cosine of an angle"),
    Function("tan", (1, 1), "number", "tangent of an angle"),
    Function("asin", (1, 1), "number", "angle with the given sine"),
    Function("acos", (1, 1), "number", "angle with the given cosine"),
    Function("atan", (1, 1), "number", "angle with the given tangent"),
    Function("atan2", (2, 2), "ratio", "angle of the point (second, first)"),
    Function("sinh", (1, 1), "number", "hyperbolic sine"),
    Function("cosh", (1, 1), "number", "hyperbolic cosine"),
    Function("tanh", (1, 1), "number", "hyperbolic tangent"),
    Function("exp", (1, 1), "number", "exponential"),
    Function("log", (1, 1), "number", "natural logarithm"),
    Function("sqrt", (1, 1), "root", "square root"),
    Function("abs", (1, 1), "same", "magnitude"),
    Function("sign", (1, 1), "sign", "-1, 0 or 1"),
    Function("min", (2, 16), "same", "the smallest"),
    Function("max", (2, 16), "same", "the largest"),
    Function("step", (1, 2), "ratio", "0, and 1 from zero on; smooth over a width"),
    Function("ramp", (1, 2), "same", "0, and the argument from zero on; smooth over a width"),
    Function("clip", (3, 4), "same", "no less than the second, no more than the third"),
    Function("piecewise", (4, 32), "pieces", "x, f0, x1, f1 …: f0 below x1, f1 from there on …"),
)
FUNCTIONS = {function.name: function for function in _TABLE}

# What formulas of indices may call, in braces: derive.model.composing.repetition makes numbers of
# them when the file is read.
INDEX_FUNCTIONS = {
    "mod": Function("mod", (2, 2), "number", "what is left of a division"),
    **{name: FUNCTIONS[name] for name in ("min", "max", "abs")},
}

# Where bodies and frames are and how they move. The arguments are names of bodies, frames and
# joints, points, directions and vectors; derive.model.kinematics says which, and makes numbers of
# them.
_KINEMATIC_TABLE = (
    Function("position", (1, 3), "vector", "where a point of a body or frame is"),
    Function("velocity", (1, 3), "vector", "velocity of a point of a body or frame"),
    Function("acceleration", (1, 3), "vector", "its rate, in outputs alone"),
    Function("direction", (2, 3), "vector", "a direction fixed in a body or frame"),
    Function("orientation", (1, 2), "matrix", "axes of a body or frame, as columns"),
    Function("angle", (1, 3), "scalar", "how far a body is turned, in space about an axis"),
    Function("angular_velocity", (1, 2), "vector", "angular velocity of a body or frame"),
    Function("angular_acceleration", (1, 2), "vector", "its rate, in outputs alone"),
    Function("distance", (2, 4), "scalar", "how far two points are apart"),
    Function("length", (1, 1), "scalar", "how long a path is"),
    Function("dot", (2, 2), "scalar", "scalar product of two vectors"),
    Function("cross", (2, 2), "vector", "vector product of two vectors, a number in the plane"),
    Function("norm", (1, 1), "scalar", "length of a vector"),
)
KINEMATIC_FUNCTIONS = {function.name: function for function in _KINEMATIC_TABLE}

# What an output may also say; the first argument is the name of a body, or of a closure or
# constraint.
_OUTPUT_TABLE = (
    Function("position", (1, 3), "output", "where a point of a body is, in the ground frame"),
    Function("velocity", (1, 3), "output", "velocity of a point of a body, in the ground frame"),
    Function("angle", (1, 3), "output", "how far a planar body is turned"),
    Function("reaction", (1, 1), "output", "multipliers of a closure or constraint"),
)
OUTPUT_FUNCTIONS = {function.name: function for function in _OUTPUT_TABLE}
