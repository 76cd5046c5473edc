"""The text alternative of a figure: what is drawn, for those who cannot see it."""

from __future__ import annotations

from collections.abc import Sequence

from hamel.draw.mechanism.records import GROUND
from hamel.draw.mechanism.scene import Anchor, Scene
from hamel.draw.mechanism.state import Configuration

MOST = 12  # things of one kind that are listed


def described(scene: Scene, state: Configuration) -> str:
    """Bodies, joints, closures, constraints and inputs by name, and which state is drawn."""
    model = scene.model
    sentences = [f"Drawn {state.about}."]
    if scene.anchors:
        joints = [_joint(scene, anchor) for anchor in scene.anchors]
        sentences.append(f"Joints: {_listed(joints)}.")
    if model.constraints:
        sentences.append(f"Constraints: {_listed([x.name for x in model.constraints])}.")
    if model.loads:
        sentences.append(f"Loads: {_listed([x.name for x in model.loads])}.")
    if model.inputs:
        sentences.append(f"Inputs: {_listed([x.name for x in model.inputs])}.")
    return " ".join(sentences)


def _joint(scene: Scene, anchor: Anchor) -> str:
    first, second = (_body(scene, k) for k in anchor.bodies)
    own = f" ({', '.join(anchor.coordinates)})" if 0 < len(anchor.coordinates) <= 3 else ""
    return f"{anchor.name}, {anchor.type}, {first} to {second}{own}"


def _body(scene: Scene, index: int) -> str:
    return "ground" if index == GROUND else scene.names[index]


def _listed(items: Sequence[str]) -> str:
    if len(items) <= MOST:
        return "; ".join(items)
    return f"{'; '.join(items[:3])}; … {items[-1]}, {len(items)} in all"
