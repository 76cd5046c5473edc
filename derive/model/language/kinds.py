"""Every joint, closure, constraint and load the language knows, a line each."""

from __future__ import annotations

from derive.joints import CLOSURES, JOINTS
from derive.model.language.shape import about, kinds


def _lines() -> tuple[tuple[str, str, str], ...]:
    """(category, name, about) in the order of the schema."""
    lines = [("joint", joint.name, joint.about) for joint in JOINTS]
    lines += [
        ("closure", joint.name, f"closes a loop: {joint.about}")
        for joint in JOINTS
        if joint.name in CLOSURES
    ]
    for section, category in (("constraints", "constraint"), ("loads", "load")):
        lines += [(category, name, about(entry)) for name, entry in kinds(section)]
    return tuple(lines)


KINDS = _lines()  # (category, name, about) of every joint, closure, constraint and load
