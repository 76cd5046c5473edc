"""Events of a model over the symbols of its mechanics."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca

from derive.mechanics.scene import Scene
from derive.model.rows import components


def events(
    scene: Scene, outputs: tuple[tuple[str, ca.SX, str], ...]
) -> tuple[tuple[str, ca.SX], ...]:
    """(name, value) of each; `outputs` are those of the model, which formulas may use."""
    names, letters = dict(scene.symbols.names), scene.model.plane or "xyz"
    for output, (name, value, _) in zip(scene.model.outputs, outputs):
        for k, part in enumerate(components(name, output.expression, letters)):
            names[part] = value[k]
    symbols = replace(scene.symbols, names=names)
    return tuple(
        (event.name, scene.over_v(ca.SX(symbols.scalar(event.expression))))
        for event in scene.model.events
    )
