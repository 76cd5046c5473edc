"""The model language: YAML text → Model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from derive.joints import CLOSURES, JOINTS
from derive.model.build import built
from derive.model.composing.expansion import expanded
from derive.model.document import LARGEST, Source, content, decoded, parsed
from derive.model.language.kinds import KINDS
from derive.model.language.shape import json_schema
from derive.model.language.structure import structured
from derive.model.memory import without_collections
from derive.model.records import Model

__all__ = ["KINDS", "Model", "load", "load_text", "schema"]


def load(path: str | Path) -> Model:
    """The Model of a file; ModelError with file, line and column of everything wrong with it."""
    text = decoded(content(path, LARGEST), str(path))
    return load_text(text, str(path), Path(path).parent)


def load_text(text: str, file: str = "<text>", folder: Path | None = None) -> Model:
    """The same for text in memory; `file` is its name in messages, `folder` where the files stand
    that it refers to."""
    source = Source(text, file, folder)
    with without_collections():
        return built(structured(expanded(parsed(source), source), source), source)


def schema() -> dict[str, Any]:
    """JSON Schema of a model file, for editors."""
    return json_schema(tuple(joint.name for joint in JOINTS), CLOSURES)
