"""Line plots as SVG text of our own: no plotting library at run time, the same bytes for the same
numbers."""

from hamel.draw.axis import Axis, decades, linear, logarithmic
from hamel.draw.chart import Series, chart, side_by_side
from hamel.draw.panels import Curve, Panel, draw

__all__ = [
    "Axis",
    "Curve",
    "Panel",
    "Series",
    "chart",
    "decades",
    "draw",
    "linear",
    "logarithmic",
    "side_by_side",
]
