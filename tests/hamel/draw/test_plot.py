"""The line plots: well-formed, the same bytes every time, honest axes.

Of hamel.draw: axis, canvas, panels.
"""

import math
import xml.etree.ElementTree as ET

import pytest

from hamel.draw import Curve, Panel, decades, draw, linear, logarithmic

X = [0.01 * k for k in range(301)]


def drawn(*panels: Panel) -> ET.Element:
    text = draw("a <b> & c", "t (s)", X, panels)
    assert text == draw("a <b> & c", "t (s)", X, panels)
    return ET.fromstring(text)


def lines(root: ET.Element) -> list[ET.Element]:
    return [element for element in root.iter() if element.tag.endswith("polyline")]


def test_a_line_per_curve_and_escaped_names():
    root = drawn(
        Panel("x <m>", (Curve("sin", [math.sin(x) for x in X]), Curve("a&b", X))), Panel("none", ())
    )
    assert len(lines(root)) == 2
    words = ["".join(element.itertext()) for element in root.iter() if element.tag.endswith("text")]
    assert {"a <b> & c", "x <m>", "sin", "a&b", "t (s)"} <= set(words)


@pytest.mark.parametrize(
    "values",
    [[0.0] * 301, [3.0] * 301, [math.nan] * 301, [1e300] * 301, [1e-300 * k for k in range(301)]],
)
@pytest.mark.parametrize("log", [False, True])
def test_strange_values_make_a_plot_all_the_same(values, log):
    drawn(Panel("strange", (Curve("c", values),), log))


def test_no_line_is_drawn_across_points_that_are_no_numbers():
    root = drawn(
        Panel("p", (Curve("c", [math.nan if k in (100, 101) else 1.0 for k in range(301)]),))
    )
    assert [len(line.attrib["points"].split()) for line in lines(root)] == [100, 199]


def test_long_motions_are_thinned_but_keep_their_end():
    x = [float(k) for k in range(10_001)]
    root = ET.fromstring(draw("long", "t", x, [Panel("p", (Curve("c", x),))]))
    assert len(lines(root)[0].attrib["points"].split()) < 2000
    assert lines(root)[0].attrib["points"].split()[-1].startswith("610.0,")


def test_ticks_are_round_and_inside():
    axis = linear([0.0, 9.7])
    assert [label for _, label in axis.ticks] == ["0", "2", "4", "6", "8", "10"]
    assert all(0 <= at <= 1 for at, _ in axis.ticks)
    assert linear([0.0, 9.7], tight=True).position(9.7) == 1.0


def test_logarithmic_axis_spans_decades_and_keeps_zero_at_the_bottom():
    axis = logarithmic([0.0, 3e-15, 2e-12])
    assert (axis.low, axis.high) == (-15, -11)
    assert axis.position(0.0) == 0.0 and axis.position(1e-13) == pytest.approx(0.5)


def test_a_logarithmic_axis_that_ends_at_its_data():
    axis = decades(0.05, 20.0)
    assert axis.position(0.05) == 0.0 and axis.position(20.0) == 1.0
    assert [label for _, label in axis.ticks] == ["1e-1", "1e0", "1e1"]
    assert [at for at, _ in axis.ticks] == pytest.approx([axis.position(x) for x in (0.1, 1, 10)])
    assert [label for _, label in decades(1.5, 7.0).ticks] == ["2", "5"]
