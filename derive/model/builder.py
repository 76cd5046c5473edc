"""A model made in Python, entry by entry or from a dictionary. It becomes the text of a model file
and is read like any other: the same checks, the same messages, at the line of that text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from derive.diagnostics import Diagnostic, ModelError
from derive.model.document import DEEPEST, NUMBER

_PLAIN = (str, bool, int, float)


class Model:
    """A model file in the making. It stands wherever the path of a file does.

        arm = hamel.Model("arm", plane="xy", gravity=[0, "-9.81 m/s^2"])
        arm.parameter("l", "0.4 m")
        arm.body("link", mass="2 kg", com=["l/2", 0], inertia="2 kg*l^2/12")
        arm.joint("A", type="revolute", parent="ground", child="link", coordinate="q")
        hamel.build(arm)

    Entries are those of the model language: texts, numbers, lists and mappings; NumPy's numbers and
    arrays too. `folder` is where files stand that it refers to. Nothing is checked before a verb
    reads it, but that no name is given twice in a section.
    """

    def __init__(self, name: str, *, folder: str | Path | None = None, **sections: Any) -> None:
        self.name = name
        self.folder = None if folder is None else Path(folder)
        self._entries: dict[str, Any] = {"model": name, **sections}

    @classmethod
    def from_dict(cls, entries: Mapping[str, Any], *, folder: str | Path | None = None) -> Model:
        """The model that a dictionary says, with the keys of a model file."""
        model = cls(str(entries.get("model", "")), folder=folder)
        model._entries = {str(key): value for key, value in entries.items()}
        return model

    def add(self, section: str, name: str, entry: Any = None, **keys: Any) -> Model:
        """Put an entry under a name into a section such as "bodies", as a whole or by its keys.
        Raises ModelError where the section has the name already."""
        held = self._entries.setdefault(section, {})
        if not isinstance(held, Mapping):
            raise ModelError(Diagnostic(str(self), message=f"'{section}' is no mapping of names"))
        if name in held:
            message = f"'{name}' is given twice in '{section}'"
            raise ModelError(Diagnostic(str(self), message=message, expected="one of the two"))
        self._entries[section] = {**held, name: keys if entry is None else entry}
        return self

    def parameter(self, name: str, value: Any) -> Model:
        """A name for a number with its unit."""
        return self.add("parameters", name, value)

    def body(self, name: str, **keys: Any) -> Model:
        """A rigid body: mass, com, inertia."""
        return self.add("bodies", name, **keys)

    def joint(self, name: str, **keys: Any) -> Model:
        """A joint of the tree: type, parent, child, at, axis, coordinate …"""
        return self.add("joints", name, **keys)

    def closure(self, name: str, **keys: Any) -> Model:
        """A joint that closes a loop: type, between, at."""
        return self.add("closures", name, **keys)

    def constraint(self, name: str, **keys: Any) -> Model:
        """A constraint, by formula or by type."""
        return self.add("constraints", name, **keys)

    def load(self, name: str, **keys: Any) -> Model:
        """A spring, damper, force …"""
        return self.add("loads", name, **keys)

    def input(self, name: str, **keys: Any) -> Model:
        """An actuator, or a name for formulas."""
        return self.add("inputs", name, **keys)

    def state(self, name: str, **keys: Any) -> Model:
        """A first-order state: a number with a rate."""
        return self.add("states", name, **keys)

    def output(self, name: str, formula: str) -> Model:
        """A formula to be looked at."""
        return self.add("outputs", name, formula)

    def initial(self, name: str, value: Any) -> Model:
        """The value at t = 0 of a coordinate or velocity; a mapping for `guess`."""
        return self.add("initial", name, value)

    def to_dict(self) -> dict[str, Any]:
        """Its entries as texts, lists and dictionaries. Raises ModelError at what is none of them,
        or nested without end."""
        return {key: self._plain(value, 1) for key, value in self._entries.items()}

    def _plain(self, value: Any, depth: int) -> Any:
        if depth > DEEPEST:
            message, expected = "the entries are nested too deeply", f"at most {DEEPEST} levels"
            raise ModelError(Diagnostic(str(self), message=message, expected=expected))
        if hasattr(value, "tolist"):
            value = value.tolist()
        if isinstance(value, _PLAIN):
            return str(value).lower() if isinstance(value, bool) else value
        if isinstance(value, Mapping):
            return {str(key): self._plain(entry, depth + 1) for key, entry in value.items()}  # pyright: ignore[reportUnknownVariableType,reportUnknownArgumentType]
        if isinstance(value, Sequence):
            return [self._plain(entry, depth + 1) for entry in value]  # pyright: ignore[reportUnknownVariableType]
        message = f"{type(value).__name__} as an entry"
        expected = "a text, a number, a list or a mapping"
        raise ModelError(Diagnostic(str(self), message=message, expected=expected))

    def yaml(self) -> str:
        """The text of its model file."""
        return yaml.dump(
            self.to_dict(),
            Dumper=_Dumper,
            sort_keys=False,
            default_flow_style=None,
            allow_unicode=True,
            width=96,
        )

    def write(self, path: str | Path) -> Path:
        """Write its model file; the path. Raises OSError where that is not possible."""
        place = Path(path)
        place.write_text(self.yaml(), encoding="utf-8")
        return place

    def __fspath__(self) -> str:
        return f"<model {self.name}>"

    __str__ = __fspath__


class _Dumper(yaml.SafeDumper):
    """Without aliases: they are no part of the model language."""

    def ignore_aliases(self, data: Any) -> bool:
        """Of everything."""
        return True

    def represent_str(self, data: str) -> yaml.ScalarNode:
        """A text, in quotes where YAML needs them. What is a number to YAML is text of ours, and
        reads the same without."""
        if NUMBER.fullmatch(data):
            node: type[yaml.Node] = yaml.ScalarNode
            # its stub does not say what it gives
            tag: str = self.resolve(node, data, (True, False))  # pyright: ignore[reportUnknownVariableType,reportUnknownMemberType]
            return self.represent_scalar(tag, data)  # pyright: ignore[reportUnknownMemberType,reportUnknownArgumentType]
        return super().represent_str(data)


_Dumper.add_representer(str, _Dumper.represent_str)
