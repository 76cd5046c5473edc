"""The store: what comes out is what was put in, or nothing."""

from __future__ import annotations

import os
import random
import shutil
import time
from pathlib import Path

import pytest

from hamel.build import store
from hamel.build.limits import DAY

ENTRY = store.Entry({"a.so": bytes(range(256)), "b/c.txt": b"text"}, {"model": "m", "n": [1, 2.5]})
KEYS = ("a" * 64, "b" * 64)


@pytest.fixture
def filled(own_store: Path) -> Path:
    store.put("kind", KEYS[0], ENTRY)
    store.put("kind", KEYS[1], store.Entry({"a.so": b"other"}))
    return own_store


def test_what_was_put_comes_out(filled: Path) -> None:
    assert store.stored("kind", KEYS[0]) == ENTRY
    assert store.stored("kind", "c" * 64) is None and store.stored("kind", None) is None
    assert store.stored("other", KEYS[0]) is None
    assert all(name.startswith("kind-") for name in os.listdir(filled))


def files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def flip(path: Path, rng: random.Random) -> None:
    content = bytearray(path.read_bytes())
    content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
    path.write_bytes(content)


def truncate(path: Path, rng: random.Random) -> None:
    path.write_bytes(path.read_bytes()[: rng.randrange(path.stat().st_size)])


def remove(path: Path, rng: random.Random) -> None:
    path.unlink()


def longer(path: Path, rng: random.Random) -> None:
    path.write_bytes(path.read_bytes() + b"x")


@pytest.mark.parametrize("harm", [flip, truncate, remove, longer])
@pytest.mark.parametrize("seed", range(10))
def test_no_harm_comes_out(filled: Path, harm, seed: int) -> None:
    """Whatever happened to a file, the entry is gone, or says what it said."""
    rng = random.Random(seed)
    harm(rng.choice(files(filled / f"kind-{KEYS[0][:40]}")), rng)
    assert store.stored("kind", KEYS[0]) in (None, ENTRY)
    assert store.stored("kind", KEYS[1]) is not None
    store.put("kind", KEYS[0], ENTRY)
    assert store.stored("kind", KEYS[0]) == ENTRY


def test_swapped_entries_are_not_taken_for_each_other(filled: Path) -> None:
    first, second = (filled / f"kind-{key[:40]}" for key in KEYS)
    shutil.move(first, filled / "aside")
    shutil.move(second, first)
    shutil.move(filled / "aside", second)
    assert store.stored("kind", KEYS[0]) is None and store.stored("kind", KEYS[1]) is None


def test_a_file_of_another_entry_is_seen(filled: Path) -> None:
    first, second = (filled / f"kind-{key[:40]}" / "files" / "a.so" for key in KEYS)
    shutil.copy(second, first)
    assert store.stored("kind", KEYS[0]) is None


def test_without_a_seal_harm_comes_out(filled: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The tests above see something: a store that does not hash hands out what was changed."""
    monkeypatch.setattr(store, "_seal", lambda held: "same")
    monkeypatch.setattr(store.hashlib, "sha256", lambda content: Same())
    store.put("kind", "d" * 64, ENTRY)
    place = filled / f"kind-{'d' * 40}" / "files" / "a.so"
    place.write_bytes(b"harm")
    found = store.stored("kind", "d" * 64)
    assert found is not None and found.files["a.so"] == b"harm"


class Same:
    def hexdigest(self) -> str:
        return "same"


def test_lines_that_were_harmed_are_no_lines(own_store: Path) -> None:
    for name in ("one", "two", "three"):
        store.add_line("report", KEYS[0], name, {"error": 0.125, "status": None})
    place = next(own_store.glob("report-*/*"))
    lines = place.read_text().splitlines()
    place.write_text("\n".join([lines[0], lines[1].replace("0.125", "0.126"), lines[2][:-9]]))
    assert list(store.lines("report", KEYS[0])) == [("one", {"error": 0.125, "status": None})]


def test_a_store_that_cannot_be_had_costs_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    store.put("kind", KEYS[0], ENTRY)
    assert store.root() is None and store.stored("kind", KEYS[0]) is None


def test_what_is_old_or_too_much_is_dropped(tmp_path: Path) -> None:
    for name, age in (("new", 0), ("week", 7), ("month", 30), ("year", 365)):
        entry = tmp_path / name
        entry.mkdir()
        (entry / "file").write_text("x" * 1000)
        os.utime(entry, (time.time() - age * DAY,) * 2)
    store.prune(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"new", "week", "month"}
    store.prune(tmp_path, largest=2500)  # small ones stay
    assert {path.name for path in tmp_path.iterdir()} == {"new", "week", "month"}
    store.prune(tmp_path, largest=2500, small=0)
    assert {path.name for path in tmp_path.iterdir()} == {"new", "week"}
    store.prune(tmp_path, largest=0, small=0)  # another process may be using the new one
    assert {path.name for path in tmp_path.iterdir()} == {"new"}
