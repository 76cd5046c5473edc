"""The figure at the head of a derivation, on the page and in the article.

Of derive.textbook.writing: html, latex.
"""

import xml.etree.ElementTree as ET

from derive.model import load
from derive.states import system
from derive.textbook import html, latex
from hamel.draw.mechanism import picture, svg, tikz
from tests.scenes import MODELS, derived


def test_a_derivation_opens_with_the_mechanism():
    equations = derived("pendulum")
    drawing = picture(system(load(MODELS / "pendulum.yaml")))
    web = html(equations, svg(drawing))
    start = web.index('<figure class="drawing">')
    assert start < web.index('<nav aria-label="Contents">')
    end = web.index("</svg>", start) + len("</svg>")
    figure = ET.fromstring(web[web.index("<svg", start) : end])
    assert figure.attrib["class"] == "mechanism"
    tex = latex(equations, tikz(drawing))
    assert r"\usepackage{tikz}" in tex
    assert tex.index(r"\begin{tikzpicture}") < tex.index(r"\section{Given}")
    assert tex.count(r"\begin{tikzpicture}") == tex.count(r"\end{tikzpicture}") == 1


def test_without_a_figure_the_page_is_as_it_was():
    equations = derived("pendulum")
    assert "<figure" not in html(equations)
    assert "tikz" not in latex(equations)
