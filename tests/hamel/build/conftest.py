"""An own store for every test of this room, and a module that is compiled once."""

from __future__ import annotations

from pathlib import Path

import pytest

from codegen import compiler
from codegen.passes import program
from codegen.program import Program
from tests.toy import toy


@pytest.fixture(autouse=True)
def own_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("CC", raising=False)
    return tmp_path / "cache" / "hamel"


@pytest.fixture(scope="session")
def small() -> Program:
    return program(toy(), ["dynamics", "energy"])


@pytest.fixture
def script(tmp_path: Path):
    """A compiler that is a shell script: its path."""

    def made(text: str, name: str = "cc") -> str:
        place = tmp_path / "bin" / name
        place.parent.mkdir(exist_ok=True)
        place.write_text(f"#!/bin/sh\n{text}\n")
        place.chmod(0o755)
        return str(place)

    return made


needs_compiler = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
