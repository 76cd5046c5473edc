"""The smallest legal file of everything the schema knows, with each optional key left out and
given.

The schema says which keys there are, which are required and what form their values have. What it
does not say is what a value means; VALUES has values for each key name, whatever it stands in. An
entry is put into a scene, a small model around it, and `hamel check` says which of the candidates
are legal: the one with the fewest keys is the smallest.
"""

from __future__ import annotations

import itertools
import json
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Node = dict[str, Any]
MOST_KEYS = 3  # of the optional ones, in the search for a legal file
MOST_VARIANTS = 8  # values of one key
MOST_TRIED = 100  # entries in one search for a smallest file, in one scene


@dataclass(frozen=True)
class Scene:
    """A model into which one entry is put; `names` are what it has to refer to, by key."""

    family: str
    model: Node
    names: Node

    @property
    def width(self) -> int:
        """Components of a point."""
        return 2 if "plane" in self.model else 3


def _small(family: str, plane: Node, joint: Node, inertia: Any) -> Scene:
    """One body on one joint without a coordinate of its own name."""
    body = {"mass": 1, **({"inertia": inertia} if inertia else {})}
    model = plane | {
        "bodies": {"c": body},
        "joints": {"C": {"type": joint["type"], "parent": "ground", "child": "c"} | joint},
    }
    names = {
        "body": "c",
        "pair": ["ground", "c"],
        "joint": "C",
        "coordinate": "C",
        "rate": "der(C)",
    }
    return Scene(family, model, names)


def _large(family: str, plane: Node, last: Node, inertia: Any, gravity: list) -> Scene:
    """Two hinges in a row, and a body that can go anywhere."""
    bodies = {
        name: {"mass": mass, "inertia": inertia} for name, mass in (("a", 1), ("b", 2), ("c", 3))
    }
    hinge = {"type": "revolute", "parent": "ground", "child": "a"} | (
        {} if plane else {"axis": "z"}
    )
    joints = {
        "A": hinge | {"coordinate": "q"},
        "B": hinge
        | {"parent": "a", "child": "b", "coordinate": "r"}
        | {"at": [0.3, 0.1, 0.2][: len(gravity)]},
    }
    joints["C"] = {"parent": "ground", "child": "c"} | last
    names = {
        "body": "c", "pair": ["b", "c"], "joint": "A", "joints": ["A", "B"],
        "coordinate": "q", "second": "r", "rate": "der(q)", "velocity": "C.vx",
    }  # fmt: skip
    guess = {"q": 0.4, "r": -0.7, "x": 0.3, "y": 0.6} | (
        {"th": 0.2} if len(gravity) == 2 else {"z": 0.5, "e1": 0.2, "e2": 0.3, "e3": -0.1}
    )
    model = plane | {
        "gravity": gravity,
        "bodies": bodies,
        "joints": joints,
        "initial": {"guess": guess},
    }
    return Scene(family, model, names)


XY = {"plane": "xy"}
PLANAR = {"type": "planar", "coordinates": ["x", "y", "th"]}
FREE = {
    "type": "free",
    "position": ["x", "y", "z"],
    "orientation": {"euler": "zxy", "angles": ["e1", "e2", "e3"]},
}
ENERGIES = {
    "coordinates": {"q": "m", "r": "m"},
    "kinetic": "(1 kg)*(der(q)^2 + der(r)^2)/2",
    "initial": {"guess": {"q": "0.4 m", "r": "0.2 m"}},
}
SCENES = (
    _small("spatial", {}, {"type": "prismatic", "axis": "x"}, None),
    _small("spatial", {}, {"type": "revolute", "axis": "z"}, [0.1, 0.2, 0.3]),
    _large("spatial", {}, FREE, [0.2, 0.3, 0.4], [0, 0, -9.81]),
    _small("planar", XY, {"type": "revolute"}, 0.1),
    _large("planar", XY, PLANAR, 0.1, [0, -9.81]),
    Scene("analytic", ENERGIES, {"coordinate": "q", "second": "r", "rate": "der(q)"}),
)


def _driven(amplitudes: list[str]) -> Callable[[Scene], list]:
    return lambda scene: [f"({size})*sin((3 rad/s)*t)" for size in amplitudes]


def _some(*values: Any) -> Callable[[Scene], list]:
    return lambda scene: list(values)


def _named(key: str) -> Callable[[Scene], list]:
    return lambda scene: [scene.names[key]] if key in scene.names else []


def _formulas(*texts: str) -> Callable[[Scene], list]:
    """Formulas with {q}, {r}, {v}, {c}, {p} for what the scene has; those that it cannot fill are
    left out."""

    def values(scene: Scene) -> list:
        known = {"q": "coordinate", "r": "second", "v": "rate", "c": "body"}
        names = {short: scene.names[key] for short, key in known.items() if key in scene.names}
        names["p"] = str([0.1] * scene.width)
        return [
            text.format_map(names)
            for text in texts
            if all(f"{{{k}}}" not in text or k in names for k in "qrvcp")
        ]

    return values


def _entries(key: Callable[[Scene], list], *values: Any) -> Callable[[Scene], list]:
    """Mappings from a name of the scene."""
    return lambda scene: [{name: value} for name in key(scene) for value in values]


COORDINATE, RATE = _named("coordinate"), _named("rate")


def _pair(scene: Scene) -> list:
    """Two coordinates, where the scene has two."""
    names = [scene.names[key] for key in ("coordinate", "second") if key in scene.names]
    return [names] if len(names) == 2 else []


def _choices(scene: Scene) -> list:
    rate = scene.names["rate"]
    return ["auto", "orthonormal", "frozen", "mass_orthogonal", [rate], {"w": rate}]


def _steady(scene: Scene) -> list:
    name = scene.names["coordinate"]
    return [{name: 0}, {"guess": {name: 0.1}}]


# What the schema does not say: values that mean something, by key; those of another form than the
# schema's are passed over.
VALUES: dict[str, Callable[[Scene], list]] = {
    "model": _some("m"),
    "plane": _some("xy"),
    "body": _named("body"),
    "child": _named("body"),
    "parent": _some("ground"),
    "of": _some("ground"),
    "between": _named("pair"),
    "joint": _named("joint"),
    "joints": _named("joints"),
    "coordinate": COORDINATE,
    "coordinates": _pair,
    "velocity": lambda scene: [scene.names.get("velocity", scene.names["rate"])],
    "JointEntry.coordinate": _some("turn"),
    "JointEntry.coordinates": _some(*([f"n{i + 1}" for i in range(n)] for n in range(1, 8))),
    "JointEntry.position": _some(["px", "py", "pz"]),
    "orientation": _some("quaternion"),
    "angles": _some(["n1", "n2", "n3"]),
    "quaternion": _some(["n1", "n2", "n3", "n4"]),
    "euler": _some("zxy", "xyz", "zxz"),
    "axis": _some("z", "x", [0, 1, 0], [0.6, 0.8]),
    "axis2": _some("x", [0, 1, 0]),
    "direction": _some("y", [0.6, 0.8], [0, 0.6, 0.8]),
    "normal": _some("y", "z", [0, 1], [0, 0.6, 0.8]),
    "rpy": _some([0.1, 0.2, 0.3]),
    "axis_angle": _some([[0, 0, 1], 0.4]),
    "matrix": _some([[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "inertia": _some(
        0.1,
        [0.1, 0.2, 0.25],
        [0.1, 0.2, 0.25, 0.01, 0.02, -0.03],
        [[0.1, 0.01, 0.02], [0.01, 0.2, -0.03], [0.02, -0.03, 0.25]],
    ),
    "tensor": _some(0.1, [0.1, 0.2, 0.25], [0.1, 0.2, 0.25, 0.01, 0.02, -0.03]),
    "InertiaEntry.about": _some("com", "origin"),
    "about": _some("a word"),
    "description": _some("Some words."),
    "frame": _some("ground", "body"),
    "limits": _some([-1, 1]),
    "unit": _some("rad", "m", "N", "N*m"),
    "surface": _some("x + 2*y"),
    "motion": _driven(["0.2 rad", "0.2 m"]),
    "expression": _driven(["2 N*m", "2 N"]),
    "holonomic": _formulas("{q} - 2*{r}"),
    "nonholonomic": _formulas("der({q}) - 2*der({r})"),
    "nonideal": _entries(COORDINATE, "0.5 N*m", "0.5 N"),
    "value": _some("0.2 m"),
    "kinetic": _formulas("(1 kg)*{v}^2/2", "(1 kg*m^2)*{v}^2/2"),
    "potential": _formulas("(1 N/m)*{q}^2/2", "(1 N*m/rad^2)*{q}^2/2"),
    "forces": _entries(COORDINATE, "0.5 N", "0.5 N*m"),
    "parameters": _some({"k": "0.2 m"}),
    "Model.coordinates": _some({"z": "m"}),
    "where": _formulas("2*{q}"),
    "outputs": _formulas(
        "position({c}, {p})", "velocity({c}, {p})", "acceleration({c}, {p})", "angle({c})", "{q}"
    ),
    "quasi_velocities": _choices,
    "initial": _entries(lambda scene: [*COORDINATE(scene), *RATE(scene)], 0.1),
    "steady_motion": _steady,
    "source": _some("a page"),
    "tolerance": _some(0.1),
    "values": _entries(COORDINATE, 0),
    "accelerations": _entries(RATE, 0),
    "set": _entries(COORDINATE, 0.1),
    "end": _entries(COORDINATE, 0.1),
    "time": _some(0.5),
    "rtol": _some(1e-6),
    "spoiled": _some("all"),
    "choice": _some("orthonormal"),
    "real": _some("float32"),
    "integrator": _some("rk4"),
    "enforcement": _some("none", "projection"),
    "refused": _some("words"),
    "pitch": _some(0.2),
    "WrenchEntry.frame": _named("body"),
    "TableEntry.points": _some([[0, 0], [1, 2], [2, 3], [3, 1]]),
    "TableEntry.file": _some("points.csv"),
    "TableEntry.units": _some(["m", "N"]),
    "TableEntry.smooth": _some("C1", "C2"),
    "SubmodelEntry.use": _some("part.yaml", "planar_part.yaml"),
    "SubmodelEntry.ground": _named("body"),
    "SubmodelEntry.parameters": _some({"mp": "2 kg"}),
}  # fmt: skip

# The files that entries name; they lie beside every model.
BESIDE = {
    "points.csv": "0,0\n1,2\n2,3\n3,1\n",
    "part.yaml": """model: part
parameters: {mp: 1 kg}
bodies: {p: {mass: mp}}
joints: {P: {type: prismatic, axis: x, parent: ground, child: p, at: [0, 0.1, 0]}}
""",
    "planar_part.yaml": """model: planar_part
plane: xy
parameters: {mp: 1 kg}
bodies: {p: {mass: mp}}
joints: {P: {type: prismatic, axis: x, parent: ground, child: p, at: [0, 0.1]}}
""",
}


def put_beside(folder: Path) -> None:
    for name, text in BESIDE.items():
        (folder / name).write_text(text)


class Schema:
    """Values of the forms that the schema allows."""

    def __init__(self, text: str):
        self.root: Node = json.loads(text)
        self.definitions: Node = self.root.get("$defs", {})

    def forms(self, node: Node) -> Iterator[Node]:
        """The alternatives of a node, without null."""
        if "$ref" in node:
            node = self.definitions[node["$ref"].rpartition("/")[2]]
        options = node.get("anyOf", node.get("oneOf"))
        if options is None:
            yield from () if node.get("type") == "null" else (node,)
            return
        for option in options:
            yield from self.forms(option)

    def values(self, node: Node, key: str, owner: str, scene: Scene) -> Iterator[Any]:
        """Of every form of a key's value some that mean something."""
        known = VALUES.get(f"{owner}.{key}", VALUES.get(key))
        meant = known(scene) if known else []
        for form in self.forms(node):
            fitting = [value for value in meant if self.fits(form, value)]
            yield from fitting or self._by_form(form, key, owner, scene, bool(known))

    def _by_form(
        self, form: Node, key: str, owner: str, scene: Scene, known: bool
    ) -> Iterator[Any]:
        if "const" in form or "enum" in form:
            yield from [form["const"]] if "const" in form else form["enum"]
        elif "properties" in form:
            yield from itertools.islice(self.mappings(form, scene), MOST_VARIANTS)
        elif form.get("type") == "array":
            yield from self._lists(form, key, owner, scene, known)
        elif form.get("type") != "object" and not known:
            yield 0.5

    def _lists(self, form: Node, key: str, owner: str, scene: Scene, known: bool) -> Iterator[Any]:
        items = form.get("items")
        if items is None or (known and form.get("minItems") is None):
            return
        if form.get("minItems") is None:
            yield [0.1, 0.2, 0.3][: scene.width]
            return
        for item in self.values(items, "", owner, scene):
            if isinstance(item, list | dict):
                yield [item] * form["minItems"]

    def kinds(self) -> Iterator[Kind]:
        """Every entry of every section of a model file."""
        for section, node in self.root["properties"].items():
            entries = node.get("additionalProperties")
            forms = self.forms(entries) if isinstance(entries, dict) else ()
            for form in (form for form in forms if "properties" in form):
                options = form["properties"].get("type", {})
                for kind in options.get("enum", [options.get("const")]):
                    yield Kind(section, form, (("type", kind),) if kind else ())

    def fits(self, form: Node, value: Any) -> bool:
        """Whether the schema's form of a value is this one's."""
        if "enum" in form or "const" in form:
            return value in form.get("enum", [form.get("const")])
        kinds = form.get("type", [])
        kinds = {kinds} if isinstance(kinds, str) else set(kinds)
        if isinstance(value, dict):
            return "object" in kinds and "properties" not in form
        if isinstance(value, list):
            return "array" in kinds and form.get("minItems") is None
        return bool(kinds & {"string", "number"})

    def mappings(self, form: Node, scene: Scene, most: int = 2) -> Iterator[Node]:
        """A mapping with its required keys, then with one and with two of the optional ones."""
        required = form.get("required", [])
        optional = [key for key in form["properties"] if key not in required]
        for count in range(most + 1):
            for keys in itertools.combinations(optional, count):
                yield from self.given(form, (*required, *keys), scene)

    def given(
        self, form: Node, keys: tuple[str, ...], scene: Scene, fixed: Node | None = None
    ) -> Iterator[Node]:
        """Mappings with just these keys: every value of each, the others at their first."""
        choices = []
        for key in keys:
            values = (
                [(fixed or {})[key]]
                if key in (fixed or {})
                else list(self.values(form["properties"][key], key, form.get("title", ""), scene))
            )
            choices.append(values)
        if not all(choices):
            return
        first = {key: values[0] for key, values in zip(keys, choices, strict=True)}
        yield first
        for key, values in zip(keys, choices, strict=True):
            yield from (first | {key: value} for value in values[1:MOST_VARIANTS])


@dataclass(frozen=True)
class File:
    """A model file: what it is of, which optional key it shows, and whether `hamel check` took
    it."""

    kind: str
    key: str
    model: Node
    legal: bool

    @property
    def text(self) -> str:
        return json.dumps(self.model, indent=1)  # JSON is YAML


Oracle = Callable[[Node], str]  # why a model is refused; empty when it is legal


@dataclass(frozen=True)
class Kind:
    """An entry of the schema with the value that tells it from others of its form, such as type:
    ball."""

    section: str
    form: Node
    fixed: tuple[tuple[str, str], ...]

    @property
    def name(self) -> str:
        return (
            " ".join((self.section, *(value for _, value in self.fixed)))
            if self.fixed
            else f"{self.section} {self.form['title']}"
        )


def placed(scene: Scene, section: str, entry: Any) -> Node:
    """The scene with one entry: the body c, the joint C or the coordinate q is replaced, anything
    else added."""
    slot = {"bodies": "c", "joints": "C", "coordinates": "q"}.get(section, "e")
    model = {"model": "m"} | scene.model
    if section == "joints" and "x" in model.get("initial", {}).get("guess", {}):
        guess = {
            name: value for name, value in model["initial"]["guess"].items() if name in ("q", "r")
        }
        model["initial"] = {"guess": guess}  # the coordinates of the joint that is replaced
    return model | {section: model.get(section, {}) | {slot: entry}}


def smallest(
    schema: Schema, kind: Kind, scenes: list[Scene], refusal: Oracle, key: str = ""
) -> tuple[Scene, Node] | None:
    """The scene and the entry with the fewest optional keys that is legal, with `key` given if one
    is named.

    What most refusals name is added, a key at a time; where they name no key, each is tried.
    """
    required = (*kind.form.get("required", []), *([key] if key else []))
    optional = [k for k in kind.form["properties"] if k not in required and k != "about"]
    for scene in scenes:
        waiting, seen = [required], {frozenset(required)}
        left = MOST_TRIED // 4 if key else MOST_TRIED
        while waiting and left > 0:
            keys, words = waiting.pop(), Counter[str]()
            for entry in itertools.islice(
                schema.given(kind.form, keys, scene, dict(kind.fixed)), left
            ):
                left -= 1
                reason = refusal(placed(scene, kind.section, entry))
                if not reason:
                    return scene, entry
                words.update(said(reason))
            named = sorted(
                (k for k in optional if k in words and k not in keys), key=lambda k: words[k]
            )  # the surest is tried next
            more = named or (optional[::-1] if keys == required and not key else [])
            new = [
                (*keys, k)
                for k in more
                if frozenset((*keys, k)) not in seen and len(keys) < len(required) + MOST_KEYS
            ]
            seen.update(map(frozenset, new))
            waiting += new
    return None


def said(reason: str) -> set[str]:
    """The words of a refusal, without the lines that it quotes of the file."""
    return {
        word for line in reason.splitlines() if '"' not in line for word in re.findall(r"\w+", line)
    }


def of_kind(schema: Schema, kind: Kind, family: str, refusal: Oracle) -> Iterator[File]:
    """The smallest legal file and one for every optional key; for every value of the key where it
    stands beside no other."""
    scenes = [scene for scene in SCENES if scene.family == family]
    start = smallest(schema, kind, scenes, refusal)
    if start is None:
        return
    scene, least = start
    name = f"{kind.name}, {family}"
    yield File(name, "", placed(scene, kind.section, least), True)
    for key in kind.form["properties"]:
        if key not in least:
            yield from _with_key(schema, kind, key, name, scene, least, refusal)


def _with_key(
    schema: Schema, kind: Kind, key: str, name: str, scene: Scene, least: Node, refusal: Oracle
) -> Iterator[File]:
    models = [
        placed(scene, kind.section, least | {key: value})
        for value in itertools.islice(
            schema.values(kind.form["properties"][key], key, kind.form["title"], scene),
            MOST_VARIANTS,
        )
    ]
    good = [model for model in models if not refusal(model)]
    yield from (File(name, key, model, True) for model in good)
    if good:
        return
    family = [s for s in SCENES if s.family == scene.family]
    other = smallest(schema, kind, family, refusal, key)  # in place of others, or in a larger scene
    if other is not None:
        yield File(name, key, placed(other[0], kind.section, other[1]), True)
    elif models:
        yield File(name, key, models[0], False)


def of_top(schema: Schema, refusal: Oracle) -> Iterator[File]:
    """The keys of the model file itself, each in the smallest scene of each family that takes
    it."""
    for key, node in schema.root["properties"].items():
        entries = node.get("additionalProperties")
        plain = isinstance(entries, dict) and not any(
            "properties" in form for form in schema.forms(entries)
        )
        done: set[str] = set()
        for scene in SCENES:
            if scene.family in done or key in scene.model or key == "model":
                continue
            meant = VALUES.get(f"Model.{key}", VALUES.get(key))
            if plain and meant:
                values = [
                    value
                    if isinstance(value, dict)
                    and key in ("initial", "forces", "parameters", "coordinates")
                    else {"e": value}
                    for value in meant(scene)
                ]
            else:
                values = (
                    list(schema.values(node, key, "Model", scene))
                    if not isinstance(entries, dict)
                    else []
                )
            models = [{"model": "m"} | scene.model | {key: value} for value in values]
            good = [model for model in models if not refusal(model)]
            yield from (File(f"{key}, {scene.family}", key, model, True) for model in good)
            if good:
                done.add(scene.family)
            elif models and scene is [s for s in SCENES if s.family == scene.family][-1]:
                yield File(f"{key}, {scene.family}", key, models[0], False)


def files(schema: Schema, refusal: Oracle, wanted: Collection[str]) -> Iterator[File]:
    """Those of the wanted sections; `keys` are the keys of the model file itself."""
    for kind in schema.kinds():
        if kind.section in wanted:
            for family in dict.fromkeys(scene.family for scene in SCENES):
                yield from of_kind(schema, kind, family, refusal)
    if "keys" in wanted:
        yield from of_top(schema, refusal)
