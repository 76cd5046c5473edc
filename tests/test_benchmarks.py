"""What one benchmark takes from another is there: they run seldom, in environments of their own."""

import ast
from pathlib import Path

import pytest

HOME = Path(__file__).parents[1] / "benchmarks"
FILES = {
    ".".join(path.relative_to(HOME).with_suffix("").parts): path for path in HOME.rglob("*.py")
}


def names(text: str) -> set[str]:
    """Names a module has at its top."""
    found: set[str] = set()
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            found.update(alias.asname or alias.name for alias in node.names)
        else:
            found.update(each.id for each in ast.walk(node) if isinstance(each, ast.Name))
    return found


def taken(text: str) -> set[tuple[str, str]]:
    """(module, name) of what a file takes from modules of this folder."""
    tree = ast.parse(text)
    whole: dict[str, str] = {}
    found: set[tuple[str, str]] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            whole.update((alias.asname or alias.name, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module == "peers":
            modules = [(alias.asname or alias.name, f"peers.{alias.name}") for alias in node.names]
            whole.update(modules)
        elif isinstance(node, ast.ImportFrom):
            found.update((node.module or "", alias.name) for alias in node.names)
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            found.add((whole.get(node.value.id, ""), node.attr))
    return {(module, name) for module, name in found if module in FILES}


@pytest.mark.parametrize("file", sorted(FILES))
def test_what_is_taken_is_there(file: str) -> None:
    missing = {
        f"{module}.{name}"
        for module, name in taken(FILES[file].read_text("utf-8"))
        if name not in names(FILES[module].read_text("utf-8"))
    }
    assert not missing


def test_a_name_that_is_gone_is_seen() -> None:
    assert ("growth", "chain") in taken("import growth\nprint(growth.chain(3))\n")
    assert ("growth", "chain") in taken("from growth import chain\n")
    assert ("peers.augmented", "chain") in taken(
        "from peers import augmented\naugmented.chain(3)\n"
    )
