"""Sentences as runs: text of our own, mathematics in it, and what is the user's."""

from __future__ import annotations

from derive.textbook import names
from derive.textbook.records import Math, Ref, Run, Runs, Text


def runs(template: str, **given: str | Math | Ref) -> Runs:
    """Text and mathematics in turn: `$…$` is our own, `{name}` is the user's text, or Math."""
    parts: list[Run] = []
    for i, part in enumerate(template.split("$")):
        parts += [Math(names.bold(part))] if i % 2 else _filled(part, given)
    return tuple(part for part in parts if part != Text(""))


def _filled(template: str, given: dict[str, str | Math | Ref]) -> list[Run]:
    """Text around {name} places."""
    runs: list[Run] = []
    for i, part in enumerate(template.replace("{", "}").split("}")):
        value = given[part] if i % 2 else part
        runs.append(Text(value) if isinstance(value, str) else value)
    return runs


def left_alone(said: Runs) -> Runs:
    """What was said before nothing is displayed: `…, with:` ends there, of a sentence `… are:`
    nothing is left."""
    last = said[-1] if said else None
    if not isinstance(last, Text) or not last.text.endswith(":"):
        return said
    if last.text.endswith((" is:", " are:")):
        alone = not any(isinstance(part, Text) and ". " in part.text for part in said)
        return () if alone else said
    return (*said[:-1], Text(f"{last.text.removesuffix(':').removesuffix(', with')}."))
