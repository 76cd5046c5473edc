"""schema: the JSON Schema that editors complete model files from."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from derive.model import schema

if TYPE_CHECKING:
    from rich.console import Console


def run() -> dict[str, Any]:
    """The JSON Schema of model files, made from the records that read them."""
    return schema()


def show(record: dict[str, Any], console: Console) -> None:
    """The schema as indented JSON, whatever the width of the terminal."""
    console.print(json.dumps(record, indent=2), soft_wrap=True)
