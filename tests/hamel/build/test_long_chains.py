"""Chains too long for anything that grows faster than they do."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

import hamel

LINKS = 300


def oblique(n: int) -> str:
    """A URDF chain of revolute links, their axes, places and inertias drawn."""
    draw = random.Random(7)

    def numbers(size: float) -> str:
        return " ".join(f"{draw.uniform(-size, size):.4f}" for _ in range(3))

    parts, parent = [f'<robot name="chain{n}"><link name="base"/>'], "base"
    for i in range(n):
        ixx, iyy, izz = (draw.uniform(0.01, 0.02) for _ in range(3))
        inertia = f'ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0.001" ixz="-0.0005" iyz="0.0002"'
        axis = draw.choice(["1 0 0", "0 1 0", "0 0 1"])
        parts.append(
            f'<link name="l{i}"><inertial><origin xyz="{numbers(0.1)}"/>'
            f'<mass value="{draw.uniform(0.5, 2)}"/><inertia {inertia}/></inertial></link>'
            f'<joint name="j{i}" type="continuous"><parent link="{parent}"/><child link="l{i}"/>'
            f'<origin xyz="{numbers(0.2)}" rpy="{draw.uniform(-1, 1)} 0 0"/><axis xyz="{axis}"/>'
            "</joint>"
        )
        parent = f"l{i}"
    return "".join(parts) + "</robot>"


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
def test_three_hundred_oblique_links_are_built_verified_and_cost_so_much_a_link(
    tmp_path: Path,
) -> None:
    """No warning of NumPy; operations in proportion to the links."""
    file = tmp_path / "chain.urdf"
    file.write_text(oblique(LINKS))
    made = hamel.build(file, out=tmp_path / "chain")
    assert made.verified and made.compiled
    assert made.operations["dynamics"] < 500 * LINKS
