"""Equations → Document: the sections in the order a textbook has them."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version

from derive.formulations import source
from derive.formulations.frames import based
from derive.formulations.records import Equations
from derive.textbook import names
from derive.textbook.charts import charts
from derive.textbook.choice import choice
from derive.textbook.complement import complement
from derive.textbook.constraints import constraints
from derive.textbook.energy import energies, power
from derive.textbook.given import given
from derive.textbook.interaction import interaction
from derive.textbook.inverse import inverse
from derive.textbook.kinematics import components, coordinates, links
from derive.textbook.linear import linearised
from derive.textbook.manuscript import Manuscript
from derive.textbook.methods import method, nonideal
from derive.textbook.motion import bordered, unprojected
from derive.textbook.multipliers import multipliers
from derive.textbook.outputs import outputs
from derive.textbook.projected import projected
from derive.textbook.records import Document, Math, Text

REFERENCES = (
    "Mirtaheri, Zohoor: Quasi-velocities definition in Lagrangian multibody dynamics. [A; B] "
    "stacked and inverted by blocks.",
    "Kane, Levinson: Dynamics, Theory and Applications, 1985. Generalised speeds and partial "
    "velocities.",
    "Maggi's equations: the equations of motion projected on the motions that the constraints "
    "allow.",
    "Jerkovsky 1978: the velocity transformation.",
    "Saha 1999: the decoupled natural orthogonal complement. Yu, Chen 2002: platform and arm of a "
    "mobile manipulator.",
    "Luh, Walker, Paul 1980: recursive Newton–Euler equations. Walker, Orin 1982: composite "
    "bodies.",
)


def derivation(equations: Equations) -> Document:
    """Every section, formulas numbered throughout."""
    equations = based(equations)
    doc = Manuscript(equations, components(equations.system))
    for section in SECTIONS:
        section(doc)
    return doc.document(_title(equations), _subtitle(equations), _version())


def _title(equations: Equations) -> str:
    return f"Equations of motion: {equations.system.model.name}"


def _subtitle(equations: Equations) -> str:
    if equations.generalized_velocities:
        return f"generalized velocities, formulation {equations.formulation}"
    return f"explicit, without multipliers; quasi-velocities “{equations.choice}”"


def _version() -> str:
    try:
        return version("hamel")
    except PackageNotFoundError:
        return ""


def symbols(doc: Manuscript) -> None:
    """What every symbol means, with its unit."""
    doc.section("Symbols")
    doc.say(
        "Bold letters are matrices and columns; the same letter with indices is an entry, its row "
        "before its column."
    )
    rows = [((Math(x.latex),), (Text(x.about),), (Text(names.unit(x.unit)),)) for x in doc.meanings]
    doc.table(("symbol", "meaning", "unit"), rows)


def references(doc: Manuscript) -> None:
    """Who devised the methods, and what was assumed."""
    doc.section("Sources of the methods")
    doc.items((Text(x),) for x in (source(doc.equations.formulation), *REFERENCES))
    for text in doc.equations.assumptions:
        doc.say("Assumed: {text}.", text=text)


# A section is a function of the manuscript; one that does not apply writes nothing.
SECTIONS: tuple[Callable[[Manuscript], None], ...] = (
    given,
    coordinates,
    links,
    constraints,
    choice,
    inverse,
    charts,
    energies,
    unprojected,
    nonideal,
    method,
    interaction,
    complement,
    bordered,
    projected,
    multipliers,
    power,
    outputs,
    linearised,
    symbols,
    references,
)
