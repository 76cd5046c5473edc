"""What the README says of extending hamel: a toy joint, closure, load, constraint, formulation,
enforcement, integrator and target, each one file and one line, work through the front door of a copy of the
packages."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HOME = Path(__file__).parent.parent

RAIL = '''"""A rail whose rack moves twice as far as its pinion says."""

from derive.joints.records import LOCKED, JointType, Slot

RAIL = JointType(
    name="rail",
    about="slides twice as far as its coordinate says",
    coordinates=(Slot("", "m"),),
    velocities=(Slot("", "m/s"),),
    needs_axis=True,
    rotation=lambda q, axis: (),
    translation=lambda q, axis: [2 * q[0] * a for a in axis],
    motion=lambda q, axis: [[0.0, 0.0, 0.0, *(2 * a for a in axis)]],
    rates=lambda q, v, axis: [v[0]],
    closing=lambda plane: ("shift1", "shift2", *LOCKED),
)
'''

RAIL_CLOSING = '''"""Rails that close a loop."""

from derive.mechanics.closures.parts import LOCKED, right_angles, shifts
from derive.mechanics.closures.records import Closing


def rail(scene, closure):
    return [shifts(scene, closure, (0, 1)), right_angles(scene, closure, LOCKED)]


RAIL = Closing("rail", rail)
'''

MAGNET = '''"""A magnet that pulls a joint back with the cube of its coordinate."""

from dataclasses import dataclass

from pydantic import Field

from derive.expressions.tree import Expression
from derive.model.actuators import velocity_of
from derive.model.language.keys import Entry, Formula
from derive.model.language.kind import Kind
from derive.model.records import Span


@dataclass(frozen=True)
class Magnet:
    name: str
    velocity: str
    coordinate: str
    strength: Expression
    span: Span


class MagnetEntry(Entry):
    """A magnet at a joint: -strength q^3."""

    type: Formula
    joint: Formula = Field(description="A joint with one coordinate.")
    strength: Formula = Field(description="Force per cube of the coordinate.")


def magnet(reader, document, names, key, entry):
    target = velocity_of(reader, key, entry, names.velocities)
    if target is None:
        return None
    strength = reader.formula(entry.strength, "a strength")
    return Magnet(str(key), target.name, target.rate_of, strength, key.span)


MAGNET = Kind("magnet", MagnetEntry, magnet)
'''

MAGNET_LAW = '''"""The force of a magnet."""

from derive.mechanics.loads.records import Law, along, force_alone
from derive.model.loads.magnet import Magnet


def magnet(scene, load):
    s = scene.symbols
    force = -s.scalar(load.strength) * s.names[load.coordinate] ** 3
    return force_alone(scene, along(scene, load.velocity, force))


MAGNET = Law(Magnet, magnet)
'''

PINNED = '''"""A coordinate that stays where it is said to be: a record that is there already."""

from pydantic import Field

from derive.expressions.tree import Name
from derive.model.algebra import minus
from derive.model.constraints.places import of_name
from derive.model.language.entries import Entry, Formula
from derive.model.language.kind import Kind
from derive.model.constraint_records import Holonomic


class PinnedEntry(Entry):
    """A coordinate stays at a value."""

    type: Formula
    coordinate: Formula = Field(description="The coordinate.")
    value: Formula = Field(description="Where it stays.")


def pinned(reader, document, names, key, entry):
    coordinate = of_name(reader, names, entry.coordinate)
    value = reader.formula(entry.value, "a position", unit=coordinate.unit)
    return Holonomic(str(key), minus(Name(coordinate.name), value), (), key.span)


PINNED = Kind("pinned", PinnedEntry, pinned)
'''

HEUN = '''"""Heun's method."""

from fractions import Fraction

from codegen.integrators.records import Tableau, row

HEUN = Tableau(
    name="heun",
    about="Heun's method of order 2, fixed steps",
    source="K. Heun: Neue Methoden zur approximativen Integration, 1900",
    order=2,
    c=row("0 1"),
    a=((), row("1"), row("1/2 1/2")),
    errors=(),
    damping=Fraction(0),
)
'''

NOTE = '''"""A note with the names of the functions."""

from codegen.targets.records import Target

NOTE = Target(
    name="note",
    about="the names of the functions",
    files=lambda program: {"note.txt": " ".join(kernel.name for kernel in program.kernels)},
)
'''

CARELESS = '''"""Nothing, said otherwise."""

from dataclasses import replace

from derive.enforcement.none import NONE

CARELESS = replace(NONE, name="careless", about="nothing, carelessly")
'''

SHAKEN = '''"""Udwadia and Kalaba's equation under another name."""

from dataclasses import replace

from derive.formulations.methods import udwadia_kalaba


def equations(survey, choice):
    return replace(udwadia_kalaba.FORMULATION.build(survey, choice), formulation="shaken")


FORMULATION = replace(udwadia_kalaba.FORMULATION, name="shaken", build=equations)
'''

# file → its text, and the line of the table that names it: (file, before, import, entry)
TOYS = {
    "derive/joints/rail.py": RAIL,
    "derive/mechanics/closures/rail.py": RAIL_CLOSING,
    "derive/model/loads/magnet.py": MAGNET,
    "derive/mechanics/loads/magnet.py": MAGNET_LAW,
    "derive/model/constraints/pinned.py": PINNED,
    "codegen/integrators/heun.py": HEUN,
    "codegen/targets/note.py": NOTE,
    "derive/enforcement/careless.py": CARELESS,
    "derive/formulations/methods/shaken.py": SHAKEN,
}
LINES = {
    "derive/joints/__init__.py": ("JOINTS = (", "from derive.joints.rail import RAIL", "RAIL"),
    "derive/mechanics/closures/__init__.py": (
        "CLOSINGS = (",
        "from derive.mechanics.closures.rail import RAIL",
        "RAIL",
    ),
    "derive/model/loads/__init__.py": (
        "LOADS: tuple[Kind[Load | None], ...] = (",
        "from derive.model.loads.magnet import MAGNET",
        "MAGNET",
    ),
    "derive/mechanics/loads/__init__.py": (
        "LAWS = (",
        "from derive.mechanics.loads.magnet import MAGNET",
        "MAGNET",
    ),
    "derive/model/constraints/__init__.py": (
        "CONSTRAINTS: tuple[Kind[Constraint], ...] = (",
        "from derive.model.constraints.pinned import PINNED",
        "PINNED",
    ),
    "codegen/integrators/__init__.py": (
        "INTEGRATORS: tuple[Integrator, ...] = (",
        "from codegen.integrators.heun import HEUN",
        "DOP853, HEUN",  # the first one is the default
    ),
    "codegen/targets/__init__.py": (
        "TARGETS: tuple[Target, ...] = (",
        "from codegen.targets.note import NOTE",
        "NOTE",
    ),
    "derive/enforcement/__init__.py": (
        "ENFORCEMENTS: tuple[Enforcement, ...] = (",
        "from derive.enforcement.careless import CARELESS",
        "PROJECTION, CARELESS",  # the first one is the default
    ),
    "derive/formulations/methods/__init__.py": (
        "FORMULATIONS: tuple[Formulation, ...] = (",
        "from derive.formulations.methods import shaken",
        "shaken.FORMULATION",
    ),
}

CART = """model: cart
gravity: [0, 0, -9.81 m/s^2]
bodies: {a: {mass: 2 kg, inertia: 1}, b: {mass: 1 kg, inertia: 1}}
joints:
  s: {type: prismatic, parent: ground, child: a, axis: x}
  r: {type: revolute, parent: a, child: b, axis: y, at: [[0, 0, 0], [0, 0, 1]]}
constraints: {hold: {type: pinned, coordinate: s, value: 0.1 m}}
initial: {r: 0.2 rad, guess: {s: 0.1 m}}
"""
# twice the way: the equation of a cart of four times the mass on a spring of ours
PULLED = """model: pulled
bodies: {a: {mass: 2 kg, inertia: 1}}
joints: {s: {type: rail, parent: ground, child: a, axis: x}}
loads: {m: {type: magnet, joint: s, strength: 8 N/m^3}}
initial: {s: 1 m}
"""
# a loop of a free body and a slanted rail: it slides down with g sin 30°
SLIDING = """model: sliding
gravity: [0, 0, -9.81 m/s^2]
bodies: {a: {mass: 2 kg, inertia: 1}}
joints: {f: {type: free, parent: ground, child: a}}
closures: {c: {type: rail, between: [ground, a], at: [[0, 0, 0], [0, 0, 0]], axis: [cos(30 deg), 0, -sin(30 deg)]}}
initial: {guess: {f_qw: 1}}
"""


@pytest.fixture(scope="module")
def extended(tmp_path_factory) -> Path:
    """A copy of the packages with every toy in it."""
    place = tmp_path_factory.mktemp("extended")
    for package in ("derive", "codegen", "hamel"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(HOME / package, place / package, ignore=ignored)
    for file, text in TOYS.items():
        (place / file).write_text(text)
    for file, (opening, imported, entry) in LINES.items():
        text = (place / file).read_text()
        assert text.count(opening) == 1, file
        head, tail = text.split(opening)
        first = entry.split(",")[0]
        if "," in entry:  # after the default
            tail = tail.replace(first, "", 1).lstrip().removeprefix(",")
        future = "from __future__ import annotations\n"
        before, found, after = head.rpartition(future)
        head = f"{before}{found}\n{imported}\n{after}" if found else head
        if not found:
            docstring, quotes, rest = head[3:].partition('"""')
            head = f'"""{docstring}{quotes}\n{imported}\n{rest}'
        (place / file).write_text(f"{head}{opening}{entry}, {tail}")
    (place / "cart.yaml").write_text(CART)
    (place / "pulled.yaml").write_text(PULLED)
    (place / "sliding.yaml").write_text(SLIDING)
    return place


def run(place: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {
        **os.environ,
        "PYTHONPATH": str(place),
        "XDG_CACHE_HOME": str(place / "cache"),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    command = [sys.executable, "-m", "hamel", *arguments, "--json"]
    return subprocess.run(
        command, cwd=place, env=environment, capture_output=True, text=True, check=False
    )


def test_the_schema_and_the_list_name_every_toy(extended: Path) -> None:
    listed = run(extended, "list").stdout
    for name in ("rail", "magnet", "pinned", "shaken", "careless", "heun", "note"):
        assert f'"{name}"' in listed, name
    schema = run(extended, "schema").stdout
    for name in ("rail", "magnet", "pinned"):
        assert f'"{name}"' in schema, name


def test_a_constraint_formulation_integrator_and_target_are_built_and_verified(
    extended: Path,
) -> None:
    options = ("--formulation", "shaken", "--integrator", "heun", "--numpy", "-o", "out")
    built = run(extended, "build", "cart.yaml", *options)
    assert built.returncode == 0, built.stderr + built.stdout
    assert json.loads(built.stdout)["verified"]
    assert "dynamics" in (extended / "out/note.txt").read_text()


# what a new joint and a new load are checked against: a second derivation, written apart on purpose
DERIVED_AGAIN = {
    "hamel/verify/reference/joints.py": (
        '    "revolute": revolute,',
        """    "rail": lambda q, v, axis: Motion(
        np.eye(3), 2 * q[0] * axis, np.append(np.zeros(3), 2 * axis)[:, None], np.eye(1), np.zeros(1)
    ),
""",
    ),
    "hamel/verify/reference/closures.py": (
        '    "screw": _screw,',
        """    "rail": _positions(
        lambda loop: _across(loop, (0, 1)), lambda loop: _square(loop, NO_TURN)
    ),
""",
    ),
    "hamel/verify/reference/loads.py": (
        "        case JointSpring()",
        """        case Magnet():
            s = state.q[[c.name for c in model.coordinates].index(load.coordinate)]
            where, direction = _conjugate(model, state, load.velocity)
            return _only(other=(where, -state.value(load.strength) * s**3 * direction))
""",
    ),
}
MAGNET_KNOWN = "from derive.model.loads.magnet import Magnet\n"


@pytest.fixture(scope="module")
def known(extended: Path, tmp_path_factory) -> Path:
    """The same with the toys in the reference of verify, too."""
    place = tmp_path_factory.mktemp("known")
    shutil.copytree(extended, place, dirs_exist_ok=True)
    for file, (before, text) in DERIVED_AGAIN.items():
        source = (place / file).read_text()
        assert source.count(before) == 1, file
        (place / file).write_text(source.replace(before, text + before))
    loads = place / "hamel/verify/reference/loads.py"
    loads.write_text(
        loads.read_text().replace(
            "from derive.model.records", MAGNET_KNOWN + "from derive.model.records", 1
        )
    )
    return place


def test_a_joint_load_and_enforcement_are_simulated(known: Path) -> None:
    """4 m s̈ = −k s³, whose energy 2 m ṡ² + k s⁴/4 stays: ṡ² = k (1 − s⁴)/(8 m)."""
    moved = run(known, "simulate", "pulled.yaml", "--time", "1")
    assert moved.returncode == 0, moved.stderr + moved.stdout
    end = json.loads(moved.stdout)["final"]
    assert abs(end["der(s)"] ** 2 - 8 * (1 - end["s"] ** 4) / 16) < 1e-8 and end["s"] < 0.9
    options = ("--enforcement", "careless", "--integrator", "heun", "--step-size", "1e-3")
    held = run(known, "simulate", "cart.yaml", "--time", "0.1", *options)
    assert held.returncode == 0, held.stderr + held.stdout
    assert json.loads(held.stdout)["enforcement"] == "careless"


def test_a_closure_is_simulated(known: Path) -> None:
    """x = g sin 30° cos 30° t²/2 after a second from rest, a row of the loop by the name its joint
    gives it."""
    moved = run(known, "simulate", "sliding.yaml", "--time", "1")
    assert moved.returncode == 0, moved.stderr + moved.stdout
    assert abs(json.loads(moved.stdout)["final"]["f_x"] - 9.81 * 3**0.5 / 8) < 1e-8


def test_what_the_reference_does_not_know_is_refused_with_a_sentence(extended: Path) -> None:
    refused = run(extended, "verify", "pulled.yaml", "--states", "2")
    assert refused.returncode == 2, refused.stdout
    assert "verify cannot derive" in json.loads(refused.stdout)["error"]["message"]
