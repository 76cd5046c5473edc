"""The model file with identified parameters in it, as YAML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any

import numpy as np
import yaml

from derive.diagnostics import AssumptionError
from derive.mechanics.records import System
from derive.mechanics.regression.regressor import INERTIAL, Parameter, groups
from derive.model.builder import Model
from derive.model.loads.in_joint import IN_JOINT
from derive.robots.reading import ROBOTS, imported

Array = np.ndarray
WORDS = ("mass", "com", "inertia", "physical")


def identified(
    path: str | PathLike[str], system: System, standard: Sequence[Parameter], values: Array
) -> str:
    """The text of the model with those standard parameters. What is fixed to a body gives its mass
    to the body that carries it. Raises AssumptionError where a body stands for several, in another
    file."""
    entries: dict[str, Any] = yaml.load(_text(path, system), Loader=yaml.BaseLoader)
    numbers = {(x.owner, x.kind): float(v) for x, v in zip(standard, values)}
    for group in groups(system):
        ten = [numbers.get((group.body, kind), 0.0) for kind in INERTIAL]
        _put(system, entries, group.body, _body(ten, system.model.plane))
        for name in group.bodies:
            if name != group.body:
                _put(system, entries, name, {"mass": "0 kg"})
    for x, value in zip(standard, values):
        if x.kind not in INERTIAL:
            entry, key = _load(system, entries, x)
            entry[key] = f"{max(float(value), 0.0)!r} {x.unit}"
    return Model.from_dict(entries).yaml()


def _text(path: str | PathLike[str], system: System) -> str:
    robot = str(path).lower().endswith(tuple(ROBOTS))
    return imported(path).text if robot else system.model.text


def _put(system: System, entries: dict[str, Any], name: str, keys: Mapping[str, Any]) -> None:
    entry = _entry(system, entries, "bodies", name)
    for word in WORDS:
        entry.pop(word, None)
    entry.update(keys)


def _entry(system: System, entries: dict[str, Any], section: str, name: str) -> dict[str, Any]:
    held = entries.get(section)
    if isinstance(held, dict) and isinstance(held.get(name), dict):
        return held[name]
    raise AssumptionError(
        f"{system.model.name}: '{name}' does not stand under `{section}:` of the file itself, so "
        "it cannot be written back",
        "a file without `repeat:` and `use:`, or the values by --json",
    )


def _load(system: System, entries: dict[str, Any], x: Parameter) -> tuple[dict[str, Any], str]:
    """Where a coefficient stands, and under which key: in a load, or in the joint that the load is
    named after."""
    joint, _, kind = x.owner.rpartition("_")
    if x.owner in (entries.get("loads") or {}) or kind not in IN_JOINT:
        return _entry(system, entries, "loads", x.owner), x.kind
    entry = _entry(system, entries, "joints", joint)
    return (entry[kind], x.kind) if isinstance(entry.get(kind), dict) else (entry, kind)


def _body(ten: Sequence[float], plane: str) -> dict[str, Any]:
    """mass, com and inertia about it, from the ten."""
    mass = ten[0]
    com = np.array(ten[1:4]) / mass
    xx, xy, yy, xz, yz, zz = ten[4:]
    about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    I = about - mass * ((com @ com) * np.eye(3) - np.outer(com, com))
    if plane:
        axes = ["xyz".index(axis) for axis in plane]
        normal = next(k for k in range(3) if k not in axes)
        shown = f"{float(I[normal, normal])!r} kg*m^2"
        return {
            "mass": f"{mass!r} kg",
            "com": [f"{float(com[k])!r} m" for k in axes],
            "inertia": shown,
        }
    entries = (I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2])
    inertia = [f"{float(x)!r} kg*m^2" for x in entries]
    return {"mass": f"{mass!r} kg", "com": [f"{float(x)!r} m" for x in com], "inertia": inertia}
