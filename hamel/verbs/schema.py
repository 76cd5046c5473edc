"""schema: the JSON Schema that editors complete model files from, and the language reference."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from derive.model import schema
from derive.model.language import reference

if TYPE_CHECKING:
    from rich.console import Console


def run(page: bool) -> dict[str, Any] | str:
    """The JSON Schema of model files, or the page; both made from the records that read them."""
    return reference.page() if page else schema()


def show(record: dict[str, Any] | str, console: Console) -> None:
    """The schema as indented JSON, or the page, whatever the width of the terminal."""
    text = record if isinstance(record, str) else json.dumps(record, indent=2)
    console.print(text, soft_wrap=True, markup=False, highlight=False, emoji=False)
