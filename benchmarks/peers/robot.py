"""Robots as one file that everybody reads: without geometry, without friction, and with fingers
held still."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from peers.contest import BUILD

ROBOTS = {
    "panda": "panda_description/urdf/panda.urdf",
    "ur5": "ur_description/urdf/ur5_robot.urdf",
    "humanoid": "simple_humanoid_description/urdf/simple_humanoid.urdf",
}


def robot(name: str, root: Path) -> Path:
    """The file of a robot of example-robot-data below build/bench."""
    tree = ElementTree.parse(root / ROBOTS[name])
    top = tree.getroot()
    top.set("name", name)
    for child in [child for child in top if child.tag not in ("link", "joint")]:
        top.remove(child)
    for part in list(top):
        for child in [
            child
            for child in part
            if child.tag in ("visual", "collision", "dynamics", "safety_controller")
        ]:
            part.remove(child)
        if "finger" in part.get("name", "") and part.tag == "joint":
            part.set("type", "fixed")
            for mimic in part.findall("mimic"):
                part.remove(mimic)
    path = BUILD / "models" / f"{name}.urdf"
    path.parent.mkdir(parents=True, exist_ok=True)
    tree.write(path)
    return path
