"""Compiled templates are stored as Python stores byte code, and never used where they are stale.

Of derive: templates.
"""

import sys
from pathlib import Path

import pytest
from jinja2 import DictLoader

from derive import templates


def rendered(folder: Path, text: str, **settings: bool) -> str:
    environment = templates.environment(DictLoader({"page": text}), folder, **settings)
    return environment.get_template("page").render(name="<b>")


@pytest.fixture(autouse=True)
def writes_byte_code(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    monkeypatch.setattr(sys, "pycache_prefix", None)


def test_byte_code_is_stored_beside_that_of_python(tmp_path: Path):
    assert rendered(tmp_path, "{{ name }}") == "<b>"
    assert len(list((tmp_path / "__pycache__").glob("*.j2c"))) == 1


def test_a_changed_template_or_setting_is_compiled_anew(tmp_path: Path):
    rendered(tmp_path, "{{ name }}")
    assert rendered(tmp_path, "{{ name }}!") == "<b>!"
    assert rendered(tmp_path, "{{ name }}!", autoescape=True) == "&lt;b&gt;!"


def test_spoiled_byte_code_is_compiled_anew(tmp_path: Path):
    rendered(tmp_path, "{{ name }}")
    [stored] = (tmp_path / "__pycache__").glob("*.j2c")
    stored.write_bytes(b"junk")
    assert rendered(tmp_path, "{{ name }}") == "<b>"


def test_nothing_is_stored_where_python_stores_nothing(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    rendered(tmp_path, "{{ name }}")
    assert not (tmp_path / "__pycache__").exists()


def test_a_folder_that_cannot_be_written_is_no_obstacle(tmp_path: Path):
    (tmp_path / "__pycache__").write_text("a file where the folder should be")
    assert rendered(tmp_path, "{{ name }}") == "<b>"
