"""Every joint, closure, constraint and load the language knows, a line each."""

from __future__ import annotations

from derive.joints import JOINTS
from derive.model.shape import about, kinds

CLOSURES = tuple(joint.name for joint in JOINTS if joint.name != "free")
PLANAR_CLOSURES = ("revolute", "prismatic", "fixed")


def known() -> tuple[tuple[str, str, str], ...]:
    """(category, name, about) in the order of the schema."""
    found = [("joint", joint.name, joint.about) for joint in JOINTS]
    found += [
        ("closure", joint.name, f"closes a loop: {joint.about}")
        for joint in JOINTS
        if joint.name in CLOSURES
    ]
    for section, category in (("constraints", "constraint"), ("loads", "load")):
        found += [(category, name, about(entry)) for name, entry in kinds(section)]
    return tuple(found)
