"""schema: the JSON Schema that editors complete model files from."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from derive.model import schema

if TYPE_CHECKING:
    from rich.console import Console


def run() -> dict[str, Any]:
    return schema()


def show(record: dict[str, Any], console: Console) -> None:
    console.print(json.dumps(record, indent=2), soft_wrap=True)
