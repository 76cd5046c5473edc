"""Outputs of a model: formulas, points, velocities and angles of bodies, and reactions."""

from __future__ import annotations

import casadi as ca

from derive.expressions.scalars import Scalar
from derive.expressions.scalars import Vector as Numbers
from derive.expressions.tree import Call, Name, Vector
from derive.joints.records import Rotation, Turn
from derive.joints.rotations import dot, matrix, merged
from derive.mechanics.records import Place
from derive.mechanics.recursions.tree import ground_point, relative_rotation
from derive.mechanics.scene import IN_PLANE, NORMAL, Scene
from derive.model.records import Output
from derive.model.rows import row_names

BODY_FUNCTIONS = ("position", "velocity", "angle")


def outputs(scene: Scene) -> tuple[tuple[str, ca.SX, str], ...]:
    """(name, value, unit) of each output over (t, q, v, u, p), reactions and v̇; vectors have as
    many components as the model has dimensions, points in ground axes."""
    return tuple(
        (output.name, _output(scene, output), output.unit) for output in scene.model.outputs
    )


def _output(scene: Scene, output: Output) -> ca.SX:
    formula = output.expression
    if isinstance(formula, Call) and formula.function in BODY_FUNCTIONS:
        return _of_body(scene, formula)
    if isinstance(formula, Call) and formula.function == "reaction":
        return _reactions(scene, formula)
    if isinstance(formula, Vector):
        return scene.over_v(ca.vertcat(*map(ca.SX, scene.symbols.vector(formula.entries))))
    return scene.over_v(ca.SX(scene.symbols.scalar(formula)))


def _reactions(scene: Scene, call: Call) -> ca.SX:
    """The symbols of a closure's or constraint's multipliers; whoever knows λ puts it in their
    place."""
    subject = call.arguments[0]
    assert isinstance(subject, Name)  # the loader saw to it
    rows = [row for row in row_names(scene.model) if row.partition(".")[0] == subject.name]
    return ca.vertcat(*[ca.SX(scene.symbols.names[f"reaction.{row}"]) for row in rows])


def _of_body(scene: Scene, call: Call) -> ca.SX:
    body = call.arguments[0]
    assert isinstance(body, Name)  # the loader saw to it
    if call.function == "angle":
        return planar_angle(scene, scene.places[body.name])
    point = _point(scene, call)
    ground = ground_point(scene.places[body.name], point, scene.positions, scene.rotations)
    position = ca.vertcat(*[ground[k] for k in IN_PLANE[scene.model.plane]])
    return position if call.function == "position" else scene.rate(position)


def _point(scene: Scene, call: Call) -> Numbers:
    """The body point of a call, embedded in space by the loader; the body's origin when none is
    given."""
    if len(call.arguments) < 2:
        return [0.0, 0.0, 0.0]
    entries = call.arguments[1]
    assert isinstance(entries, Vector)
    return scene.symbols.vector(entries.entries)


def planar_angle(scene: Scene, place: Place, carrier: int = -1) -> ca.SX:
    """The angle of a planar body or frame against a link that carries it, or the ground,
    counter-clockwise from the plane's first to its second axis: all turns of the joints between,
    with what placements turn for good."""
    chain = merged(relative_rotation(scene.links, carrier, place.link), place.rotation)
    normal, turned = NORMAL[scene.model.plane], ca.SX(0)
    still: Rotation = ()  # placements in a row: only together they are turns in the plane
    for factor in chain:
        if isinstance(factor, Turn):
            turned = turned + dot(normal, list(factor.axis)) * factor.angle
            turned, still = turned + _still_angle(scene, still), ()
        else:
            still = (*still, factor)
    return turned + _still_angle(scene, still)


def _still_angle(scene: Scene, still: Rotation) -> Scalar:
    if not still:
        return 0.0
    i, j = IN_PLANE[scene.model.plane][:2]
    R = matrix(still)
    return ca.atan2(R[j][i], R[i][i])
