"""schema: the JSON Schema that editors complete model files from."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from derive.joints import JOINTS
from derive.model.schema import json_schema

if TYPE_CHECKING:
    from rich.console import Console


def run() -> dict[str, Any]:
    return json_schema(tuple(joint.name for joint in JOINTS))


def show(record: dict[str, Any], console: Console) -> None:
    console.print(json.dumps(record, indent=2), soft_wrap=True)
