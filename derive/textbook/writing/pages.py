"""The page environment: every HTML page is a template over one base, with one set of colours.

Autoescape is on: what comes from a model is text, unless it is Markup of our own. Undefined names
are errors. The same data give the same bytes.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import FunctionLoader

from derive.templates import environment

BASE = "derive.textbook.writing"  # the package of base.html.j2


def rendered(template: str, **data: Any) -> str:
    """The page of a template, named "package/file": `derive.textbook.writing/page.html.j2`."""
    return _ENVIRONMENT.get_template(template).render(**data)


def _source(name: str) -> str:
    package, _, file = name.rpartition("/")
    return files(package or BASE).joinpath(file).read_text("utf-8")


_ENVIRONMENT = environment(FunctionLoader(_source), Path(__file__).parent, autoescape=True)
