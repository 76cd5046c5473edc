"""<tendon>: fixed ones, along joints, and spatial ones, along paths through sites; their springs
and dampers.

A fixed tendon has the length ℓ = Σ cᵢ qᵢ. A spatial one runs straight from site to site; a pulley
ends a branch, and ℓ = Σ Lₖ/dₖ with the divisor dₖ of the pulley before branch k (1 of the first).
What pulls with f along ℓ pulls with f/dₖ in branch k.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import dist

from derive.diagnostics import listed
from derive.robots.markup import Element
from derive.robots.mjcf.bodies import Scene
from derive.robots.mjcf.forces import (
    Transmission,
    by_formula,
    coefficient,
    in_yaml,
    joint_of,
    load,
)
from derive.robots.mjcf.forces import times as product_of
from derive.robots.mjcf.laws import Law
from derive.robots.mjcf.polynomials import NONE, of_length, of_speed, powers
from derive.robots.mjcf.settings import completed
from derive.robots.numbers import listing, scalar, written
from derive.robots.robot import Entry, Reading, quoted
from derive.robots.rotations import IDENTITY, ORIGIN, Vector, minus, times, unit

FORCES = ("stiffness", "damping", "armature", "frictionloss")


@dataclass(frozen=True)
class Branch:
    """Straight lines through points of bodies, of whose length `share` counts; `name` is that of
    the path."""

    name: str
    share: float
    points: tuple[tuple[str, Vector], ...]

    def places(self, scene: Scene) -> list[Vector]:
        """Its points in the ground frame at the reference configuration."""
        return [scene.poses[body].then(at, IDENTITY).at for body, at in self.points]


@dataclass
class Line:
    """A spatial tendon. Its paths are written into the model when something needs them."""

    place: Element
    branches: tuple[Branch, ...]
    is_written: bool = False

    def length(self, scene: Scene) -> str:
        """Its length by formula."""
        self._write(scene)
        return _sum((branch.share, f"length({branch.name})") for branch in self.branches)

    def speed(self, scene: Scene) -> str:
        """How fast it becomes longer, by formula."""
        self._write(scene)
        return _sum((branch.share, f"der(length({branch.name}))") for branch in self.branches)

    def reference(self, scene: Scene) -> float:
        """Its length at the reference configuration, in metres."""
        return sum(
            branch.share * dist(first, second)
            for branch in self.branches
            for first, second in pairwise(branch.places(scene))
        )

    def pushes(self, scene: Scene) -> Iterator[tuple[str, Vector, Vector]]:
        """Bodies, points in the ground frame at the reference configuration, and what a unit force
        along the length does there."""
        for branch in self.branches:
            bodies = [body for body, _ in branch.points]
            ends = pairwise(zip(bodies, branch.places(scene)))
            for (body, start), (other, end) in ends:
                along = unit(minus(end, start)) or ORIGIN
                yield other, end, times(branch.share, along)
                yield body, start, times(-branch.share, along)

    def _write(self, scene: Scene) -> None:
        if self.is_written:
            return
        self.is_written = True
        for branch in self.branches:
            points = ", ".join(_waypoint(body, at) for body, at in branch.points)
            scene.robot.paths.append(Entry(branch.name, f"[{points}]", self.place))


@dataclass
class Tendons:
    """By name. What is of no use to the model is in neither; `refused` is what was reported."""

    fixed: dict[str, Transmission] = field(default_factory=dict[str, Transmission])
    lines: dict[str, Line] = field(default_factory=dict[str, Line])
    refused: set[str] = field(default_factory=set[str])


def tendons(reading: Reading, root: Element, scene: Scene) -> Tendons:
    """All tendons of a file, their springs and dampers written down. A spatial one that goes round
    a geom, or has an inertia or dry friction, is reported where it acts."""
    result, ends = Tendons(), list[str]()
    driven = _driven(root)
    for section in root.all("tendon"):
        for element in section.children:
            tendon = completed(reading, element, scene.settings)
            name = tendon.get("name")
            acts = [one for one in FORCES if any(listing(reading, tendon, one) or ())]
            if "range" in tendon.attributes and tendon.get("limited") != "false":
                ends.append(name or tendon.tag)
            if "actuatorfrcrange" in tendon.attributes:
                scene.clamped.append(name or tendon.tag)
            if tendon.tag == "fixed":
                result.fixed[name] = _coefficients(reading, tendon, scene)
                _check_forces(reading, tendon, acts)
                _springs_along(reading, tendon, result.fixed[name], scene)
            elif acts or name in driven:
                _check_forces(reading, tendon, acts)
                line = _line(reading, tendon, scene)
                if line is None:
                    result.refused.add(name)
                else:
                    result.lines[name] = line
                    _springs(reading, line, scene)
            elif "range" not in tendon.attributes:
                scene.robot.changed.append(
                    f"the tendon {quoted(name)} does nothing and is left out"
                )
    if ends:
        said = f"the ranges of {listed(map(quoted, ends))}, which end a motion where they are taut"
        scene.robot.left_out.append(f"of tendons, {said}")
    return result


def tension_of(law: Sequence[float], line: Line, gear: float, unit: str, scene: Scene) -> list[str]:
    """−gear · (k₀ + k₁ ℓ + k₂ dℓ/dt) with ℓ = gear · the length of the line, which a force along ℓ
    makes longer; `unit` is that of the sum, empty where its coefficients are to have none."""
    k0, k1, k2 = [*law, 0.0, 0.0, 0.0][:3]
    terms = [coefficient(-gear * k0, unit)] if k0 else []
    if k1:
        length, number = _bracketed(line.length(scene)), -(gear**2) * k1
        per = f"{unit}/m" if unit else ""
        terms.append(f"{coefficient(number, per)}*{length}" + ("" if unit else "/(1 m)"))
    if k2:
        speed, number = _bracketed(line.speed(scene)), -(gear**2) * k2
        per = f"{unit}*s/m" if unit else ""
        terms.append(f"{coefficient(number, per)}*{speed}" + ("" if unit else "/(1 m/s)"))
    return terms


def pull(reading: Reading, place: Element, line: Line, name: str, force: str, scene: Scene) -> None:
    """Write a tension by formula into every branch of a line, divided as its pulleys divide it."""
    line.length(scene)
    for branch in line.branches:
        own = reading.symbols(f"{name}_tension", "load")
        shared = force if branch.share == 1.0 else f"{written(branch.share)}*({force})"
        text = f"{{type: tension, path: {branch.name}, tension: {in_yaml(shared)}}}"
        scene.robot.loads.append(Entry(own, text, place))


def _coefficients(reading: Reading, tendon: Element, scene: Scene) -> Transmission:
    coefficients: Transmission = []
    for term in tendon.all("joint"):
        joint = joint_of(reading, term, "joint", scene)
        if joint is not None:
            coefficients.append((joint, scalar(reading, term, "coef", 1.0)))
    return coefficients


def _driven(root: Element) -> frozenset[str]:
    """Names of the tendons that actuators and equalities refer to."""
    names = [
        element.get(attribute)
        for kind in ("actuator", "equality")
        for section in root.all(kind)
        for element in section.children
        for attribute in ("tendon", "tendon1", "tendon2")
    ]
    return frozenset(filter(None, names))


def _check_forces(reading: Reading, tendon: Element, acts: Iterable[str]) -> None:
    for name in acts:
        if name in ("armature", "frictionloss"):
            expected = "tendons with stiffness or damping"
            reading.report(tendon, f"a tendon with {name}", expected, attribute=name)


def _line(reading: Reading, tendon: Element, scene: Scene) -> Line | None:
    """The line of a spatial tendon; None after reporting one that is no row of straight lines."""
    branches: list[Branch] = []
    points: list[tuple[str, Vector]] = []
    name, share = tendon.get("name") or "tendon", 1.0

    def end_branch() -> None:
        if len(points) > 1:
            own = reading.symbols(name, "path")
            branches.append(Branch(own, share, tuple(points)))
        points.clear()

    for step in tendon.children:
        if step.tag == "pulley":
            end_branch()
            divisor = scalar(reading, step, "divisor", 1.0)
            if divisor <= 0.0:
                reading.report(
                    step, "a divisor that is not positive", "one above zero", "", "divisor"
                )
                return None
            share = 1.0 / divisor
        elif step.tag == "geom":
            reading.report(step, "a tendon round a geom", "tendons through sites and pulleys")
            return None
        elif step.tag == "site" and step.get("site") not in scene.sites:
            reading.unknown(step, "site", "site", list(scene.sites))
            return None
        elif step.tag == "site":
            body, frame = scene.sites[step.get("site")]
            points.append((body, frame.at))
    if tendon.children and tendon.children[-1].tag == "pulley":
        reading.report(tendon.children[-1], "a tendon that ends with a pulley", "sites behind it")
        return None
    end_branch()
    if not branches:
        reading.report(tendon, f"the tendon {quoted(name)} has no two sites", "<site>s in a row")
        return None
    return Line(tendon, tuple(branches))


def _forces(reading: Reading, tendon: Element, scene: Scene) -> tuple[list[float], list[float]]:
    """Factors of stiffness and damping. They are zero where a flag switches them off."""
    k, d = (powers(reading, tendon, name) for name in ("stiffness", "damping"))
    off = scene.settings.off
    return NONE if "spring" in off else k, NONE if "damper" in off else d


def _springs_along(reading: Reading, tendon: Element, along: Transmission, scene: Scene) -> None:
    """Of a fixed tendon, on its joints."""
    k, d = _forces(reading, tendon, scene)
    shortest, longest = _given_rests(reading, tendon)
    if shortest == -1.0:
        shortest = longest = sum(c * scene.rests.get(joint.name, 0.0) for joint, c in along)
    name = tendon.get("name") or "tendon"
    if any(k[1:]) or any(d[1:]) or (any(k) and shortest != longest):
        length = _number_of(along, "{}", "rad", "m")
        speed = _number_of(along, "der({})", "rad/s", "m/s")
        for joint, c in along:
            unit = "N*m" if joint.type == "revolute" else "N"
            terms = _spring([-c * x for x in k], length, (shortest, longest), (unit, ""))
            terms += of_speed([-c * x for x in d], f"({speed})", unit, "")
            if terms:
                force = in_yaml(" + ".join(terms))
                load(reading, tendon, name, f"joint: {joint.name}", force, scene)
        return
    law = Law((0.0,), (k[0] * longest, -k[0], -d[0]))
    if any(law.bias):
        by_formula(reading, tendon, name, law, along, "", scene)


def _number_of(along: Transmission, shape: str, angular: str, linear: str) -> str:
    """Σ cᵢ qᵢ, or its rate, as a number: joints of both kinds can stand in it."""
    return " + ".join(
        product_of(coefficient(c, ""), shape.format(joint.name))
        + f"/(1 {angular if joint.type == 'revolute' else linear})"
        for joint, c in along
    )


def _springs(reading: Reading, line: Line, scene: Scene) -> None:
    """Of a spatial tendon, in its branches."""
    tendon = line.place
    k, d = _forces(reading, tendon, scene)
    terms: list[str] = []
    if any(k):
        terms += _spring(k, line.length(scene), _rests(reading, line, scene), ("N", "m"))
    if any(d):
        terms += of_speed(d, _bracketed(line.speed(scene)), "N", "m")
    if terms:
        name = f"{tendon.get('name') or 'tendon'}_spring"
        pull(reading, tendon, line, name, " + ".join(terms), scene)


def _spring(
    k: Sequence[float], length: str, rests: tuple[float, float], units: tuple[str, str]
) -> list[str]:
    """What a spring pulls that is slack between two lengths; `units` are those of force and
    length."""
    (shortest, longest), (force, unit) = rests, units
    own = f" {unit}" if unit else ""
    low, high = (f"{written(rest)}{own}" for rest in rests)
    if shortest == longest:
        return of_length(k, f"({length} - {_in_brackets(high)})", force, unit)
    longer = f"max(0{own}, {length} - {_in_brackets(high)})"
    shorter = f"max(0{own}, {low} - {_bracketed(length)})"
    within = unit and shortest <= 0.0  # a path is never shorter than nothing
    return of_length(k, longer, force, unit) + (
        [] if within else of_length([-k[0], k[1], -k[2]], shorter, force, unit)
    )


def _in_brackets(number: str) -> str:
    return f"({number})" if number.startswith("-") else number


def _rests(reading: Reading, line: Line, scene: Scene) -> tuple[float, float]:
    """The lengths between which the spring is slack. One that says nothing is at rest where the
    springs of joints are, which is read where that is the reference configuration."""
    shortest, longest = _given_rests(reading, line.place)
    if shortest != -1.0:
        return shortest, longest
    moved = [name for name, rest in scene.rests.items() if rest != scene.references.get(name, 0.0)]
    if moved:
        problem = f"the length at rest of a tendon where joints rest elsewhere ({moved[0]})"
        reading.report(line.place, problem, 'springlength="…"')
    length = line.reference(scene)
    return length, length


def _given_rests(reading: Reading, tendon: Element) -> tuple[float, float]:
    """The lengths between which a spring is slack; −1 where the joints say them."""
    given = listing(reading, tendon, "springlength") or [-1.0]
    if len(given) > 2 or given[-1] < given[0]:
        problem = "the springlength of a tendon"
        reading.report(tendon, problem, "one length, or a shorter and a longer", "", "springlength")
    return given[0], given[-1]


def _waypoint(body: str, at: Vector) -> str:
    place = f", at: [{', '.join(map(written, at))}]" if any(at) else ""
    return f"{{body: {body}{place}}}"


def _sum(terms: Iterable[tuple[float, str]]) -> str:
    return " + ".join(text if share == 1.0 else f"{written(share)}*{text}" for share, text in terms)


def _bracketed(formula: str) -> str:
    return f"({formula})" if " + " in formula else formula
