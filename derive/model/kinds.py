"""Every joint, closure, constraint and load the language knows, a line each."""

from __future__ import annotations

from derive.joints import CLOSURES, JOINTS
from derive.model.shape import about, kinds


def _lines() -> tuple[tuple[str, str, str], ...]:
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


KINDS = _lines()  # (category, name, about) of every joint, closure, constraint and load
