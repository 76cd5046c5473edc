"""The book: chapters stand in the order of their topics, what is met for the first time is said once,
links and anchors lead somewhere, and solutions are those of the module.

Of hamel.book: topics, course, chapter, exercises, writing, printing, limits.
Of hamel.verbs: book.
"""

import re
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

import hamel
from codegen import compiler
from derive.diagnostics import ModelError
from derive.model import load, load_text
from derive.states import system
from hamel.book.chapter import Chapter, Motion, objectives
from hamel.book.course import course_of
from hamel.book.exercises import Exercise, number_texts, working
from hamel.book.topics import TOPICS, things_of, topic_of
from hamel.book.writing import CONTENTS, INDEX, PRINT, pages, placed
from hamel.verbs.book import show
from tests.scenes import MODELS

PLACES = {
    "pendulum": "Energies and coordinates",
    "double_pendulum": "Open chains",
    "four_bar": "Closed loops and couplings",
    "gear_train": "Closed loops and couplings",
    "snake3": "Skates and wheels",
    "bicycle": "Rolling in space",
}


def chapter(name: str, topic: int, length: int, things: tuple[str, ...]) -> Chapter:
    """As much of one as pages read."""
    exercise = Exercise("What is w?", "It is", (("w", "1.5", "rad/s"),))
    motion = Motion(5.0, "<svg></svg>", "", 0.0, "10 steps", (("q", "1", "rad"),), (exercise,))
    derivation = '<section id="given"><h2>1. Given</h2><a href="#given">(1)</a></section>'
    return Chapter(
        name, f"A {name} <&>", topic, length, things, 1, "auto", "it is cheap",
        (("given", "Given"),), derivation, "", motion, "",
    )  # fmt: skip


BOOK = placed(
    [
        chapter("disk", 4, 10, ("free joint", "input")),
        chapter("long_arm", 1, 99, ("revolute joint", "input")),
        chapter("arm", 1, 20, ("revolute joint",)),
    ]
)


@pytest.mark.parametrize("name", PLACES)
def test_models_belong_to_their_topics(name: str) -> None:
    assert TOPICS[topic_of(load(MODELS / f"{name}.yaml"))].title == PLACES[name]


def test_things_are_named_in_words() -> None:
    assert things_of(load(MODELS / "four_bar.yaml")) == (
        "revolute joint", "revolute joint as closure", "joint damper", "input", "output",
    )  # fmt: skip
    smallest = load_text("model: smallest\ncoordinates: {q: m}\nkinetic: 1 kg*der(q)**2/2\n")
    assert things_of(smallest) == ("energies by formula",) and topic_of(smallest) == 0


def test_chapters_stand_by_topic_and_the_new_is_new_once() -> None:
    assert [(x.number, x.chapter.name) for x in BOOK] == [(1, "arm"), (2, "long_arm"), (3, "disk")]
    assert [x.new for x in BOOK] == [("revolute joint",), ("input",), ("free joint",)]
    assert BOOK[1].known == {"revolute joint": "arm"} and BOOK[2].known == {"input": "long_arm"}
    goals = objectives(BOOK[2].chapter, BOOK[2].new, BOOK[2].known)
    assert "free joint" in goals[0] and any("input" in goal for goal in goals[1:])


def test_every_link_of_the_book_leads_somewhere() -> None:
    texts = pages("A <book>", BOOK)
    assert set(texts) == {CONTENTS, INDEX, PRINT, "arm.html", "long_arm.html", "disk.html"}
    for name, text in texts.items():
        ids = re.findall(r'\bid="([^"]*)"', text)
        assert len(ids) == len(set(ids)), name
        for target in re.findall(r'href="([^"]*)"', text):
            file, _, anchor = target.partition("#")
            assert not file or file in texts, (name, target)
            assert not anchor or file or anchor in ids, (name, target)
        assert "<book>" not in text and "A disk <&>" not in text
    assert pages("A <book>", BOOK) == texts


def test_titles_are_words() -> None:
    texts = pages("Book", BOOK)
    assert "<h1>2. long arm</h1>" in texts["long_arm.html"]
    assert all(">long arm</a>" in texts[name] for name in (CONTENTS, INDEX, PRINT))
    assert "2. long arm →" in texts["arm.html"]
    assert not any("long_arm<" in text for text in texts.values())


def test_a_chapter_without_a_description_is_its_title_alone() -> None:
    alone = replace(chapter("arm", 1, 20, ()), description="")
    texts = pages("Book", placed([alone]))
    for name in (CONTENTS, PRINT):
        assert ">arm</a></li>" in texts[name]
    assert ">disk</a>: A disk &lt;&amp;&gt;</li>" in pages("Book", BOOK)[CONTENTS]


def test_a_chapter_without_a_motion_says_why() -> None:
    alone = placed(
        [replace(BOOK[0].chapter, motion=None, refusal="it comes to a singular position")]
    )
    text = pages("Book", alone)["arm.html"]
    assert "it comes to a singular position" in text and "Exercises" not in text


def test_only_what_a_chapter_has_is_an_objective() -> None:
    """Where tighter runs came to no end, it promised what accuracy costs all the same."""
    (known, unknown) = (
        replace(BOOK[0].chapter, motion=replace(BOOK[0].chapter.motion, errors=errors))
        for errors in ("<svg></svg>", "")
    )
    assert any("accuracy costs" in goal for goal in objectives(known, (), {}))
    assert not any("accuracy costs" in goal for goal in objectives(unknown, (), {}))


DRIVEN = """
model: driven
plane: xy
gravity: [0, -9.81 m/s^2]
bodies: {slide: {mass: 1 kg}, bob: {mass: 1 kg, com: [0, -1 m]}}
joints:
  s: {type: prismatic, parent: ground, child: slide, axis: x, coordinate: x}
  h: {type: revolute, parent: slide, child: bob, coordinate: qDAMPED}
constraints: {shake: {holonomic: "x - (0.1 m)*sin(t*(3 rad/s))"}}
"""


@pytest.mark.parametrize(
    ("damped", "said"),
    [
        ("", "; constraints that move did 2 J of work"),
        (
            ", damper: 0.1 N*m*s/rad",
            "; forces without potential and constraints that move did 2 J of work",
        ),
    ],
)
def test_who_works_is_said(damped: str, said: str) -> None:
    s = system(load_text(DRIVEN.replace("DAMPED", damped)))
    assert working(s, 2.0) == said


def test_numbers_of_rounding_are_zero() -> None:
    assert number_texts([1.0, -2.5, 1e-16]) == ["1", "−2.5", "0"]


def test_what_cannot_be_a_book_is_refused(tmp_path) -> None:
    twice = [MODELS / "pendulum.yaml", MODELS / "pendulum.yaml"]
    with pytest.raises(ModelError, match="two models are called 'pendulum'"):
        hamel.book(twice, out=tmp_path / "book")
    (tmp_path / "terms.yaml").write_text(
        "model: terms\ncoordinates: {q: m}\nkinetic: 1 kg*der(q)**2/2\n"
    )
    with pytest.raises(ModelError, match="no chapter can be called 'terms'"):
        hamel.book([tmp_path / "terms.yaml"], out=tmp_path / "book")
    assert not (tmp_path / "book").exists()


@pytest.mark.slow
@pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
def test_solutions_are_those_of_the_verified_module(tmp_path) -> None:
    record = hamel.book(
        [MODELS / "double_pendulum.yaml", MODELS / "four_bar.yaml"],
        out=tmp_path / "book",
        pdf=False,
    )
    assert record.chapters == ("double_pendulum", "four_bar") and not record.refused
    text = (tmp_path / "book" / "four_bar.html").read_text("utf-8")
    built = hamel.build(MODELS / "four_bar.yaml", out=tmp_path / "four_bar", choice="crank")
    module = hamel.load(built.folder)
    start = hamel.simulate(MODELS / "four_bar.yaml", time=0.01, choice="crank").motion
    x = np.array([start[name][0] for name in module.states])
    vdot = module.dynamics(0.0, x, np.zeros(1))[3]
    shown = [float(v.replace("−", "-")) for v in re.findall(r"<td>(−?[\d.e+-]+)</td>", text)]
    assert min(abs(v - vdot) for v in shown) < 1e-4
    assert all(min(abs(v - y) for v in shown) < 1e-4 for y in module.reactions(0.0, x, np.zeros(1)))
    assert not any(abs(v - (vdot + 0.01)) < 1e-4 for v in shown)


@pytest.mark.slow
@pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
def test_a_motion_that_an_event_ends_is_as_long_as_that(tmp_path) -> None:
    text = (
        "model: stone\nplane: xy\ngravity: [0, -9.81 m/s^2]\nbodies: {s: {mass: 1 kg}}\n"
        "joints: {fall: {type: point, parent: ground, child: s, coordinates: [x, y]}}\n"
        "events: {floor: {formula: y, direction: falling, stop: true}}\ninitial: {y: 1 m}\n"
        "states: {late: {rate: (u - late)/(1 s), unit: N}}\ninputs: {u: {unit: N}}\n"
    )
    (tmp_path / "stone.yaml").write_text(text)
    record = hamel.book([tmp_path / "stone.yaml"], out=tmp_path / "book", pdf=False)
    console = Console(record=True)
    show(record, console)
    assert console.export_text().startswith("1 chapter: stone\n")
    page = (tmp_path / "book" / "stone.html").read_text("utf-8")
    assert "<p>0.451524 s from the initial state" in page
    assert "the event floor ended the motion" in page
    assert "Raise the input" not in page, "u acts on no rate at the start"


@pytest.mark.slow
@pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
def test_a_motion_in_charts_with_a_frame_has_its_record() -> None:
    """Parameters go on with the frame's numbers: the record is of the equations that were
    integrated."""
    with course_of(str(MODELS / "waveboard.yaml")) as course:
        assert course.equations.charts and course.equations.frame
        assert course.record.position_violation < 1e-6
