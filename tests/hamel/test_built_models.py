"""A model made in Python stands wherever the path of a file does, and so does any path.

Of hamel: api.
"""

from pathlib import Path

import pytest

import hamel


def arm() -> hamel.Model:
    model = hamel.Model("arm", plane="xy", gravity=[0, "-9.81 m/s^2"])
    model.parameter("l", "0.4 m")
    model.body("link", mass="2 kg", com=["l/2", 0], inertia="2 kg*l^2/12")
    model.joint("A", type="revolute", parent="ground", child="link", coordinate="q")
    model.add("initial", "q", "30 deg")
    return model.add("extremes", "auto", {"about": "a swing", "time": "0.5 s"})


class Place:
    def __init__(self, path: Path) -> None:
        self.path = path

    def __fspath__(self) -> str:
        return str(self.path)


def test_extremes_and_any_path(tmp_path: Path) -> None:
    file = arm().write(tmp_path / "arm.yaml")
    (here,) = hamel.extremes(arm()).rows
    (there,) = hamel.extremes([Place(file)]).rows
    assert here.outcome == there.outcome == "survived"
    assert hamel.check(Place(file)).model == "arm"


@pytest.mark.slow
def test_reports_and_books(tmp_path: Path) -> None:
    report = hamel.report(arm(), out=tmp_path / "report", time=0.3, budget=20)
    assert {row["model"] for row in report.rows} == {"arm"}
    other = arm()
    other._entries["model"] = "other"
    book = hamel.book([arm(), other], out=tmp_path / "book", pdf=False)
    assert sorted(book.chapters) == ["arm", "other"] and not book.refused


def test_words_are_lists_of_one(tmp_path: Path) -> None:
    model = tmp_path / "arm.yaml"
    arm().write(model)
    assert hamel.derive(model, out=tmp_path, road="block_inversion").html.is_file()
    with pytest.raises(hamel.HamelError, match="roll is 'alwys'"):
        hamel.build(model, out=tmp_path / "arm", roll="alwys")
    assert not (tmp_path / "arm").exists()
