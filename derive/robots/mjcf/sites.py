"""Sites of an MJCF file with a name: frames of the model."""

from __future__ import annotations

from derive.robots.mjcf.bodies import Scene
from derive.robots.naming import Names, is_ambiguous
from derive.robots.robot import Entry, Reading, quoted
from derive.robots.writing import frame_text


def sites(reading: Reading, scene: Scene) -> None:
    """Each by its own name, unless a body or joint has it or functions of it would not be clear."""
    robot = scene.robot
    names, taken = Names(), {body.name for body in robot.bodies}
    taken |= {joint.name for joint in robot.joints}
    for original, (body, place) in scene.sites.items():
        if not original:
            continue
        name = names(original, "frame")
        if name in taken or is_ambiguous(name):
            name = names(f"site_{name}", "frame")
        if name in taken:
            continue
        note = f"was {quoted(original)}" if name != original else ""
        reading.renamed += bool(note)
        element = scene.site_elements[original]
        robot.frames.append(Entry(name, frame_text(body, place.at, place.turn), element, note))
