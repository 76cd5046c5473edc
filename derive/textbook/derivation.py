"""Equations → Document: the sections in the order a textbook has them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.metadata import PackageNotFoundError, version

from derive.formulations import source
from derive.formulations.frames import based
from derive.formulations.records import Equations
from derive.textbook.choice import choice
from derive.textbook.constraints import constraints
from derive.textbook.energy import energies, power
from derive.textbook.given.model import given
from derive.textbook.inverse import directions
from derive.textbook.kinematics import components, coordinates, links
from derive.textbook.linear import linearised
from derive.textbook.loops import loops, recursion_of
from derive.textbook.manuscript import Manuscript
from derive.textbook.outputs import outputs
from derive.textbook.records import Document, Math, Text
from derive.textbook.roads import Road
from derive.textbook.routes import roads_of, write_roads
from derive.textbook.states import first_order_states
from derive.textbook.worked import with_numbers

MOST_SYMBOLS = 200  # of a longer table the first and the last
# the section that takes from it, and the source
REFERENCES = (
    (
        "Block inverse",
        "Mirtaheri, Zohoor: Quasi-velocities definition in Lagrangian multibody dynamics. The rows "
        "of A and B stacked and inverted by blocks.",
    ),
    (
        "Choice of quasi-velocities",
        "Kane, Levinson: Dynamics, Theory and Applications, 1985. Generalised speeds and partial "
        "velocities.",
    ),
    (
        "Projection",
        "Maggi's equations: the equations of motion projected on the motions that the constraints "
        "allow.",
    ),
    ("Velocities that the constraints allow", "Jerkovsky 1978: the velocity transformation."),
    (
        "Decoupled natural orthogonal complement",
        "Saha 1999: the decoupled natural orthogonal complement.",
    ),
    ("Platform and arm", "Yu, Chen 2002: platform and arm of a mobile manipulator."),
    (
        "Kinematics",
        "Luh, Walker, Paul 1980: recursive Newton–Euler equations. Walker, Orin 1982: composite "
        "bodies.",
    ),
)


def derivation(equations: Equations, roads: Sequence[str] = ("block_inversion",)) -> Document:
    """Every section, formulas numbered throughout: a first half that all roads share, one road or
    two of them side by side, and what follows from any. Raises AssumptionError where the system
    cannot take a road."""
    if recursion_of(equations) is not None:
        return _long(equations)
    equations = based(equations)
    doc = Manuscript(equations, components(equations.system))
    for section in FIRST:
        section(doc)
    taken = roads_of(doc.terms, roads)
    write_roads(doc, taken)
    for section in LAST:
        section(doc)
    document = doc.document(_title(equations), _subtitle(equations, taken), _version())
    return with_numbers(document, equations)


def _long(equations: Equations) -> Document:
    """What is given, the recursion once, and who devised it."""
    doc = Manuscript(equations, [])
    for section in (given, loops, references):
        section(doc)
    subtitle = "recursion over the links of a tree; generalized velocities"
    return doc.document(_title(equations), subtitle, _version())


def _title(equations: Equations) -> str:
    return f"Equations of motion: {equations.system.model.name.replace('_', ' ')}"


def _subtitle(equations: Equations, taken: Sequence[Road]) -> str:
    if equations.generalized_velocities:
        return f"generalized velocities, formulation {equations.formulation}"
    ways = " and ".join(road.title for road in taken)
    return f"explicit, without multipliers; quasi-velocities “{equations.choice}”; {ways}"


def _version() -> str:
    try:
        return version("hamel")
    except PackageNotFoundError:
        return ""


def symbols(doc: Manuscript) -> None:
    """What every symbol means, with its unit."""
    doc.section("Symbols")
    meanings = dict.fromkeys(doc.meanings)  # two roads share some
    rows = [((Math(x.latex),), x.about, (Text(x.unit),)) for x in meanings]
    doc.table(("symbol", "meaning", "unit"), rows, MOST_SYMBOLS)


def references(doc: Manuscript) -> None:
    """Who devised the methods, and what was assumed."""
    doc.section("Sources of the methods")
    texts = [text for title, text in REFERENCES if doc.has_section(title)]
    first = source(doc.equations.formulation)
    if not any(text.startswith(first) for text in texts):
        texts.insert(0, first)
    doc.items(texts, lambda x: (Text(x),))
    for text in doc.equations.assumptions:
        doc.say("Assumed: {text}.", text=text)


# A section is a function of the manuscript; one that does not apply writes nothing.
FIRST: tuple[Callable[[Manuscript], None], ...] = (
    given,
    coordinates,
    first_order_states,
    links,
    energies,
    constraints,
    choice,
    directions,
)
LAST: tuple[Callable[[Manuscript], None], ...] = (power, outputs, linearised, symbols, references)
