"""The model language: YAML text → Model. Nothing heavy is imported before a model is read."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from derive.model.records import Model

__all__ = ["KINDS", "Model", "load", "load_text", "schema"]

if TYPE_CHECKING:
    KINDS: tuple[
        tuple[str, str, str], ...
    ]  # (category, name, about) of every joint, closure, constraint and load


def __getattr__(name: str) -> Any:
    if name != "KINDS":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from derive.model.kinds import known

    return known()


def load(path: str | Path) -> Model:
    """The Model of a file; ModelError with file, line and column of everything wrong with it."""
    from derive.model.document import LARGEST, content, decoded

    return load_text(decoded(content(path, LARGEST), str(path)), str(path))


def load_text(text: str, file: str = "<text>") -> Model:
    """The same for text in memory; `file` is its name in messages."""
    from derive.model.build import built
    from derive.model.document import Source, parsed
    from derive.model.structure import structured

    source = Source(text, file)
    return built(structured(parsed(source), source), source)


def schema() -> dict[str, Any]:
    """JSON Schema of a model file, for editors."""
    from derive.joints import CLOSURES, JOINTS
    from derive.model.shape import json_schema

    return json_schema(tuple(joint.name for joint in JOINTS), CLOSURES)
