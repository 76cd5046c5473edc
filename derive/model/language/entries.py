"""The shape of a model file as pydantic classes: which keys there are and what kind of thing each
holds, what it is called in the equations, and its unit.

The same classes give the JSON Schema that editors complete from, and the language reference.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, Tag

from derive.model.language.keys import (
    Constant,
    ConstantOrList,
    Constants,
    Direction,
    Entry,
    Formula,
    Formulas,
    Moments,
    Named,
    NameList,
    Nested,
    Text,
    TextOrList,
    Unit,
    Units,
    Word,
    is_list,
    is_mapping,
    is_pair,
    is_scalar,
    term,
    told_by,
)
from derive.model.language.place_entries import JointPlace, Sides, TurnedEntry


class ParameterEntry(Entry):
    value: Constant = Field(
        description="Number with its unit, such as 0.2 m.",
        json_schema_extra=term("entry of p at its default"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )
    symbol: Text | None = Field(
        None,
        description="How its name is typeset, such as \\delta_{1}.",
        json_schema_extra=term("its letter in the derivation"),
    )


class TableEntry(Entry):
    """A function of one number by points, joined by a cubic spline."""

    file: Text | None = Field(
        None,
        description="A CSV file of two columns, in the folder of the model or below.",
        json_schema_extra=term("the points"),
    )
    points: Nested | None = Field(
        None, description="Or the points: [[x, y], …].", json_schema_extra=term("the points")
    )
    units: Units | None = Field(
        None,
        description="Units of x and y.",
        json_schema_extra=term("factors to SI of both columns", otherwise="plain numbers"),
    )
    smooth: Word | None = Field(
        None,
        description="C2, the natural spline, or C1, which keeps rising what rises.",
        json_schema_extra=term(
            "the cubics between points: natural spline, or Fritsch and Butland", otherwise="C2"
        ),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


class CoordinateEntry(Entry):
    unit: Unit = Field(
        description="Unit of the coordinate, such as m or rad.",
        json_schema_extra=term("unit of an entry of q; its rate is the entry of v"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )
    symbol: Text | None = Field(
        None,
        description="How its name is typeset, such as \\delta_{1}.",
        json_schema_extra=term("its letter in the derivation"),
    )


class InertiaEntry(Entry):
    """An inertia tensor with the point and the frame it refers to."""

    tensor: Moments = Field(
        description="One, three (xx, yy, zz) or six (xx, yy, zz, xy, xz, yz) entries, or the "
        "matrix.",
        json_schema_extra=term("J in T = ½ ω·J ω", "kg*m^2"),
    )
    about: Word | None = Field(
        None,
        description="com or origin: the point the tensor is about.",
        json_schema_extra=term(
            "J about the origin loses the part m(r·r E − r rᵀ) of the centre", otherwise="com"
        ),
    )
    frame: TurnedEntry | None = Field(
        None,
        description="How the tensor's axes are turned in the body.",
        json_schema_extra=term("R in R J Rᵀ"),
    )


Inertia = Annotated[
    Annotated[Constant, Tag("<a formula>")]
    | Annotated[Constants, Tag("<a list>")]
    | Annotated[Nested, Tag("<a matrix>")]
    | Annotated[InertiaEntry, Tag("<a mapping>")],
    told_by(
        **{
            "a formula": is_scalar,
            "a matrix": is_pair,
            "a list": is_list,
            "a mapping": is_mapping,
        }
    ),
]


class ExhaustEntry(Entry):
    """What leaves a body whose mass depends on t: a rocket's gas, sand, water."""

    velocity: Formulas = Field(
        description="Relative to the body, in its frame; formulas of t, parameters and inputs. "
        "Zeros for matter that is let go.",
        json_schema_extra=term("u in the thrust ṁ u", "m/s"),
    )
    at: Constants | None = Field(
        None,
        description="Where it leaves, in the body's frame.",
        json_schema_extra=term("the point that ṁ u acts on", "m", "the centre of mass"),
    )


class BodyEntry(Entry):
    """A rigid body."""

    mass: Formula = Field(
        description="Mass; 0 for a body without mass. With `exhaust:` a formula of t, too.",
        json_schema_extra=term("m in T = ½ m ṙ·ṙ and V = −m g·r", "kg"),
    )
    com: Constants | None = Field(
        None,
        description="Centre of mass in the body's frame.",
        json_schema_extra=term("r of the centre of mass", "m", "its origin"),
    )
    first_moment: Constants | None = Field(
        None,
        description="Mass times centre of mass, in the place of `com`: with `inertia: {tensor: …, "
        "about: origin}` the form in which equations are linear.",
        json_schema_extra=term("m r of the centre of mass", "kg*m", "mass times `com`"),
    )
    inertia: Inertia | None = Field(
        None,
        description="About the centre of mass: one moment in a planar model; in space one (a "
        "sphere), three (xx, yy, zz) or six (xx, yy, zz, xy, xz, yz, tensor entries), or the "
        "matrix in three rows; or a mapping that says which point and frame it refers to.",
        json_schema_extra=term("J in T = ½ ω·J ω", "kg*m^2", "0, a point mass"),
    )
    exhaust: ExhaustEntry | None = Field(
        None,
        description="What leaves the body where its mass, and its inertia, depend on t.",
        json_schema_extra=term("a force ṁ u"),
    )
    physical: Word | None = Field(
        None,
        description="false: the inertia is taken as it is, though no body can have it "
        "(identified sets).",
        json_schema_extra=term("nothing; waives the test that such a J can be", otherwise="true"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )
    symbol: Text | None = Field(
        None,
        description="How its name is typeset, such as \\delta_{1}.",
        json_schema_extra=term("index of its terms in the derivation"),
    )


class OrientationEntry(Entry):
    """Euler angles or a quaternion."""

    euler: Word | None = Field(
        None,
        description="Intrinsic sequence of axes, such as zxy.",
        json_schema_extra=term("R = product of three turns; q has their angles"),
    )
    angles: NameList | None = Field(
        None,
        description="Names of the three angles.",
        json_schema_extra=term("entries of q", "rad"),
    )
    quaternion: NameList | None = Field(
        None,
        description="Names of the four entries w, x, y, z.",
        json_schema_extra=term("entries of q, with |q| = 1", "1"),
    )


Orientation = Annotated[
    Annotated[Word, Tag("<quaternion>")] | Annotated[OrientationEntry, Tag("<a mapping>")],
    told_by(**{"quaternion": is_scalar, "a mapping": is_mapping}),
]


class JointSpringEntry(Entry):
    """A spring in the joint: -stiffness (q - rest)."""

    stiffness: ConstantOrList = Field(
        description="Stiffness; of a ball joint one number, or one for each axis.",
        json_schema_extra=term("k in V = ½ k (q − q₀)²", "N/m | N*m/rad"),
    )
    rest: Constant | None = Field(
        None,
        description="Where it is slack.",
        json_schema_extra=term("q₀ in V = ½ k (q − q₀)²", "m | rad", "0"),
    )


class LawOfFriction(Entry):
    """-viscous v - coulomb tanh(v/smoothing)."""

    viscous: Formula | None = Field(
        None,
        description="Force or torque per velocity.",
        json_schema_extra=term("d in Q = −d v", "N*s/m | N*m*s/rad"),
    )
    coulomb: Formula | None = Field(
        None,
        description="Force or torque of dry friction.",
        json_schema_extra=term("C in Q = −C tanh(v/s)", "N | N*m"),
    )
    smoothing: Constant | None = Field(
        None,
        description="Velocity at which dry friction is three quarters there.",
        json_schema_extra=term("s in Q = −C tanh(v/s)", "m/s | rad/s"),
    )


class JointEntry(TurnedEntry):
    """A joint of the tree: it says where the child is in the parent."""

    type: Word = Field(
        description="Kind of joint.",
        json_schema_extra=term("columns of N and of the twists: which q and v there are"),
    )
    parent: Named = Field(
        description="A body, or ground.",
        json_schema_extra=term("the twist that the joint's is added to"),
    )
    child: Named = Field(
        description="A body; each is the child of one joint.",
        json_schema_extra=term("the twist that comes out"),
    )
    symbol: TextOrList | None = Field(
        None,
        description="How the name of its coordinate is typeset, such as \\delta_{1}; a list, such "
        "as [x, y, \\psi], names the first ones of several.",
        json_schema_extra=term("letter of q in the derivation"),
    )
    at: JointPlace | None = Field(
        None,
        description="Where the joint is: a point of the parent, one of the parent and one of "
        "the child, or a mapping with parent "
        "and child. Keys beside it turn the joint's frame in the parent.",
        json_schema_extra=term("r and R of the joint's frame in both bodies", "m"),
    )
    axis: Direction | None = Field(
        None,
        description="Direction in the joint's frame: x, y, z or a list of numbers.",
        json_schema_extra=term("e in the twist (e q̇, 0) or (0, e q̇)", "1"),
    )
    axis2: Direction | None = Field(
        None,
        description="Universal joint: the second axis, at right angles to the first, fixed in "
        "the child.",
        json_schema_extra=term(
            "the second e of a universal joint",
            "1",
            "y after x, z after y, x after z: by the largest component of `axis`, square to it",
        ),
    )
    pitch: Constant | None = Field(
        None,
        description="Screw: advance along the axis per turn, such as 5 mm.",
        json_schema_extra=term("h in the shift h q/(2π)", "m"),
    )
    coordinate: Named | None = Field(
        None,
        description="Name of the joint's one coordinate.",
        json_schema_extra=term("name of the entry of q", otherwise="the joint's own name"),
    )
    coordinates: NameList | None = Field(
        None,
        description="Names of the joint's coordinates; of a free joint the first three will do.",
        json_schema_extra=term("names of the entries of q"),
    )
    position: NameList | None = Field(
        None,
        description="Free joint: names of the three position coordinates.",
        json_schema_extra=term("names of three entries of q", "m"),
    )
    orientation: Orientation | None = Field(
        None,
        description="Free or ball joint: quaternion, or a mapping with an Euler sequence and names "
        "of the angles.",
        json_schema_extra=term(
            "names and kind of the entries of q that turn", otherwise="quaternion"
        ),
    )
    limits: Constants | None = Field(
        None,
        description="Lowest and highest value of the coordinate, for readers; no force.",
        json_schema_extra=term("nothing; for readers and controllers", "m | rad"),
    )
    spring: JointSpringEntry | None = Field(
        None, description="A spring in the joint.", json_schema_extra=term("V = ½ k (q − q₀)²")
    )
    damper: Formula | None = Field(
        None,
        description="Force or torque per velocity of a damper in the joint.",
        json_schema_extra=term("d in Q = −d v", "N*s/m | N*m*s/rad"),
    )
    friction: LawOfFriction | None = Field(
        None, description="Friction in the joint.", json_schema_extra=term("Q = −d v − C tanh(v/s)")
    )
    armature: Constant | None = Field(
        None,
        description="Inertia of what turns with the joint's motor, as the joint feels it.",
        json_schema_extra=term("J in T = ½ J v²", "kg | kg*m^2"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


class ClosureEntry(TurnedEntry):
    """A joint that closes a loop."""

    type: Word = Field(
        description="Kind of joint.", json_schema_extra=term("which rows φ = 0 there are")
    )
    between: NameList = Field(
        description="The two bodies.", json_schema_extra=term("the two frames in φ")
    )
    at: Sides = Field(
        description="Where the joint is in each of the two. Keys beside it turn its frame in "
        "the first body.",
        json_schema_extra=term("r and R of the frames in φ", "m"),
    )
    axis: Direction | None = Field(
        None, description="Direction in the joint's frame.", json_schema_extra=term("e in φ", "1")
    )
    axis2: Direction | None = Field(
        None,
        description="Universal joint: the second axis, at right angles to the first, fixed in "
        "the second body.",
        json_schema_extra=term(
            "the second e of a universal joint",
            "1",
            "y after x, z after y, x after z: by the largest component of `axis`, square to it",
        ),
    )
    pitch: Constant | None = Field(
        None,
        description="Screw: advance along the axis per turn, such as 5 mm.",
        json_schema_extra=term("h in the row of a screw", "m"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


class InputEntry(Entry):
    """An actuator at a joint, a coordinate or a generalized velocity; with none of these a name for
    formulas."""

    joint: Named | None = Field(
        None,
        description="A joint with one coordinate.",
        json_schema_extra=term("the v that Q = gear·u belongs to"),
    )
    coordinate: Named | None = Field(
        None,
        description="A coordinate.",
        json_schema_extra=term("the v that Q = gear·u belongs to"),
    )
    velocity: Named | None = Field(
        None,
        description="A generalized velocity, such as base.vx.",
        json_schema_extra=term("the v that Q = gear·u belongs to"),
    )
    gear: Constant | None = Field(
        None,
        description="Force or torque at the joint per input.",
        json_schema_extra=term("n in Q = n u", otherwise="1"),
    )
    rotor_inertia: Constant | None = Field(
        None,
        description="Of the actuator's rotor, which turns `gear` times as fast.",
        json_schema_extra=term("J in T = ½ J n² v²"),
    )
    unit: Unit | None = Field(
        None, description="Unit of the input.", json_schema_extra=term("unit of the entry of u")
    )
    table: Named | None = Field(
        None,
        description="A table over time (s) that the input follows.",
        json_schema_extra=term("table(t) in the place of u, of which it is no entry then"),
    )
    delay: Constant | None = Field(
        None,
        description="How much later it arrives. What arrives drives the joint, and formulas call "
        "it NAME_late.",
        json_schema_extra=term("T: NAME_late is u after Padé's approximation of e^(−sT)", "s"),
    )
    delay_order: Constant | None = Field(
        None,
        description="Order of the approximation, which has as many states; 1 to 10.",
        json_schema_extra=term("number of states in z", otherwise="2"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


class StateEntry(Entry):
    """A number with a first-order equation of its own: a current, a pressure, an activation."""

    rate: Formula = Field(
        description="Its rate: a formula of t, coordinates, velocities, inputs and states.",
        json_schema_extra=term("r in ż = r"),
    )
    initial: Constant | None = Field(
        None,
        description="Its value at t = 0.",
        json_schema_extra=term("z at t = 0", otherwise="0"),
    )
    unit: Unit | None = Field(
        None,
        description="Its unit.",
        json_schema_extra=term("unit of the entry of z", otherwise="that of `initial`"),
    )
    energy: Formula | None = Field(
        None,
        description="Energy that it stores, of states and parameters.",
        json_schema_extra=term("a part of V", "J"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


Parameter = Annotated[
    Annotated[Constant, Tag("<a number>")] | Annotated[ParameterEntry, Tag("<a mapping>")],
    told_by(**{"a number": is_scalar, "a mapping": is_mapping}),
]
Coordinate = Annotated[
    Annotated[Unit, Tag("<a unit>")] | Annotated[CoordinateEntry, Tag("<a mapping>")],
    told_by(**{"a unit": is_scalar, "a mapping": is_mapping}),
]


class PulleyEntry(Entry):
    """A round body that a path goes round: a pulley, a sheave, a cylinder, a bone."""

    radius: Constant = Field(
        description="Radius, to the middle of the rope.",
        json_schema_extra=term("R of the arc R θ", "m"),
    )
    side: Word = Field(
        description="left or right: on which side of the path it lies; seen against the axis.",
        json_schema_extra=term("sign of θ"),
    )
    axis: Direction | None = Field(
        None,
        description="Its axis in the body's frame.",
        json_schema_extra=term("normal of the plane of the arc", "1", "normal of a planar model"),
    )
    turns: Constant | None = Field(
        None,
        description="Whole turns besides.",
        json_schema_extra=term("n in the arc R (θ + 2π n)", "1", "0"),
    )


class WaypointEntry(Entry):
    """A point that a path goes through, or a pulley that it goes round."""

    body: Named = Field(
        description="The body, or ground.", json_schema_extra=term("the frame of the point")
    )
    at: Constants | None = Field(
        None,
        description="The point, or the pulley's centre, in the body's frame.",
        json_schema_extra=term("r of the point; ℓ = Σ |rᵢ₊₁ − rᵢ| + arcs", "m", "its origin"),
    )
    pulley: PulleyEntry | None = Field(
        None, description="What it goes round there.", json_schema_extra=term("an arc of ℓ")
    )
