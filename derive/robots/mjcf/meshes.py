"""Solids of MJCF meshes: triangles of STL, OBJ and MSH files, what they enclose, and its inertia.

A face with the corners a, b, c and a point o make a tetrahedron. With a, b, c from o,

    V = a · (b × c)/6,   ∫ x xᵀ dV = V/20 (a aᵀ + b bᵀ + c cᵀ + s sᵀ),   s = a + b + c,

and those of all faces add up (Tonon 2004; Eberly 2003). MuJoCo has four measures: `exact` takes
them with their sign; `legacy`, its default, without, from the centre of the faces and then from the
centre of what that gives, so that what is not convex counts too much; `shell` has its mass on the
faces; `convex`, that of the hull, is not read.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from derive.diagnostics import ModelError, did_you_mean, listed
from derive.model.document import content
from derive.robots.markup import LARGEST, Element
from derive.robots.mjcf.settings import Settings, completed, orientation
from derive.robots.numbers import listing, vector
from derive.robots.robot import Reading
from derive.robots.rotations import Vector

Array = NDArray[np.float64]
HINT = "give the body an <inertial>, or the geom mass=0 where others carry it"
MOST_FACES = 2_000_000
_FACET = np.dtype([("normal", "<3f4"), ("corners", "<(3,3)f4"), ("more", "<u2")])
_HEAD = 84  # bytes before the first facet of a binary STL
_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)")


@dataclass(frozen=True)
class Solid:
    """Volume, or the area of a shell, its centre, and the inertia (xx, yy, zz, xy, xz, yz) about
    that at density one."""

    volume: float
    centre: Vector
    tensor: tuple[float, ...]


def solid_of(reading: Reading, geom: Element, found: Settings) -> Solid | None:
    """What the mesh of a geom encloses, in the axes of its file; None after reporting."""
    name = geom.get("mesh")
    if name not in found.meshes:
        known = list(found.meshes)
        near = did_you_mean(name, known) if known else ""
        reading.report(geom, f"unknown mesh '{name}'", listed(known), near or HINT, "mesh")
        return None
    if name not in found.solids:
        found.solids[name] = _solid(reading, found.meshes[name], found)
    return found.solids[name]


def _solid(reading: Reading, given: Element, found: Settings) -> Solid | None:
    mesh = completed(reading, given, found)
    measure = _MEASURES.get(mesh.get("inertia", "legacy"))
    if measure is None:
        problem = f"the inertia '{mesh.get('inertia')}' of a mesh"
        reading.report(mesh, problem, ", ".join(_MEASURES), HINT, "inertia")
        return None
    faces = _faces(reading, mesh, found)
    if faces is None:
        return None
    if not len(faces) or not np.isfinite(faces).all():
        problem = "a mesh without triangles" if not len(faces) else "a mesh that is not finite"
        reading.report(mesh, problem, "triangles of finite numbers", HINT, "file")
        return None
    solid = measure(_placed(reading, mesh, faces, found))
    if solid is None:
        problem = "the mesh encloses nothing, or its faces look inward"
        reading.report(mesh, problem, "a closed surface, counterclockwise from outside", HINT)
    return solid


def _placed(reading: Reading, mesh: Element, faces: Array, found: Settings) -> Array:
    """The corners where `refpos`, `refquat` and `scale` put them. A mirror image has its faces
    turned over, so that they look outward again."""
    turn = np.array(orientation(reading, _with_quaternion(mesh), found))
    scale = np.array(vector(reading, mesh, "scale", (1.0, 1.0, 1.0)))
    placed = (faces - np.array(vector(reading, mesh, "refpos"))) @ turn * scale
    return placed[:, ::-1] if scale.prod() < 0 else placed


def _with_quaternion(mesh: Element) -> Element:
    """An element that says `refquat` as others say `quat`."""
    given = {"quat": mesh.get("refquat")} if mesh.get("refquat") else {}
    return Element(mesh.tag, given, mesh.file, mesh.at)


# ---- files


def _faces(reading: Reading, mesh: Element, found: Settings) -> Array | None:
    """The corners of all triangles (n × 3 × 3); None after reporting."""
    if "vertex" in mesh.attributes:
        return _written_out(reading, mesh)
    if not mesh.get("file"):
        reading.report(mesh, "a mesh of no file", '<mesh file="….stl">', HINT)
        return None
    place = _place(reading, mesh, found)
    if place is None:
        return None
    try:
        faces = READERS[place.suffix.lower()](content(place, LARGEST))
    except (ValueError, IndexError, ModelError):
        faces = None
    if faces is None or len(faces) > MOST_FACES:
        problem = "cannot be read as triangles" if faces is None else f"has {len(faces)} triangles"
        expected = f"an STL, OBJ or MSH file of at most {MOST_FACES:,} triangles"
        reading.report(mesh, f"{mesh.get('file')} {problem}", expected, HINT, "file")
        return None
    return faces


def _place(reading: Reading, mesh: Element, found: Settings) -> Path | None:
    """Where the file is: a robot from elsewhere must not make us read whatever file it likes."""
    name = mesh.get("file")
    named = Path(found.mesh_folder) / (Path(name).name if found.without_path else name)
    if named.suffix.lower() not in READERS:
        problem = f"the mesh file {name!r} is of a kind that is not read"
        reading.report(mesh, problem, " or ".join(READERS), HINT, "file")
        return None
    place = next((home / named for home in found.homes if (home / named).is_file()), None)
    if place is None:
        problem = f"the mesh file {str(named)!r} is not there"
        reading.report(mesh, problem, "a file beside this one or below", HINT, "file")
        return None
    if not any(place.resolve().is_relative_to(home.resolve()) for home in found.homes):
        reading.report(
            mesh,
            f"the mesh file {str(named)!r} is outside the model's folder",
            "a file beside this one or below",
            "--include DIR allows files in another folder",
            "file",
        )
        return None
    return place


def _written_out(reading: Reading, mesh: Element) -> Array | None:
    corners, faces = listing(reading, mesh, "vertex"), listing(reading, mesh, "face")
    if corners and not mesh.get("face").split():
        problem = "a mesh without faces needs its convex hull, which is not made"
        reading.report(mesh, problem, 'face="…"', HINT, "vertex")
        return None
    if not corners or not faces or len(corners) % 3 or len(faces) % 3:
        expected = "three numbers for each vertex, and three for each face"
        reading.report(mesh, "the vertices and faces of a mesh", expected, HINT)
        return None
    points, indices = np.reshape(corners, (-1, 3)), np.reshape(faces, (-1, 3)).astype(int)
    if indices.min() < 0 or indices.max() >= len(points):
        reading.report(mesh, "a face of a vertex that is not there", "", HINT, "face")
        return None
    return points[indices]


def _stl(data: bytes) -> Array:
    """Binary, or text. ValueError where it is neither."""
    count = int.from_bytes(data[_HEAD - 4 : _HEAD], "little")
    if len(data) == _HEAD + count * _FACET.itemsize:
        return np.frombuffer(data, _FACET, count, _HEAD)["corners"].astype(float)
    if not data.lstrip().startswith(b"solid"):
        raise ValueError("no STL file")
    return np.array(_VERTEX.findall(data), dtype=float).reshape(-1, 3, 3)


def _obj(data: bytes) -> Array:
    """Polygons as fans of triangles, of the first object or group alone, as MuJoCo has it.
    ValueError or IndexError where a line makes no sense."""
    corners: list[list[float]] = []
    faces: list[tuple[int, int, int]] = []
    for line in data.splitlines():
        kind, *words = line.split() or [b""]
        if kind == b"v":
            corners.append([float(word) for word in words[:3]])
        elif kind in (b"o", b"g") and faces:
            break
        elif kind == b"f":
            at = [_index(word, len(corners)) for word in words]
            faces += [(at[0], *pair) for pair in pairwise(at[1:])]
    return np.array(corners, dtype=float).reshape(-1, 3)[np.array(faces, dtype=int).reshape(-1, 3)]


def _index(word: bytes, count: int) -> int:
    """From 1 on, or back from the latest."""
    number = int(word.partition(b"/")[0])
    return count + number if number < 0 else number - 1


def _msh(data: bytes) -> Array:
    """MuJoCo's own: four counts, vertices, normals, texture coordinates, faces. ValueError or
    IndexError where they do not fit."""
    vertices, normals, textures, faces = np.frombuffer(data, "<i4", 4).tolist()
    if min(vertices, normals, textures, faces) < 0:
        raise ValueError("no MSH file")
    corners = np.frombuffer(data, "<f4", 3 * vertices, 16).astype(float).reshape(-1, 3)
    after = 16 + 4 * (3 * vertices + 3 * normals + 2 * textures)
    indices = np.frombuffer(data, "<i4", 3 * faces, after).reshape(-1, 3)
    if faces and indices.min() < 0:
        raise IndexError("a face of a vertex that is not there")
    return corners[indices]


READERS: dict[str, Callable[[bytes], Array]] = {".stl": _stl, ".obj": _obj, ".msh": _msh}


# ---- measures


def _crossed(faces: Array) -> Array:
    """Normals twice as long as the faces are large."""
    return np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])


def _summed(faces: Array, sizes: Array, centre: Array, per: float) -> Solid | None:
    """Of pieces of these sizes, whose second moments are size/per times the sum over corners."""
    total = float(sizes.sum())
    if not total > 0:
        return None
    a, b, c = (faces[:, k] - centre for k in range(3))
    products = sum(np.einsum("i,ij,ik->jk", sizes, x, x) for x in (a, b, c, a + b + c)) / per
    inertia = np.trace(products) * np.eye(3) - products
    places = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    x, y, z = centre.tolist()
    return Solid(total, (x, y, z), tuple(float(inertia[place]) for place in places))


def _exact(faces: Array) -> Solid | None:
    normals, middle = _crossed(faces), faces.mean(axis=(0, 1))
    volumes = np.einsum("ij,ij->i", faces[:, 0] - middle, normals) / 6
    total = volumes.sum()
    if not total > 0:
        return None
    centre = middle + volumes @ (faces - middle).sum(axis=1) / (4 * total)
    return _summed(faces, np.einsum("ij,ij->i", faces[:, 0] - centre, normals) / 6, centre, 20)


def _legacy(faces: Array) -> Solid | None:
    normals, middles = _crossed(faces), faces.mean(axis=1)
    areas = np.linalg.norm(normals, axis=1)
    if not areas.sum() > 0:
        return None
    middle = areas @ middles / areas.sum()
    volumes = np.abs(np.einsum("ij,ij->i", middles - middle, normals)) / 6
    if not volumes.sum() > 0:
        return None
    centre = volumes @ (0.75 * middles + 0.25 * middle) / volumes.sum()
    sizes = np.abs(np.einsum("ij,ij->i", middles - centre, normals)) / 6
    return _summed(faces, sizes, centre, 20)


def _shell(faces: Array) -> Solid | None:
    areas = np.linalg.norm(_crossed(faces), axis=1) / 2
    if not areas.sum() > 0:
        return None
    return _summed(faces, areas, areas @ faces.mean(axis=1) / areas.sum(), 12)


_MEASURES: dict[str, Callable[[Array], Solid | None]] = {
    "legacy": _legacy,
    "exact": _exact,
    "shell": _shell,
}
