"""A model as a part of another: its names get a prefix, its parameters values, its ground a body.

Names are found by the grammar of formulas, so that the m of `2 N*m` stays a unit.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache

from derive.expressions import tree
from derive.expressions.evaluate import is_constant
from derive.expressions.functions import FUNCTIONS, KINEMATIC_FUNCTIONS, OUTPUT_FUNCTIONS
from derive.expressions.mistakes import FormulaError
from derive.expressions.parser import expression
from derive.expressions.quantities import quantity
from derive.joints import JOINTS
from derive.model.composing.composition import SubmodelEntry
from derive.model.composing.grounded import ALONG_AXES, COMPONENTS, grounded, unsaid
from derive.model.composing.repetition import WORDS, with_called
from derive.model.document import Entries, Items, Key, Node, Scalar, Source, check_commas
from derive.model.motion.delays import late
from derive.model.records import GROUND, Span

# sections whose keys are names, and that a part brings along
SECTIONS = (
    "parameters", "where", "tables", "bodies", "joints", "closures", "frames", "paths",
    "constraints",
    "loads", "inputs", "states", "outputs", "events",
)  # fmt: skip
# what a whole says for all its parts
OF_THE_WHOLE = frozenset(
    {
        *("model", "description", "plane", "gravity", "redundant", "quasi_velocities"),
        *("steady_motion", "reference", "extremes"),
    }
)
# what has no parts, and why a file with it is none
WHOLE_ONLY = ("coordinates", "kinetic", "potential", "forces")
# keys whose values are words, and no formulas
PLAIN = WORDS | {"units", "symbol", "side", "stop", "physical", "orientation"}
# keys under which a letter is an axis, and one that has it in a list
LETTERED = frozenset({"axis_angle"})
LETTERS = frozenset({"axis", "axis2", "direction", "normal"})
COORDINATES = ("coordinate", "coordinates", "position", "angles", "quaternion")
_AXIS = re.compile(r"\s*[+-]?[xyz]\s*\Z")
_SUFFIXES = tuple(
    dict.fromkeys(slot.suffix for joint in JOINTS for slot in joint.coordinates if slot.suffix)
)
_CALLS = {**FUNCTIONS, **OUTPUT_FUNCTIONS, **KINEMATIC_FUNCTIONS}


def sections_of_names(node: Entries) -> dict[str, str]:
    """Every name that the entries of a model introduce → the first section that it comes from."""
    found: dict[str, str] = {}
    for name, section in _named(node):
        found.setdefault(name, section)
    return found


def _named(node: Entries) -> Iterator[tuple[str, str]]:
    for section in (*SECTIONS, "coordinates"):
        yield from ((str(key), section) for key in _entries(node, section))
    for key, entry in _entries(node, "inputs").items():
        if isinstance(entry, Entries) and "delay" in entry:
            yield late(str(key)), "inputs"
    for key, joint in _entries(node, "joints").items():
        yield from ((f"{key}_{suffix}", "joints") for suffix in _SUFFIXES)
        if isinstance(joint, Entries):
            yield from ((name, "joints") for name in _coordinates(joint))


def _entries(node: Entries, section: str) -> Entries:
    given = node.get(section)
    return given if isinstance(given, Entries) else Entries({}, node.span)


def _coordinates(joint: Entries) -> Iterator[str]:
    turned = joint.get("orientation")
    places = (joint, turned) if isinstance(turned, Entries) else (joint,)
    for place in places:
        for key in COORDINATES:
            given = place.get(key)
            names = given if isinstance(given, Items) else [given]
            yield from (name.text for name in names if isinstance(name, Scalar))


def with_parameters(node: Entries, key: Key, entry: SubmodelEntry) -> Entries:
    """The part with the values that the whole gives to its parameters, where they are numbers."""
    section = _entries(node, "parameters")
    numbers = {name: value for name, value in entry.parameters.items() if _is_number(value.text)}
    remaining = {
        section.key(name): entry.parameters[section.key(name)] if name in numbers else value
        for name, value in section.items()
        if name in numbers or name not in entry.parameters
    }
    return Entries({**node, **_section("parameters", remaining, node)}, node.span)


def _section(name: str, entries: Mapping[Key, Node], node: Entries) -> dict[Key, Node]:
    key = node.key(name) if name in node else Key(name, node.span)
    return {key: Entries(entries, node.span)} if entries or name in node else {}


def _is_number(text: str) -> bool:
    if quantity(text) is not None:
        return True
    try:
        return is_constant(expression(text))
    except FormulaError:
        return False


def as_part(node: Entries, key: Key, entry: SubmodelEntry, source: Source) -> Entries:
    """The entries of a part under the names they have in the whole."""
    for section in WHOLE_ONLY:
        if section in node:
            source.refuse(
                node.key(section).span,
                f"'{section}' in a submodel",
                "bodies, joints and loads; energies by formula go into the model itself",
            )
    _check_start(node, source)
    formulas = {k: v for k, v in entry.parameters.items() if not _is_number(v.text)}
    names = {name: f"{key}_{name}" for name in sections_of_names(node)}
    names |= {str(name): f"{key}_{name}" for name in formulas}
    names |= {str(k): v.text.strip() for k, v in formulas.items() if _is_name(v.text)}
    names[GROUND] = _ground(key, entry)
    at = entry.ground.span if isinstance(entry.ground, Scalar) else None
    part = _Renaming(names, source, at).part(_on(names[GROUND], node, source))
    defined = {
        Key(f"{key}_{name}", name.span): value
        for name, value in formulas.items()
        if not _is_name(value.text)
    }
    own = _entries(part, "where")
    where: dict[Key, Node] = {**{own.key(name): value for name, value in own.items()}, **defined}
    part = Entries({**part, **_section("where", where, part)}, part.span)
    return part if not _mounted(entry) else merged(part, _mount(key, entry, part), source)


def _on(ground: str, node: Entries, source: Source) -> Entries:
    """The part with all that it says of its ground, where that is a body of the whole."""
    return node if ground == GROUND else grounded(node, source)


def _check_start(node: Entries, source: Source) -> None:
    """Refuse initial values of quasi-velocities, which the part leaves behind."""
    choices = _entries(node, "quasi_velocities")
    rows = {key: given for key, given in choices.items() if isinstance(given, Entries)}
    named = {str(row) for given in rows.values() for row in given}
    named |= {f"{key}.{row}" for key, given in rows.items() for row in given}
    start = _entries(node, "initial")
    for part in (start, _entries(start, "guess")):
        for name in map(str, part):
            if name in named:
                source.refuse(
                    part.key(name).span,
                    f"the initial value of the quasi-velocity '{name}' in a submodel",
                    "velocities or der(q) in its place: a part brings no choices along",
                )


def _is_name(text: str) -> bool:
    return re.fullmatch(r"\s*[A-Za-z]\w*\s*", text) is not None


def _mounted(entry: SubmodelEntry) -> bool:
    return entry.ground is not None and not isinstance(entry.ground, Scalar)


def _ground(key: Key, entry: SubmodelEntry) -> str:
    if entry.ground is None:
        return GROUND
    return entry.ground.text if isinstance(entry.ground, Scalar) else f"{key}_{GROUND}"


def _mount(key: Key, entry: SubmodelEntry, part: Entries) -> Entries:
    """A body without mass where the part's ground is, fixed to what carries it, by a joint with a
    name that nothing in the part has."""
    frame = entry.ground
    assert frame is not None and not isinstance(frame, Scalar)
    span = frame.body.span
    turned = {
        Key(name, span): given
        for name in ("position", "angle", "rpy", "axis_angle", "matrix")
        if (given := getattr(frame, name)) is not None
    }

    def word(text: str) -> Scalar:
        return Scalar(text, span, False, True)

    def mapping(**entries: Node) -> Entries:
        return Entries({Key(name, span): given for name, given in entries.items()}, span)

    at = mapping(parent=Entries(turned, span))
    name = _ground(key, entry)
    joint = mapping(type=word("fixed"), parent=frame.body, child=word(name), at=at)
    bodies = Entries({Key(name, span): mapping(mass=word("0"))}, span)
    taken = sections_of_names(part)
    wanted = (f"{key}_mount{number}" for number in ("", *range(2, len(taken) + 3)))
    free = next(name for name in wanted if name not in taken)
    return mapping(bodies=bodies, joints=Entries({Key(free, span): joint}, span))


def merged(whole: Entries, part: Entries, source: Source) -> Entries:
    """The entries of both; ModelError where both have one of the same name. What the whole says of
    the initial state goes before what the part says."""
    out: dict[Key, Node] = {whole.key(name): value for name, value in whole.items()}
    for key, given in part.items():
        assert isinstance(key, Key)
        if key in OF_THE_WHOLE:
            continue
        own = whole.get(key)
        if key == "initial" and isinstance(own, Entries) and isinstance(given, Entries):
            given = _initial(own, given)
        elif isinstance(own, Entries) and isinstance(given, Entries):
            given = _both(own, given, source)
        out[whole.key(key) if key in whole else key] = given
    return Entries(out, whole.span)


def _both(own: Entries, given: Entries, source: Source) -> Entries:
    for key in own:
        if key in given:
            place, other = own.key(key).span, given.key(key).span
            source.refuse(
                replace(place, where=place.where or other.where),
                f"'{key}' is given twice: a part has this name too",
                "another name",
            )
    return Entries({**own, **given}, own.span)


def _initial(own: Entries, given: Entries) -> Entries:
    guesses = _entries(own, "guess")
    said = {str(key) for key in (*own, *guesses)}
    held = {key: value for key, value in given.items() if key not in said and key != "guess"}
    moving = {key: value for key, value in _entries(given, "guess").items() if key not in said}
    entries = {**own, **held}
    key = own.key("guess") if "guess" in own else Key("guess", own.span)
    return Entries(
        {
            **entries,
            **({key: Entries({**guesses, **moving}, own.span)} if guesses or moving else {}),
        },
        own.span,
    )


class _Renaming:
    """Replaces names in keys and formulas; `names`: the part's → the whole's; `ground`: where the
    whole says what the part's ground is, which is told where it is nothing."""

    def __init__(self, names: Mapping[str, str], source: Source, ground: Span | None) -> None:
        self.names, self.source, self.ground = names, source, ground
        self.known = frozenset(names) - {GROUND}

    def part(self, node: Entries) -> Entries:
        """All sections that a part brings along."""
        sections = {key: self._section(key, given) for key, given in node.items()}
        return Entries({k: v for k, v in sections.items() if k not in OF_THE_WHOLE}, node.span)

    def _section(self, key: str, given: Node) -> Node:
        if not isinstance(given, Entries) or key in OF_THE_WHOLE:
            return given
        return self._by_name(given, nested=key == "initial")

    def _by_name(self, node: Entries, nested: bool = False) -> Entries:
        """A mapping whose keys are names; under `guess` are more of them."""
        out: dict[Key, Node] = {}
        for key, value in node.items():
            if nested and key == "guess" and isinstance(value, Entries):
                out[node.key(key)] = self._by_name(value)
            else:
                place = node.key(key).span
                said = Scalar(str(key), place, False, True)
                out[Key(self._text(said), place)] = self._value(value, "")
        return Entries(out, node.span)

    def _value(self, node: Node, key: str) -> Node:
        if isinstance(node, Scalar):
            return self._scalar(node, key)
        if isinstance(node, Items):
            of_words = key if key in PLAIN or key in LETTERED else ""
            return Items([self._value(entry, of_words) for entry in node], node.span)
        if key == "nonideal":
            return self._by_name(node)
        kept = _words(node)
        entries = {k: v if k in kept else self._value(v, k) for k, v in node.items()}
        return Entries(entries, node.span)

    def _scalar(self, node: Scalar, key: str) -> Scalar:
        if node.text == GROUND and self.ground is not None:
            return replace(node, text=self.names[GROUND], span=self.ground, exact=False)
        if key in PLAIN or (key in LETTERS | LETTERED and _AXIS.match(node.text)):
            return node
        # in the formula of a surface the letters are its own
        text = self._text(node, frozenset("xyz") if key == "surface" else frozenset())
        return node if text == node.text else replace(node, text=text, exact=False)

    def _text(self, node: Scalar, own: frozenset[str] = frozenset()) -> str:
        text = node.text
        try:
            places = _places(text, self.known - own)
        except FormulaError as error:
            check_commas(self.source, [node])
            message, expected, hint = error.detail
            self.source.refuse(node.at(error.at, error.length), message, expected, hint)
        seen_from = f", {self.names[GROUND]}" if self.names[GROUND] != GROUND else ""
        for at, name in places:
            text = f"{text[:at]}{self.names.get(name, seen_from)}{text[at + len(name) :]}"
        return text


def _words(node: Entries) -> frozenset[str]:
    """Keys of an entry under which it has a word, and no name: `frame: body` of a force."""
    if "formula" in node:
        return frozenset({"direction"})  # of an event
    kind = node.get("type")
    key = COMPONENTS.get(kind.text, "") if isinstance(kind, Scalar) else ""
    given = node.get(key)
    is_word = isinstance(given, Scalar) and given.text in ("body", "frame")
    return frozenset({key}) if is_word else frozenset()


@lru_cache(1 << 14)
def _places(text: str, known: frozenset[str]) -> tuple[tuple[int, str], ...]:
    """Where names of the part stand in a formula, and without a name where its ground is left out;
    the last first."""
    if quantity(text) is not None:
        return ()
    formula = expression(text, names=known, functions=with_called(text, _CALLS), vectors=True)
    names: dict[int, str] = {}
    letters = {
        node.arguments[1].at
        for node in tree.walk(formula)
        if isinstance(node, tree.Call) and node.function in ALONG_AXES and node.arguments[1:]
    }
    for node in tree.walk(formula):
        if isinstance(node, tree.Name) and node.at in letters and node.name in tuple("xyz"):
            continue
        if isinstance(node, tree.Rate):
            names[text.index(node.name, node.at + 3)] = node.name.partition(".")[0]
        elif isinstance(node, tree.Call):
            names[node.at] = node.function
        elif isinstance(node, tree.Name):
            first, _, rest = node.name.partition(".")
            if first == "reaction" and rest:
                names[node.at + len("reaction.")] = rest.split(".")[0]
            else:
                names[node.at] = first
    mine = [(at, name) for at, name in names.items() if name in known or name == GROUND]
    return tuple(sorted([*mine, *((at, "") for at in unsaid(text, formula))], reverse=True))
