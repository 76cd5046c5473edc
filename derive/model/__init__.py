"""The model language: YAML text → Model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from derive.joints import CLOSURES, JOINTS
from derive.model.build import built
from derive.model.document import LARGEST, Source, content, decoded, parsed
from derive.model.kinds import KINDS
from derive.model.records import Model
from derive.model.shape import json_schema
from derive.model.structure import structured

__all__ = ["KINDS", "Model", "load", "load_text", "schema"]


def load(path: str | Path) -> Model:
    """The Model of a file; ModelError with file, line and column of everything wrong with it."""
    return load_text(decoded(content(path, LARGEST), str(path)), str(path))


def load_text(text: str, file: str = "<text>") -> Model:
    """The same for text in memory; `file` is its name in messages."""
    source = Source(text, file)
    return built(structured(parsed(source), source), source)


def schema() -> dict[str, Any]:
    """JSON Schema of a model file, for editors."""
    return json_schema(tuple(joint.name for joint in JOINTS), CLOSURES)
