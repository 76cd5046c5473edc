"""Dampers at joints."""

from __future__ import annotations

from derive.mechanics.loads.records import Applied, Law, along, force_alone, rate_of
from derive.mechanics.scene import Scene
from derive.model.load_records import JointDamper


def joint_damper(scene: Scene, load: JointDamper) -> Applied:
    """−d times the rate, conjugate to that rate: its power is −d times the rate squared."""
    return force_alone(
        scene,
        along(
            scene,
            load.velocity,
            -scene.symbols.scalar(load.coefficient) * rate_of(scene, load.velocity),
        ),
    )


JOINT_DAMPER = Law(JointDamper, joint_damper)
