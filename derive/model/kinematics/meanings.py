"""What functions of the motion mean, in measures: position, orientation, angle, …"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from derive.diagnostics import did_you_mean, listed
from derive.expressions import tree
from derive.expressions.tree import Call, Expression, Name
from derive.model.kinematics.arguments import Arguments, Parts, Rewritten
from derive.model.kinematics.measures import Spot
from derive.model.mechanism.space import ORIGIN
from derive.model.quantities import minus, plus, times
from derive.model.records import GROUND

Meaning = Callable[[Arguments, Call], Rewritten]


def moving(of: Arguments, node: Call) -> Parts:
    """position, velocity or acceleration of a point, seen from a frame and along its axes."""
    of.check_function(node)
    arguments = list(node.arguments)
    spot = of.spot(arguments)
    return of.vector_of(node.function, spot, of.rest(node, arguments), node)


def orientation(of: Arguments, node: Call) -> Parts:
    """Only entries of a matrix are numbers."""
    raise of.fault("a matrix where a number is needed", node, "an entry, such as .xx")


def direction(of: Arguments, node: Call) -> Parts:
    """A direction fixed in a frame: R d."""
    frame, along, *others = node.arguments
    axis = dict(zip("xyz", of.axis(along)))
    spot, relative = Spot(of.frame(frame), ORIGIN), of.rest(node, others)
    letters = of.space.letters
    return tuple(
        plus(
            *(
                times(
                    tree.Number(axis[column]),
                    of.measure("orientation", spot, relative, row + column, node),
                )
                for column in letters
                if axis[column]
            )
        )
        for row in letters
    )


def angle(of: Arguments, node: Call) -> Expression:
    """In a plane the angle against a frame; in space that about an axis of the frame: the twist
    of R into a turn about the axis and one across it, tan θ = e·[R]ˣ/(tr R − e·R e)."""
    frame, *others = node.arguments
    spot = Spot(of.frame(frame), ORIGIN)
    if of.space.plane:
        return of.measure("angle", spot, of.rest(node, others), "", node)
    if not others:
        raise of.fault("angle() of a body in space without an axis", node, "angle(body, z) or such")
    axis, relative = of.axis(others[0]), of.rest(node, others[1:])

    def entry(i: int, j: int) -> Expression:
        """R_ij of the frame."""
        return of.measure("orientation", spot, relative, "xyz"[i] + "xyz"[j], node)

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


def turning(of: Arguments, node: Call) -> Rewritten:
    """ω against a frame and along its axes, or the rate of that; a number about the normal in a
    plane."""
    of.check_function(node)
    frame, *others = node.arguments
    spot, relative = Spot(of.frame(frame), ORIGIN), of.rest(node, others)
    if of.space.plane:
        return of.measure(node.function, spot, relative, "", node)
    return of.vector_of(node.function, spot, relative, node)


def length(of: Arguments, node: Call) -> Expression:
    """Of a path."""
    (path,), known = node.arguments, of.measures.paths
    name = path.name if isinstance(path, Name) else ""
    if name not in known:
        said = f"unknown path '{name}'" if name else "this is no path"
        hint = did_you_mean(name, known) if name else ""
        raise of.fault(said, path, listed(known) or "a path of `paths:`", hint)
    return of.measure("length", Spot(name, ORIGIN), GROUND, "", node)


def orientation_entry(of: Arguments, node: Call, row: str, column: str) -> Expression:
    frame, *others = node.arguments
    spot = Spot(of.frame(frame), ORIGIN)
    return of.measure("orientation", spot, of.rest(node, others), row + column, node)


MEANINGS: Mapping[str, Meaning] = {
    "position": moving,
    "velocity": moving,
    "acceleration": moving,
    "direction": direction,
    "orientation": orientation,
    "angle": angle,
    "angular_velocity": turning,
    "angular_acceleration": turning,
    "length": length,
}
