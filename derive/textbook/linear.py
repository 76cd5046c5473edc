"""The linear equations along the file's first steady motion, as M_w δẇ = K δx + G δu and rows for
the coordinates' rates."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from derive.diagnostics import AssumptionError, ModelError
from derive.linearize.study import Study, study
from derive.textbook import names
from derive.textbook.manuscript import Manuscript
from derive.textbook.records import Math

NOTHING = 1e-12  # a coordinate or speed below this is zero along the motion
ANYTHING = 1.375  # for a free name whose value the file leaves open


@dataclass(frozen=True)
class _SteadyMotion:
    """`zeros`: places in x of what vanishes along the motion."""

    doc: Manuscript
    study: Study
    zeros: list[int]

    def at(self, value: ca.SX) -> ca.SX:
        """The term along the motion."""
        x = self.doc.equations.arguments[1].symbols
        return ca.substitute(value, x[self.zeros], ca.SX.zeros(len(self.zeros)))

    def latex(self, place: int) -> str:
        """What an entry of x is called."""
        symbols = [*self.doc.q, *self.doc.w, *self.doc.z]
        return self.doc.notation.latex[symbols[place]]

    @property
    def minimal(self) -> list[int]:
        """Places in x of the minimal states that are not cyclic."""
        return [self.study.linear.independent[k] for k in self.study.kept]

    @property
    def cyclic(self) -> list[int]:
        """Places in x of the cyclic coordinates."""
        return [self.study.linear.independent[k] for k in self.study.cyclic]


def linearised(doc: Manuscript) -> None:
    """Nothing where the file names no steady motion, or the formulation is not minimal."""
    motion = _steady_motion(doc)
    if motion is None:
        return
    doc.section("Linear equations")
    _introduction(motion)
    _deviations(motion)
    _forces(motion)
    _rates(motion)
    doc.say(
        "The multipliers have no part in these equations: what constraint forces add to the "
        "stiffness has entered through $!f_w$, whose dependent velocities were eliminated before "
        "it was differentiated."
    )


def _steady_motion(doc: Manuscript) -> _SteadyMotion | None:
    motions = doc.system.model.steady_motions
    if not motions or doc.equations.generalized_velocities or not doc.w:
        return None
    if not doc.terms.has("M_w") or not doc.system.written:
        return None
    try:
        linear = study(doc.equations, motions[0], _values(doc))
    except (AssumptionError, ModelError):
        return None  # what is wrong with it is said by `hamel linearize`
    x = linear.motions({}).x[0]
    return _SteadyMotion(doc, linear, [i for i, value in enumerate(x) if abs(value) <= NOTHING])


def _values(doc: Manuscript) -> dict[str, float]:
    """Of the free names that the file gives no range for."""
    motion = doc.system.model.steady_motions[0]
    known = {name for name, *_ in motion.ranges}
    return {name: ANYTHING for name in motion.sweepable if name not in known}


def _introduction(motion: _SteadyMotion) -> None:
    doc, name = motion.doc, motion.doc.system.model.steady_motions[0].name
    text = (
        "Along the steady motion “{name}” all quasi-velocities and all coordinates but the cyclic "
        "ones are constant"
    )
    vanishing = [motion.latex(i) for i in motion.zeros if i not in motion.cyclic]
    if vanishing:
        zero = Math(r",\; ".join(vanishing) + " = 0")
        doc.say(text + ", and {zero}.", name=name, zero=zero)
    else:
        doc.say(text + ".", name=name)


def _deviations(motion: _SteadyMotion) -> None:
    entries = [rf"\delta {motion.latex(i)}" for i in motion.minimal]
    motion.doc.say(
        "Small deviations {order} follow from differentiating the equations along the motions that "
        "the constraints allow. There are {count} of them: as many as coordinates and generalized "
        "velocities, less the independent position and velocity constraints, and less {cyclic} "
        "cyclic coordinates, which stand in no equation.",
        order=Math(r"\left(" + ",\\,".join(entries) + r"\right)"),
        count=str(len(entries)),
        cyclic=str(len(motion.cyclic)),
    )


def _forces(motion: _SteadyMotion) -> None:
    """M_w δẇ = K δx + G δu, where ẇ = 0 along the motion."""
    doc, form = motion.doc, motion.study.linear
    x, u = doc.equations.arguments[1].symbols, doc.equations.arguments[2].symbols
    f_w = doc.terms.named("f_w")
    doc.state(r"!M_w\,\delta !!w", r"!K\,\delta !x" + (r" + !G\,\delta !u" if u.numel() else ""))
    slopes = ca.mtimes(ca.jacobian(f_w, x), form.T[:, list(motion.study.kept)])
    slopes = motion.at(slopes)
    doc.say("There stand the mass matrix and the slopes of $!f_w-!h_w$ at the steady motion.")
    _matrix(doc, "M_w at", r"!M_w", "M^{0}", motion.at(doc.terms.named("M_w")))
    _matrix(doc, "K at", r"!K", "K", slopes)
    if u.numel():
        _matrix(doc, "G at", r"!G", "G", motion.at(ca.jacobian(f_w, u)))
    doc.mean(
        r"!K,\; !G",
        "slopes of $!f_w-!h_w$ over the minimal states and the inputs, along the steady motion",
    )


def _rates(motion: _SteadyMotion) -> None:
    """δq̇ of the independent coordinates that are not cyclic."""
    doc, form, places = motion.doc, motion.study.linear, motion.study.kept
    rows = [k for k in places if form.independent[k] < doc.system.q.numel()]
    if not rows:
        return
    symbols = r",\; ".join(motion.latex(form.independent[k]) for k in rows)
    one = len(rows) == 1
    whose = "rate of the coordinate {names} is" if one else "rates of the coordinates {names} are"
    doc.say(f"The {whose}:", names=Math(symbols))
    value = motion.at(form.A[rows, list(places)])
    _matrix(doc, "A rates", r"\delta !!q = !A_q\,\delta !x,\quad !A_q", "A", value)


def _matrix(doc: Manuscript, name: str, bold: str, stem: str, value: ca.SX) -> None:
    """Printed where all entries can be read as they stand."""
    entries = doc.reader.whole(value)
    if entries is None:
        doc.too_long(names.bold(bold))
    else:
        doc.matrix(name, bold, stem, value, entries)
