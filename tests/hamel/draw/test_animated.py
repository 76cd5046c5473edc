"""A motion as one picture: what moves has its points at every time, what stands has none, the bytes
are the same every time, and a mechanism in space is refused.

Of hamel.draw.mechanism: animated, typeset.
"""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from derive.diagnostics import AssumptionError
from derive.model import load
from derive.states import system
from derive.states.initial import initial_state
from hamel.draw.mechanism.animated import RATE, animated
from hamel.draw.mechanism.typeset import runs
from hamel.simulate.files import check_page
from tests.scenes import MODELS

SVG = "{http://www.w3.org/2000/svg}"


def picture(name: str, seconds: float) -> str:
    mechanics = system(load(MODELS / f"{name}.yaml"))
    t = np.linspace(0.0, seconds, 50)
    start = initial_state(mechanics).q
    q = start + 0.5 * np.sin(t)[:, None]
    return animated(mechanics, t, q, np.array(mechanics.own_parameters))


def test_what_moves_has_its_points_at_every_time() -> None:
    text = picture("double_pendulum", 5.0)
    root = ElementTree.fromstring(text)
    moving = root.findall(f".//{SVG}animate")
    assert moving and {x.get("dur") for x in moving} == {"5s"}
    counts = {len(x.get("values", "").split(";")) for x in moving}
    assert counts == {5 * RATE + 1}
    for element in root.iter():
        for animation in element.findall(f"{SVG}animate"):
            name = animation.get("attributeName", "")
            assert animation.get("values", "").split(";")[0] == element.get(name)
    hatched = [x for x in root.iter() if x.get("class") == "line hatch"]
    assert hatched and not any(list(x) for x in hatched)
    assert "<script" not in text and not re.search(r"nan|inf", text)


def test_a_short_motion_is_shown_slower_and_the_bytes_are_the_same() -> None:
    text = picture("four_bar", 0.5)
    assert 'dur="3s"' in text and text == picture("four_bar", 0.5)


def test_a_mechanism_in_space_is_refused() -> None:
    with pytest.raises(AssumptionError, match="moves in space"):
        picture("rolling_disk", 1.0)


def test_where_a_motion_can_be_shown() -> None:
    check_page("a.html")
    check_page("a.svg")
    with pytest.raises(Exception, match=r"must end in \.html or \.svg"):
        check_page("a.png")


def test_a_thin_space_is_a_space() -> None:
    assert [x.text for x in runs(r"\mathrm{rear\,spin}")] == ["rear spin"]
