"""Inertias of MJCF meshes: those of MuJoCo 4.0, whatever the file, its place and its scale.

Of derive.robots.mjcf: meshes.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from derive.diagnostics import ModelError
from derive.robots import RobotFile
from derive.robots.reading import imported

# an L, 0.5 thick: not convex
OUTLINE = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 3], [0, 3]], dtype=float)
CORNERS = np.vstack([np.c_[OUTLINE, np.zeros(6)], np.c_[OUTLINE, np.full(6, 0.5)]])
FLAT = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
SIDES = [(i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6) for i in range(6)]
FACES = [
    *((a, c, b) for a, b, c in FLAT),
    *((a + 6, b + 6, c + 6) for a, b, c in FLAT),
    *((a, b, c) for a, b, c, _ in SIDES),
    *((a, c, d) for a, _, c, d in SIDES),
]
# mass at density 1, centre of mass, principal moments: printed by MuJoCo 4.0.0
MEASURES = {
    "legacy": (2.0807181060248543, (0.77436291, 1.24215432, 0.25), (0.48176249, 1.7206094, 2.11702061)),
    "exact": (2.0, (0.75, 1.25, 0.25), (0.45833333, 1.70833333, 2.08333333)),
    "shell": (13.0, (0.76923077, 1.26923077, 0.25), (4.33804751, 13.23567044, 16.36538462)),
}  # fmt: skip


def body(folder: Path, mesh: str, geom: str = 'density="1"', compiler: str = "") -> tuple:
    """Mass, centre of mass and inertia (3 × 3) of a body that is one mesh."""
    file = folder / "m.xml"
    file.write_text(
        f'<mujoco><compiler {compiler}/><asset><mesh name="m" {mesh}/></asset><worldbody><body>'
        f'<freejoint/><geom type="mesh" mesh="m" {geom}/></body></worldbody></mujoco>'
    )
    model = imported(RobotFile(file, unphysical=True)).model
    found = model.bodies[0]
    xx, yy, zz, xy, xz, yz = (x.value for x in found.inertia)
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return found.mass.value, np.array([x.value for x in found.com]), tensor


def inline(more: str = "") -> str:
    corners, faces = " ".join(map(str, CORNERS.ravel())), " ".join(str(i) for f in FACES for i in f)
    return f'vertex="{corners}" face="{faces}" {more}'


def stl() -> bytes:
    facets = (
        struct.pack("<12fH", 0, 0, 0, *CORNERS[list(face)].ravel().tolist(), 0) for face in FACES
    )
    return bytes(80) + struct.pack("<I", len(FACES)) + b"".join(facets)


def stl_text() -> bytes:
    facets = (
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x} {y} {z}\n" for x, y, z in CORNERS[list(face)])
        + "endloop\nendfacet\n"
        for face in FACES
    )
    return f"solid m\n{''.join(facets)}endsolid m\n".encode()


def obj() -> bytes:
    """With quadrilaterals, and with some indices counted back."""
    corners = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)
    flat = "".join(f"f {a + 1}/1 {b + 1}/2 {c + 1}/3\n" for a, b, c in FACES[:8])
    sides = "".join("f " + " ".join(f"{i - 12}//1" for i in side) + "\n" for side in SIDES)
    other = "o other\nv 9 9 9\nf 1 2 13\n"  # MuJoCo takes the first alone
    return f"# an L\no first\n{corners}vn 0 0 1\n{flat}{sides}{other}".encode()


def msh() -> bytes:
    faces = np.array(FACES, dtype="<i4").tobytes()
    head = struct.pack("<4i", len(CORNERS), 0, 0, len(FACES))
    return head + CORNERS.astype("<f4").tobytes() + faces


@pytest.mark.parametrize("measure", [*MEASURES, ""])
def test_measures_are_those_of_mujoco(measure: str, tmp_path: Path) -> None:
    mass, com, tensor = body(tmp_path, inline(f'inertia="{measure}"' if measure else ""))
    wanted = MEASURES[measure or "legacy"]
    assert abs(mass - wanted[0]) < 1e-12
    assert np.abs(com - wanted[1]).max() < 1e-8
    assert np.abs(np.linalg.eigvalsh(tensor) - wanted[2]).max() < 1e-8


@pytest.mark.parametrize(
    ("name", "data"),
    [("m.stl", stl()), ("m.STL", stl_text()), ("m.obj", obj()), ("m.msh", msh())],
    ids=["stl", "text", "obj", "msh"],
)
def test_files_hold_the_same(name: str, data: bytes, tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / name).write_bytes(data)
    found = body(tmp_path, f'file="{name}" inertia="exact"', compiler='meshdir="parts"')
    wanted = body(tmp_path, inline('inertia="exact"'))
    for one, other in zip(found, wanted):
        assert np.abs(np.subtract(one, other)).max() < 1e-12


def test_places_scales_and_given_masses(tmp_path: Path) -> None:
    """By hand: a mirror image three times as thick, turned about z, of 6 kg."""
    mesh = inline('inertia="exact" scale="-1 1 3" refpos="1 0 0"')
    mass, com, tensor = body(tmp_path, mesh, 'mass="6" pos="1 2 3" euler="0 0 90"')
    assert abs(mass - 6) < 1e-12
    # the centre (0.75, 1.25, 0.25) becomes (0.25, 1.25, 0.75), and (−1.25, 0.25, 0.75) when turned
    assert np.abs(com - [1 - 1.25, 2 + 0.25, 3 + 0.75]).max() < 1e-12
    moment = 3.0 * (MEASURES["exact"][2][2])  # about z: of 2 kg, now of 6
    assert abs(tensor[2, 2] - moment) < 1e-7


@pytest.mark.parametrize(
    ("mesh", "said"),
    [
        ('file="gone.stl"', "the mesh file 'gone.stl' is not there"),
        ('file="m.dae"', "of a kind that is not read"),
        ('file="bad.stl"', "cannot be read as triangles"),
        ('file="bad.obj"', "cannot be read as triangles"),
        ('file="bad.msh"', "cannot be read as triangles"),
        ('file="../m.stl"', "is outside the model's folder"),
        ("", "a mesh of no file"),
        (inline('inertia="convex"'), "the inertia 'convex' of a mesh"),
        ('vertex="0 0 0 1 0 0 0 1 0 0 0 1"', "a mesh without faces needs its convex hull"),
        ('vertex="0 0 0 1 0 0 0 1 0" face="0 1 9"', "a face of a vertex that is not there"),
        ('vertex="0 0 0 1 0 0 0 1 0" face="0 1 2" inertia="exact"', "encloses nothing"),
        (inline('scale="1 1 -1" inertia="exact"').replace("-1", "nan"), "'nan' in 'scale'"),
    ],
)
def test_what_is_no_solid_is_refused(mesh: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "m.stl").write_bytes(stl())
    (tmp_path / "robot").mkdir()
    for name in ("bad.stl", "bad.obj", "bad.msh"):
        (tmp_path / "robot" / name).write_bytes(b"f 1 2 x\n" + bytes(7))
    with pytest.raises(ModelError, match=said) as error:
        body(tmp_path / "robot", mesh)
    assert "m.xml:1:" in str(error.value)
