"""The linear equations along the file's first steady motion, as M_w δẇ = K δx + G δu and rows for
the coordinates' rates."""

from __future__ import annotations

import casadi as ca

from derive.diagnostics import AssumptionError, ModelError
from derive.linearize.records import Linear
from derive.linearize.study import Study, study
from derive.textbook import names
from derive.textbook.author import Author
from derive.textbook.records import Math

NOTHING = 1e-12  # a coordinate or speed below this is zero along the motion
ANYTHING = 1.375  # for a free name whose value the file leaves open


def linearised(a: Author) -> None:
    """Nothing where the file names no steady motion, or the formulation is not minimal."""
    motions = a.system.model.steady_motions
    if not motions or a.free_velocities or not a.w or not a.has("M_w") or not a.system.written:
        return
    try:
        found = study(a.equations, motions[0], _values(a))
    except (AssumptionError, ModelError):
        return  # what is wrong with it is said by `hamel linearize`
    a.section("Linear equations")
    zeros = _zeros(a, found)
    _introduction(a, found, zeros)
    _forces(a, found.linear, zeros, found)
    _rates(a, found.linear, zeros, found)
    a.say(
        "The multipliers have no part in these equations: what constraint forces add to the stiffness has entered through "
        "$!f_w$, whose dependent velocities were eliminated before it was differentiated."
    )


def _values(a: Author) -> dict[str, float]:
    motion = a.system.model.steady_motions[0]
    known = {name for name, *_ in motion.ranges}
    return {name: ANYTHING for name in motion.sweepable if name not in known}


def _zeros(a: Author, found: Study) -> list[int]:
    """Places in x of what vanishes along the motion."""
    x = found.motions({}).x[0]
    return [i for i, value in enumerate(x) if abs(value) <= NOTHING]


def _introduction(a: Author, found: Study, zeros: list[int]) -> None:
    motion = a.system.model.steady_motions[0]
    symbols = [*a.q, *a.w]
    vanishing = [
        a.names[symbols[i]]
        for i in zeros
        if i not in {found.linear.independent[k] for k in found.cyclic}
    ]
    text = ", ".join(vanishing) + (" = 0" if vanishing else "")
    a.say(
        "Along the steady motion “{name}” all quasi-velocities and all coordinates but the cyclic ones are constant"
        + (", and {zero}." if text else "."),
        name=motion.name,
        **({"zero": Math(text)} if text else {}),
    )
    kept = [found.linear.states[k] for k in found.kept]
    order = Math(_column(a, found))
    a.say(
        "Small deviations {order} follow from differentiating the equations along the motions that the constraints allow. There "
        "are {count} of them: $n_q+n_v$ less the independent position and velocity constraints, and less {cyclic} cyclic "
        "coordinates.",
        order=order,
        count=str(len(kept)),
        cyclic=str(len(found.cyclic)),
    )


def _column(a: Author, found: Study) -> str:
    symbols = [*a.q, *a.w]
    entries = [rf"\delta {a.names[symbols[found.linear.independent[k]]]}" for k in found.kept]
    return r"\left(" + ",\\,".join(entries) + r"\right)"


def _at(a: Author, value: ca.SX, zeros: list[int]) -> ca.SX:
    x = a.equations.arguments[1].symbols
    return ca.substitute(value, x[zeros], ca.SX.zeros(len(zeros)))


def _forces(a: Author, form: Linear, zeros: list[int], found: Study) -> None:
    """M_w δẇ = K δx + G δu, where ẇ = 0 along the motion."""
    x, u = a.equations.arguments[1].symbols, a.equations.arguments[2].symbols
    f_w = a.named("f_w")
    a.state(r"!M_w\,\delta !!w", r"!K\,\delta !x" + (r" + !G\,\delta !u" if u.numel() else ""))
    slopes = _at(a, ca.mtimes(ca.jacobian(f_w, x), form.T[:, list(found.kept)]), zeros)
    a.say("with the mass matrix and the slopes of the force at the steady motion")
    _matrix(a, "M_w at", r"!M_w", "M^{0}", _at(a, a.named("M_w"), zeros))
    _matrix(a, "K at", r"!K", "K", slopes)
    if u.numel():
        _matrix(a, "G at", r"!G", "G", _at(a, ca.jacobian(f_w, u), zeros))
    a.mean(
        r"!K,\; !G", "slopes of f_w over the minimal states and the inputs, along the steady motion"
    )


def _rates(a: Author, form: Linear, zeros: list[int], found: Study) -> None:
    """δq̇ of the independent coordinates that are not cyclic."""
    rows = [k for k in found.kept if form.independent[k] < a.system.q.numel()]
    if not rows:
        return
    symbols = [*a.q, *a.w]
    a.say(
        "and the rates of the coordinates {names} are",
        names=Math(", ".join(a.names[symbols[form.independent[k]]] for k in rows)),
    )
    value = _at(a, form.A[rows, list(found.kept)], zeros)
    _matrix(a, "A rates", r"\delta !!q = !A_q\,\delta !x,\quad !A_q", "A", value)


def _matrix(a: Author, name: str, bold: str, stem: str, value: ca.SX) -> None:
    """Printed where all entries can be read as they stand."""
    found = a.reader.whole(value)
    if found is None:
        a.too_long(names.bold(bold))
    else:
        a.matrix(name, bold, stem, value, found)
