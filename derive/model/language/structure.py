"""Nodes of the file → Document: pydantic checks the shape, and its findings become messages with a
place."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from typing import Any, TypeVar

from pydantic import ValidationError

from derive.diagnostics import Diagnostic, ModelError, did_you_mean, distinct, listed
from derive.expressions.mistakes import FormulaError
from derive.expressions.quantities import unit as unit_of
from derive.model.document import (
    COMMA,
    NUMBER,
    Entries,
    Items,
    Key,
    Node,
    Scalar,
    Source,
    described,
    is_cut,
)
from derive.model.language.keys import Entry
from derive.model.language.shape import Document
from derive.model.records import Span

Shape = TypeVar("Shape", bound=Entry)
SPEED = re.compile(r"\bder\(|\w\.[vw][xyz]?\b")  # a velocity in a formula


def structured(node: Entries, source: Source) -> Document:
    """The Document of a file; ModelError with every problem of shape in it."""
    return shaped(Document, node, source)


def shaped(kind: type[Shape], node: Entries, source: Source) -> Shape:
    """A mapping as an entry of that class; ModelError with every problem of shape in it."""
    try:
        return kind.model_validate(node)
    except ValidationError as error:
        problems = [
            diagnostic
            for details in error.errors()
            for diagnostic in _diagnostics(details, node, source)
        ]
        raise ModelError(distinct(problems)) from None


def _diagnostics(details: Any, node: Entries, source: Source) -> Iterator[Diagnostic]:
    key, place = _walk(node, details["loc"])
    span = place.span if not isinstance(place, Entries | Items) or key is None else key.span
    kind, context = details["type"], details.get("ctx", {})
    if kind == "unknown_key":
        yield from _unknown_keys(place, context, source)
    elif kind == "missing":
        missing = details["loc"][-1]
        yield source.diagnostic(span, f"{_owner(key)} has no '{missing}'", f"the key '{missing}'")
    elif kind == "literal_error":
        what = (
            f"unknown {key} '{place.text}'" if isinstance(place, Scalar) else _instead(key, place)
        )
        yield source.diagnostic(place.span, what, context["expected"].replace("'", ""))
    elif kind == "union_tag_invalid":
        yield _wrong_type(place, context, span, source)
    elif kind == "union_tag_not_found":
        yield _not_one_of(key, place, details, span, source)
    elif kind == "not_a_mapping":
        unit = isinstance(place, Scalar) and details["loc"][0] == "inputs" and _is_unit(place.text)
        text = place.text if isinstance(place, Scalar) else ""
        hint = f"its unit alone is {{unit: {text}}}" if unit else ""
        if details["loc"][0] == "bodies" and len(details["loc"]) == 2 and text:
            hint = f"{key}: {{mass: {text}}} for a point mass"
        expected = f"a mapping with {listed(context['keys'])}"
        if details["loc"][0] in _SECTIONS and len(details["loc"]) == 3:
            expected = f"a mapping with {_SECTIONS[details['loc'][0]]}"
            hint = _as_entry(details["loc"][0], key, text)
        yield source.diagnostic(place.span, _instead(key, place), expected, hint)
    elif kind == "not_a_list" and isinstance(details["loc"][-1], int):
        yield source.diagnostic(
            place.span,
            f"{described(place)} in the list under '{key}'",
            "points in [ ], as in [[…], […]]",
        )
    else:
        expected = _EXPECTED.get(kind, str(details["msg"]))
        hint = _as_it_should_be(kind, details["loc"][0], key, place)
        if details["loc"][0] == "forces" and isinstance(place, Entries):
            expected = (
                "a formula for each coordinate; springs, dampers, forces and torques with a type "
                "stand under `loads:`"
            )
        if kind == "not_a_list" and key == "gravity":
            expected += " of its components: [0, 0, -9.81], or [0, -9.81] in a plane"
            hint = _downwards(place, node) or hint
        yield source.diagnostic(place.span, _instead(key, place), expected, hint)


def _as_entry(section: str, key: Key | None, formula: str) -> str:
    """A formula alone as a constraint or load that it may be meant for."""
    if not formula:
        return ""
    if section == "loads":
        return f"{key}: {{type: expression, joint: …, expression: {formula}}}"
    word = "nonholonomic" if SPEED.search(formula) else "holonomic"
    return f"{key}: {{{word}: {formula}}}"


def _as_it_should_be(kind: str, section: str, key: Key | None, found: Node) -> str:
    """What stands there, in the form that was expected, where it is plain which that is."""
    match found:
        case Scalar(text=text) if kind == "not_a_list" and _is_list(text, key):
            return f"in brackets: {key}: [{text}]"
        case Entries() if any(name.count(")") > name.count("(") for name in found):
            return COMMA
        case Entries() if kind == "not_a_list" and found and set(found) <= {"x", "y", "z"}:
            values = [found[name] for name in sorted(found)]
            if all(isinstance(value, Scalar) for value in values):
                return f"in brackets: {key}: [{', '.join(value.text for value in values)}]"
        case Entries() if kind == "is_instance_of" and len(found) == 1:
            (value,) = found.values()
            if isinstance(value, Scalar):
                return f"its value alone: {key}: {value.text}"
        case Scalar() if kind == "dict_type" and section == "steady_motion":
            return f"motions have names: steady_motion: {{a_name: {{{key}: {found.text}, …}}}}"
        case Items() if kind == "dict_type":
            return f"each with a name of its own: {key}: {{a_name: …, another: …}}"
        case _:
            pass
    return ""


def _is_list(text: str, key: Key | None) -> bool:
    """Whether brackets alone are missing: a single number is no vector with them either."""
    return bool(text) and not set(text) & set("[]{}") and ("," in text or key == "coordinates")


def _downwards(given: Node, model: Entries) -> str:
    """Gravity as a vector, where the file has its size alone."""
    if not isinstance(given, Scalar) or not NUMBER.match(given.text) or "," in given.text:
        return ""
    zeros = "0, " if "plane" in model else "0, 0, "
    return f"downwards: gravity: [{zeros}-{given.text.lstrip('+-')}]"


_EXPECTED: dict[str, str] = {
    "is_instance_of": "a text or a number",
    "dict_type": "a mapping",
    "not_a_list": "a list in [ ]",
    "list_type": "a list in [ ]",
    "too_short": "two points, [[…], […]]",
    "too_long": "two points, [[…], […]]",
}


def _is_unit(text: str) -> bool:
    try:
        unit_of(text)
    except FormulaError:
        return False
    return bool(text)


def _walk(node: Node, loc: tuple[Any, ...]) -> tuple[Key | None, Any]:
    """The key nearest to the place, and what stands there; steps that are tags of pydantic unions
    are passed over."""
    key, part = None, node
    for step in loc:
        if isinstance(part, Entries) and step in part:
            key, part = part.key(step), part[step]
        elif isinstance(part, Items) and isinstance(step, int) and step < len(part):
            part = part[step]
    return key, part


def _owner(key: Key | None) -> str:
    return f"'{key}'" if key is not None else "the model"


def _instead(key: Key | None, found: Node) -> str:
    return (
        f"{described(found)} under '{key}'"
        if key is not None
        else f"{described(found)} as the model"
    )


def _unknown_keys(found: Any, context: dict[str, Any], source: Source) -> Iterator[Diagnostic]:
    for name in context["unknown"]:
        span = found.key(name).span
        yield source.diagnostic(
            span,
            f"unknown key '{name}'",
            listed(context["keys"], 24),
            COMMA if _is_rest(found, name) else _near_key(name, context["keys"]),
        )


def _is_rest(found: Entries, name: str) -> bool:
    """Whether a key without a value is what a comma cut off: the 2 of {tension: max(1, 2, q)}."""
    value = found[name]
    empty = isinstance(value, Scalar) and value.plain and not value.text
    return empty and any(is_cut(other) for other in found.values())


# what other tools and textbooks call a key of ours
_OTHER_WORDS = {
    "force": ("components",),
    "torque": ("components",),
    "moment": ("components",),
    "vector": ("components",),
    "value": ("components",),
    "point": ("at",),
    "position": ("at",),
    "k": ("stiffness",),
    "c": ("coefficient",),
    "damping": ("coefficient",),
    "bodies": ("between",),
    "from": ("parent", "between"),
    "to": ("child", "between"),
    "length": ("rest",),
    "rest": ("length",),
    "formula": ("expression",),
    "law": ("expression",),
    **dict.fromkeys(("springs", "dampers", "contacts", "friction", "elements"), ("loads",)),
    **dict.fromkeys(("actuators", "motors", "control", "controls"), ("inputs",)),
    **dict.fromkeys(("masses", "particles", "links"), ("bodies",)),
    **dict.fromkeys(("gears", "belts", "couplings", "rolling"), ("constraints",)),
    **dict.fromkeys(("tendons", "ropes", "cables"), ("paths",)),
    **dict.fromkeys(("sensors", "measurements"), ("outputs",)),
    **dict.fromkeys(("speeds", "pseudo_velocities", "quasi_coordinates"), ("quasi_velocities",)),
    **dict.fromkeys(("variables", "dofs", "degrees_of_freedom"), ("coordinates",)),
    "loops": ("closures",),
    "contact": ("loads",),
    "name": ("model",),
    "title": ("model",),
}


_IN_JOINT = (
    "along or about a joint: {type: expression, joint: …, expression: …}, or under `inputs:` where "
    "it is commanded"
)
# what stands elsewhere: the key, one that is known beside it, and where it stands
_ELSEWHERE = {
    "initial": {"child": "initial values stand under `initial:` of the model, by coordinate"},
    "radius": {"shape": "a radius is one of the shape: shape: {wheel: {radius: …}}, disk, sphere"},
    "mass": {"child": "masses stand in `bodies:`"},
    "inertia": {"child": "inertias stand in `bodies:`; that of a motor is `armature`"},
    "gravity": {"mass": "gravity stands at the top of the file"},
    "coordinate": {"mass": "coordinates are named by joints", "components": _IN_JOINT},
    "joint": {"components": _IN_JOINT},
}


def _near_key(name: str, keys: Collection[str]) -> str:
    if name.count(")") > name.count("("):  # the rest of {tension: max(a, b)}
        return COMMA
    word, colon, _ = name.partition(":")
    if colon and word in keys:
        return f"a blank stands behind the colon: {word}: …"
    for beside, hint in _ELSEWHERE.get(name, {}).items():
        if beside in keys:
            return hint
    others = [word for word in _OTHER_WORDS.get(name, ()) if word in keys]
    return f"did you mean '{others[0]}'?" if others else did_you_mean(name, keys)


def _tags(context: dict[str, Any]) -> list[str]:
    return [tag.strip("'<> ") for tag in context["expected_tags"].split(", ")]


def _wrong_type(found: Any, context: dict[str, Any], span: Span, source: Source) -> Diagnostic:
    known = _tags(context)
    word = found.get("type") if isinstance(found, Entries) else None
    if not isinstance(word, Scalar):
        return source.diagnostic(span, f"{described(found)} here", listed(known))
    return source.diagnostic(
        word.span, f"unknown type '{word.text}'", listed(known), did_you_mean(word.text, known)
    )


_SECTIONS = {
    "constraints": "holonomic:, nonholonomic:, type: no_slip, rolling, distance, gear …",
    "loads": "type: spring, damper, force …",
}
_PLACES = {
    "at": "a point [ ], two of them, or a mapping",
    "parent": "a point [ ] or a mapping with position and rpy",
    "child": "a point [ ] or a mapping with position and rpy",
    "inertia": "a formula, a list, or a mapping with tensor, about and frame",
    "orientation": "quaternion, or a mapping with euler and angles",
    "parameters": "a number with its unit, such as 0.2 m",
    "coordinates": "a unit, such as m or rad",
    "quasi_velocities": "a list or mapping of formulas, or auto, orthonormal, frozen, "
    "mass_orthogonal",
    "initial": "a number, or a mapping under `guess`",
}


def _not_one_of(
    key: Key | None, found: Any, details: Any, span: Span, source: Source
) -> Diagnostic:
    section, last = details["loc"][0], details["loc"][-1]
    if isinstance(last, int):
        return source.diagnostic(
            found.span,
            f"{described(found)} in the list under '{key}'",
            "points in [ ], as in [[…], […]]",
        )
    if section in _SECTIONS and isinstance(found, Entries):
        return source.diagnostic(span, f"{_owner(key)} does not say what it is", _SECTIONS[section])
    expected = _PLACES.get(section) or _PLACES.get(last, "a formula or a list")
    return source.diagnostic(found.span, _instead(key, found), expected)
