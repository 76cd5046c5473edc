"""What an MJCF file sets once for all: <compiler>, <option>, default classes and included files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from derive.diagnostics import did_you_mean, listed
from derive.robots.markup import LARGEST, ROOTS, Budget, Element, parsed, read
from derive.robots.numbers import listing, scalar, vector
from derive.robots.robot import Reading
from derive.robots.rotations import (
    IDENTITY,
    Matrix,
    Vector,
    about,
    cross,
    from_euler,
    from_quaternion,
    transposed,
    unit,
)

MOST_FILES = 100
KINDS = (".xml", ".mjcf")
LISTS = ("size", "gear", "stiffness", "damping")  # of which the first numbers may be given
ACTUATORS = (
    "general",
    "motor",
    "position",
    "velocity",
    "damper",
    "intvelocity",
    "cylinder",
    "muscle",
    "adhesion",
    "orientation",
    "pid",
    "dcmotor",
    "plugin",
)


@dataclass
class Settings:
    """`classes`: class → kind of element → attributes, with what the class inherits; `laws`: class
    → what the classes around it and it say of actuators, the outermost first. `off`: flags that are
    disabled. `total_mass`: what all bodies are scaled to, where it is more than zero.
    `idle_groups`: of actuators without force. `aligned`: free bodies move with their inertia's
    frame where they say nothing. `meshes` by name, whose files are below one of the `homes`, in
    `mesh_folder`, by their names alone where the file says `without_path`; `solids`: what those
    asked for enclose.
    """

    degrees: bool = True
    sequence: str = "xyz"
    inertia_from_geoms: str = "auto"
    groups: tuple[float, float] = (0.0, 5.0)
    least_mass: float = 0.0
    least_inertia: float = 0.0
    total_mass: float = 0.0
    gravity: Vector = (0.0, 0.0, -9.81)
    density: float = 0.0  # of the medium around the bodies
    viscosity: float = 0.0
    off: frozenset[str] = frozenset()
    idle_groups: tuple[float, ...] = ()
    aligned: bool = False
    homes: tuple[Path, ...] = ()
    mesh_folder: str = ""
    without_path: bool = False
    meshes: dict[str, Element] = field(default_factory=dict[str, Element])
    solids: dict[str, Any] = field(default_factory=dict[str, Any])
    classes: dict[str, dict[str, dict[str, str]]] = field(default_factory=lambda: {"main": {}})
    laws: dict[str, tuple[tuple[Element, ...], ...]] = field(
        default_factory=dict[str, tuple[tuple[Element, ...], ...]]
    )

    def angle(self, value: float) -> float:
        """An angle of the file in radians."""
        return math.radians(value) if self.degrees else value


def included(root: Element, budget: Budget, folders: Sequence[str] = ()) -> Element:
    """The root with the children of every included file in the place of its <include>.

    Bytes, elements and bodies of all files together come out of the budget. Files stay inside the
    folder of the root's file, or inside one of `folders`.
    """
    waiting, count = [root], 0
    homes = [place.resolve() for place in (root.file.folder, *map(Path, folders))]
    while waiting:
        parent = waiting.pop()
        children: list[Element] = []
        queue = parent.children[::-1]
        while queue:
            child = queue.pop()
            if child.tag == "include":
                count += 1
                if count > MOST_FILES:
                    child.refuse(
                        "more than 100 files are included",
                        "files that do not include each other in a circle",
                    )
                queue += _content(child, budget, homes)[::-1]
            else:
                children.append(child)
        parent.children = children
        waiting += children
    return root


def _content(include: Element, budget: Budget, homes: Sequence[Path]) -> list[Element]:
    name = include.get("file")
    if not name:
        include.refuse("an include without a file", '<include file="…"/>')
    place = next(
        (folder / name for folder in (include.file.folder, *homes) if (folder / name).is_file()),
        include.file.folder / name,
    )
    if (
        place.suffix.lower() not in KINDS
    ):  # a robot from elsewhere must not make us read, and quote, whatever file it likes
        include.refuse(
            f"the file {name!r} is no MJCF file by its name", " or ".join(KINDS), attribute="file"
        )
    if not place.is_file():
        include.refuse(
            f"the file {name!r} is not there", "a file beside this one", attribute="file"
        )
    if not any(place.resolve().is_relative_to(home) for home in homes):
        include.refuse(
            f"the file {name!r} is outside the model's folder",
            "a file beside this one or below",
            "--include DIR allows files in another folder",
            "file",
        )
    file = read(place)
    budget.bytes -= len(file.content)
    if budget.bytes < 0:
        include.refuse(
            "the included files are too large",
            f"at most {LARGEST >> 20} MiB in all",
            attribute="file",
        )
    root = parsed(file, budget)
    if root.tag not in ROOTS:
        include.refuse(
            f"the file {name!r} is no part of an MJCF model",
            "<mujoco> or <mujocoinclude> around its elements",
            attribute="file",
        )
    return root.children


def settings(reading: Reading, root: Element, folders: Sequence[str] = ()) -> Settings:
    """Of the whole file; later sections overrule earlier ones, as in MuJoCo."""
    result = Settings(homes=(root.file.folder, *map(Path, folders)))
    for section in root.children:
        if section.tag == "compiler":
            _compiler(reading, section, result)
        elif section.tag == "option":
            _option(reading, section, result)
        elif section.tag == "default":
            _defaults(reading, section, result)
        elif section.tag == "asset":
            for mesh in section.all("mesh"):
                result.meshes[mesh.get("name") or Path(mesh.get("file")).stem] = mesh
    _apply_flags(result)
    return result


def _compiler(reading: Reading, compiler: Element, found: Settings) -> None:
    if (angle := compiler.get("angle", "degree" if found.degrees else "radian")) not in (
        "degree",
        "radian",
    ):
        reading.report(compiler, f"angles in '{angle}'", "degree, radian", attribute="angle")
    found.degrees = angle == "degree"
    found.sequence = compiler.get("eulerseq", found.sequence)
    if len(found.sequence) != 3 or set(found.sequence.lower()) - set("xyz"):
        reading.report(
            compiler,
            f"the Euler sequence '{found.sequence}'",
            "three of x, y, z, X, Y, Z",
            attribute="eulerseq",
        )
        found.sequence = "xyz"
    if compiler.get("coordinate", "local") != "local":
        hint = "MuJoCo itself no longer reads them; save the model with an older version first"
        reading.report(compiler, "global coordinates", "coordinate=local", hint, "coordinate")
    if compiler.get("balanceinertia", "false") == "true":
        problem = "'balanceinertia', which changes inertias"
        reading.report(compiler, problem, "inertias as they are meant", attribute="balanceinertia")
    found.total_mass = scalar(reading, compiler, "settotalmass", found.total_mass)
    found.inertia_from_geoms = compiler.get("inertiafromgeom", found.inertia_from_geoms)
    found.least_mass = scalar(reading, compiler, "boundmass", found.least_mass)
    found.least_inertia = scalar(reading, compiler, "boundinertia", found.least_inertia)
    found.mesh_folder = compiler.get("meshdir", compiler.get("assetdir", found.mesh_folder))
    found.without_path |= compiler.get("strippath", "false") == "true"
    found.aligned = compiler.get("alignfree", "true" if found.aligned else "false") == "true"
    low, high = listing(reading, compiler, "inertiagrouprange", 2) or found.groups
    found.groups = (low, high)


def _option(reading: Reading, option: Element, found: Settings) -> None:
    found.gravity = vector(reading, option, "gravity", found.gravity)
    found.density = scalar(reading, option, "density", found.density)
    found.viscosity = scalar(reading, option, "viscosity", found.viscosity)
    found.idle_groups = tuple(listing(reading, option, "actuatorgroupdisable") or found.idle_groups)
    for flag in option.all("flag"):
        found.off |= {name for name, state in flag.attributes.items() if state == "disable"}
        found.off -= {name for name, state in flag.attributes.items() if state == "enable"}


def _apply_flags(found: Settings) -> None:
    """What a flag switches off besides what has its name."""
    if "gravity" in found.off:
        found.gravity = (0.0, 0.0, 0.0)
    if "passive" in found.off:  # the two together, in older versions
        found.off |= {"spring", "damper"}
    if "constraint" in found.off:
        found.off |= {"equality", "frictionloss"}


def _defaults(reading: Reading, default: Element, found: Settings) -> None:
    """A class inherits from the one around it; `main` is the name of the outermost."""
    waiting = [(default, "main")]
    while waiting:
        element, parent = waiting.pop(0)
        name = element.get("class") or ("main" if element is default else "")
        if not name:
            reading.report(element, "a default class without a name", '<default class="…">')
            continue
        if element is default and name != "main":
            found.classes.setdefault(name, found.classes["main"])
            found.classes["main"] = found.classes[name]
        table = {tag: dict(attributes) for tag, attributes in found.classes[parent].items()}
        for child in element.children:
            if child.tag != "default":
                kind = _family(child.tag)
                table[kind] = _overruled(table.get(kind, {}), child.attributes)
        around, own = found.laws.get(parent, ()), tuple(element.all(*ACTUATORS))
        if element is default:  # further ones at the top go on writing into the same class
            around, own = (), (*(around[0] if around else ()), *own)
        found.laws[name] = (*around, own)
        if name == "main" or element is default:
            found.classes["main"], found.laws["main"] = table, found.laws[name]
        found.classes[name] = table
        waiting += [(child, name) for child in element.all("default")]


def _family(tag: str) -> str:
    """MuJoCo keeps one set of defaults for all kinds of actuators, and one for both kinds of
    tendons."""
    return "actuator" if tag in ACTUATORS else "tendon" if tag in ("fixed", "spatial") else tag


def _overruled(before: dict[str, str], own: dict[str, str]) -> dict[str, str]:
    """One's own attributes over those of a class; an orientation over one in other words. Of a
    list that is shorter the class has the rest."""
    kinds = {name for name, _, _ in _ORIENTATIONS}
    if kinds & own.keys():
        before = {name: value for name, value in before.items() if name not in kinds}
    longer = {
        name: " ".join([*value.split(), *before[name].split()[len(value.split()) :]])
        for name, value in own.items()
        if name in before and name in LISTS
    }
    return before | own | longer


def completed(reading: Reading, element: Element, found: Settings, inherited: str = "") -> Element:
    """The element with the attributes its class gives it."""
    wanted = element.get("class") or inherited or "main"
    if wanted not in found.classes:
        known = list(found.classes)
        reading.report(
            element,
            f"unknown class '{wanted}'",
            listed(known),
            did_you_mean(wanted, known),
            "class",
        )
        return element
    attributes = _overruled(found.classes[wanted].get(_family(element.tag), {}), element.attributes)
    return Element(
        element.tag, attributes, element.file, element.at, element.children, element.text
    )


def orientation(reading: Reading, element: Element, found: Settings) -> Matrix:
    """quat, axisangle, euler, xyaxes or zaxis of an element; the identity where there is none."""
    for attribute, count, reader in _ORIENTATIONS:
        numbers = listing(reading, element, attribute, count)
        if numbers is not None:
            R = reader(numbers, found)
            if R is None:
                what = "a quaternion" if attribute == "quat" else f"'{attribute}' with a direction"
                reading.report(element, f"{what} of length zero", "a rotation", attribute=attribute)
            return R or IDENTITY
    return IDENTITY


def _quaternion(numbers: Sequence[float], found: Settings) -> Matrix | None:
    return from_quaternion(numbers)


def _axis_angle(numbers: Sequence[float], found: Settings) -> Matrix | None:
    axis = unit(numbers[:3])
    return about(axis, found.angle(numbers[3])) if axis else None


def _euler(numbers: Sequence[float], found: Settings) -> Matrix | None:
    return from_euler(found.sequence, [found.angle(angle) for angle in numbers])


def _xy_axes(numbers: Sequence[float], found: Settings) -> Matrix | None:
    x = unit(numbers[:3])
    if x is None:
        return None
    along = sum(a * b for a, b in zip(x, numbers[3:]))
    y = unit([b - along * a for a, b in zip(x, numbers[3:])])
    return transposed((x, y, cross(x, y))) if y else None


def _z_axis(numbers: Sequence[float], found: Settings) -> Matrix | None:
    return along_z(numbers)


def along_z(direction: Sequence[float]) -> Matrix | None:
    """The smallest turn that takes z to the direction."""
    z = unit(direction)
    if z is None:
        return None
    across = cross((0.0, 0.0, 1.0), z)
    return about(unit(across) or (1.0, 0.0, 0.0), math.atan2(math.hypot(*across), z[2]))


_ORIENTATIONS = (
    ("quat", 4, _quaternion),
    ("axisangle", 4, _axis_angle),
    ("euler", 3, _euler),
    ("xyaxes", 6, _xy_axes),
    ("zaxis", 3, _z_axis),
)
