"""The mechanism of a model as a textbook draws it: SVG and TikZ of one state, and the shapes of a
motion."""

from hamel.draw.mechanism.figure import Figure, figure, picture
from hamel.draw.mechanism.svg import svg
from hamel.draw.mechanism.tikz import tikz

__all__ = ["Figure", "figure", "picture", "svg", "tikz"]
