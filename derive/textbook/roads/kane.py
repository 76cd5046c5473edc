"""Kane's equations, and those of Gibbs and Appell: both take the bodies one by one.

Source: Kane, Levinson, Dynamics, Theory and Applications, 1985; Gibbs 1879, Appell 1899.
"""

from __future__ import annotations

import casadi as ca

from derive.expressions.scalars import Scalar
from derive.joints.rotations import cross, sum_of
from derive.mechanics.records import Inertia, Link
from derive.mechanics.recursions.motion import Numbers
from derive.mechanics.recursions.tree import inertia_force, twists
from derive.textbook.forces import active, along, at_quasi_velocities, balance, column_bias, solved
from derive.textbook.formulas.terms import Terms
from derive.textbook.inverse import accelerations
from derive.textbook.manuscript import Manuscript
from derive.textbook.methods import nonideal
from derive.textbook.names import words
from derive.textbook.projected import final
from derive.textbook.records import Math
from derive.textbook.roads.records import Road

AXES = "xyz"
STILL: list[Scalar] = [0.0, 0.0, 0.0]
SHORT = 40  # operations of an entry that is printed whole
MOST_LINKS = 8  # links whose partial velocities are printed


def _twist(terms: Terms) -> list[ca.SX]:
    """(ω, v) of every link at its origin, in its axes, over (t, q, w): 6 × 1 each."""
    s, v = terms.system, terms.named("v")
    columns = twists(s.links, [v[j] for j in range(v.numel())])
    return [ca.vertcat(*(ca.SX(x) for x in (*omega, *speed))) for omega, speed in columns]


def _wrench(link: Link, twist: ca.SX, rate: ca.SX) -> ca.SX:
    """Newton and Euler's moment and force of inertia at the link's origin, 6 × 1, without
    gravity."""
    moment, force = inertia_force(link.inertia, _halves(twist), _halves(rate), list(STILL))
    return ca.vertcat(*(ca.SX(x) for x in (*moment, *force)))


def _halves(column: ca.SX) -> Numbers:
    """(ω, v) of a column."""
    return [column[k] for k in range(3)], [column[k] for k in range(3, 6)]


def _rest(terms: Terms, wdot: ca.SX) -> ca.SX:
    """Sᵀ of the inertia that no link has: of rotors and of energies given by formula."""
    s, S = terms.system, terms.named("S")
    if not s.links:
        vdot = ca.mtimes(S, wdot) + terms.named("sigma")
        return at_quasi_velocities(
            terms, ca.mtimes(S.T, ca.mtimes(s.M, vdot) + s.h + active(s) - s.Q)
        )
    vdot = along(terms, terms.named("v"), wdot)
    own = s.h_extra - _still(terms)
    return at_quasi_velocities(terms, ca.mtimes(S.T, ca.mtimes(s.M_extra, vdot) + own))


def _is_beside_bodies(doc: Manuscript) -> bool:
    """Whether rotors or a kinetic energy given by formula have inertia beside the bodies."""
    s = doc.system
    return bool(s.links) and bool(s.M_extra.nnz() or s.model.kinetic is not None)


def _beside_bodies(doc: Manuscript) -> None:
    """The words for M′ and h′."""
    doc.say(
        "Rotors, and what the file gives of the kinetic energy by a formula, add $!M'$ to the mass "
        "matrix and $!h'$ to the bias of the generalized velocities."
    )
    doc.mean(r"!M',\; !h'", "what rotors and the given kinetic energy add to $!M$ and $!h$")


def _still(terms: Terms) -> ca.SX:
    """What of the added bias is potential, see forces.potential_bias."""
    s = terms.system
    links_only = ca.substitute(s.h - s.h_extra, s.v, ca.SX.zeros(s.v.numel()))
    return s.Q - active(s) - links_only


def _inertia(terms: Terms, wdot: ca.SX) -> ca.SX:
    """−F*: Σ (∂t_i/∂w)ᵀ (moment and force of inertia of link i), nw × 1."""
    total = ca.SX.zeros(terms.w.numel())
    for link, twist in zip(terms.system.links, _twist(terms)):
        partial = ca.jacobian(twist, terms.w)
        total = total + ca.mtimes(partial.T, _wrench(link, twist, along(terms, twist, wdot)))
    return total + _rest(terms, wdot)


def _force(terms: Terms) -> ca.SX:
    """F: generalised active forces, Sᵀ (Q − V)."""
    return at_quasi_velocities(terms, ca.mtimes(terms.named("S").T, active(terms.system)))


def _left(terms: Terms, wdot: ca.SX) -> ca.SX:
    """−(F + F*)."""
    return _inertia(terms, wdot) - _force(terms)


def _write(doc: Manuscript) -> None:
    nonideal(doc)
    _partials(doc)
    doc.section("Kane's equations")
    doc.say(
        "Each body's moment and force of inertia, at its origin and in its axes, are multiplied by "
        "the partial velocities of that place, and so are all forces that act. What constraints "
        "exert drops out, for it does no work on these motions. The generalised inertia forces "
        "are:"
    )
    wdot, beside = doc.terms.wdot, _is_beside_bodies(doc)
    doc.law(
        "inertia forces",
        r"!F^{*}",
        r"-\sum_i \left(\frac{\partial !\omega_i}{\partial !w}\right)^T!n_i "
        r"-\sum_i \left(\frac{\partial !v_i}{\partial !w}\right)^T!f_i"
        + (r" - !S^T\left(!M'\,!!v + !h'\right)" if beside else ""),
        balance(doc.terms, wdot) - _left(doc.terms, wdot),
    )
    doc.mean(r"!n_{i},\; !f_{i}", "moment and force of inertia of body $i$ at its origin", "N*m, N")
    doc.state(
        r"!f_i",
        r"m_i\,!a_i + \dot{!\omega}_i\times m_i!c_i "
        r"+ !\omega_i\times\left(!\omega_i\times m_i!c_i\right)",
    )
    doc.state(
        r"!n_i",
        r"!I_i\,\dot{!\omega}_i + !\omega_i\times !I_i\,!\omega_i "
        r"+ m_i!c_i\times !a_i",
    )
    doc.say(
        "where $!a_i=!!v_i+!\\omega_i\\times!v_i$ is the acceleration of the body's origin, "
        "$m_i!c_i$ its first moment and $!I_i$ its inertia there. The generalised active forces "
        "are those of gravity, springs, dampers and inputs; $!V$ is the bias of gravity and "
        "potential, $!h$ where $!v=!0$:"
    )
    force = _force(doc.terms)
    doc.state(r"!F", r"!S^T\left(!Q - !V\right)")
    doc.mean(r"!V", "bias of gravity and potential, $!h$ where $!v=!0$")
    doc.mean(r"!F,\; !F^{*}", "generalised active and inertia forces")
    doc.vector("active", "F", force)
    if beside:
        _beside_bodies(doc)
    doc.say("Kane's equations say that they balance:")
    doc.law("Kane", r"!F + !F^{*}", r"!0", _left(doc.terms, wdot))
    final(doc)


def _partials(doc: Manuscript) -> None:
    doc.section("Partial velocities")
    links = doc.system.links
    if not links:
        doc.say(
            "The file gives energies and no bodies, so the inertia forces are taken from the "
            "kinetic energy: the partial velocities are the columns of $!S$."
        )
        return
    doc.say(
        "The twist of every body is linear in the quasi-velocities. Its derivatives with respect "
        "to them, Kane's partial angular velocities and partial velocities, are the twists of the "
        "body while one quasi-velocity is one and the others are zero:"
    )
    values = _twist(doc.terms)
    whole = ca.vertcat(*values)
    partial = ca.jacobian(whole, doc.terms.w)
    moving = whole - ca.mtimes(partial, doc.terms.w)
    doc.law(
        "partial velocities",
        r"\begin{bmatrix} !\omega_i \\ !v_i \end{bmatrix}",
        r"\sum_l \frac{\partial}{\partial w_l}"
        r"\begin{bmatrix} !\omega_i \\ !v_i \end{bmatrix} w_l"
        + ("" if doc.system.c.is_zero() else r" + !t_i"),
        moving - ca.substitute(whole, doc.terms.w, ca.SX.zeros(doc.terms.w.numel())),
    )
    if len(links) > MOST_LINKS:
        doc.say(f"The {len(links)} bodies are too many to be listed.")
        return
    for link, value in zip(links, values):
        _of_link(doc, link, ca.densify(ca.jacobian(value, doc.terms.w)))


def _of_link(doc: Manuscript, link: Link, partial: ca.SX) -> None:
    """The rows of ∂t_i/∂w that are not zero."""
    rows = [k for k in range(6) if not ca.SX(partial[k, :]).is_zero()]
    if not rows:
        return
    labels = ", ".join((r"\omega_" if k < 3 else "v_") + AXES[k % 3] for k in rows)
    i = next(k for k, x in enumerate(doc.system.links) if x is link) + 1
    doc.say("Of {name}, rows {rows}:", name=words(link.name), rows=Math(labels))
    doc.matrix(f"partial[{i}]", rf"!J_{{{i}}}", f"J^{{{i}}}", partial[rows, :])
    doc.mean(rf"!J_{{{i}}}", "partial velocities of {name}", name=words(link.name))


def _acceleration_energy(terms: Terms, wdot: ca.SX) -> ca.SX:
    """Σ ½ ∫ a·a dm of all bodies, without what is free of ẇ: with a = v̇ + ω × v of the origin,
    ½ m a·a + mc·(a × ω̇ … ), see the law on the page."""
    total = ca.SX(0)
    for link, twist in zip(terms.system.links, _twist(terms)):
        total = total + _of_body(link.inertia, twist, along(terms, twist, wdot))
    return total


def _of_body(body: Inertia, twist: ca.SX, rate: ca.SX) -> ca.SX:
    """½ m a·a + mc·(a × α) + a·(ω × (ω × mc)) + ½ α·I α + α·(ω × I ω), a = v̇ + ω × v."""
    (omega, speed), (alpha, apparent) = _halves(twist), _halves(rate)
    a = _sx(sum_of(apparent, cross(omega, speed)))
    mc, angular = _sx(body.moment), _sx(alpha)
    tensor = ca.vertcat(*(ca.horzcat(*(ca.SX(x) for x in row)) for row in body.tensor))
    spin = ca.cross(_sx(omega), ca.mtimes(tensor, _sx(omega)))
    centripetal = _sx(cross(omega, cross(omega, body.moment)))
    linear = 0.5 * ca.SX(body.mass) * ca.dot(a, a) + ca.dot(a, ca.cross(angular, mc))
    return (
        linear
        + ca.dot(a, centripetal)
        + 0.5 * ca.dot(angular, ca.mtimes(tensor, angular))
        + ca.dot(angular, spin)
    )


def _sx(entries: list[Scalar]) -> ca.SX:
    return ca.vertcat(*(ca.SX(x) for x in entries))


def _appell_left(terms: Terms, wdot: ca.SX) -> ca.SX:
    """∂G/∂ẇ − F at any ẇ."""
    free = ca.SX.sym("wdot", terms.w.numel())
    slope = ca.gradient(_acceleration_energy(terms, free), free)
    return ca.substitute(slope, free, wdot) + _rest(terms, wdot) - _force(terms)


def _appell(doc: Manuscript) -> None:
    nonideal(doc)
    accelerations(doc)
    doc.section("Energy of accelerations")
    G = doc.called("Gibbs", "G")
    doc.say(
        "Gibbs and Appell's function is to accelerations what the kinetic energy is to velocities, "
        f"${G}=\\tfrac{{1}}{{2}}\\int !a\\cdot!a\\,\\mathrm{{d}}m$. For a body, with the "
        "acceleration $!a_i$ of its origin and its first moment $m_i!c_i$, it is, without what is "
        "free of accelerations:"
    )
    doc.state(
        f"{G}_i",
        r"\tfrac{1}{2} m_i\,!a_i^2 + !a_i\cdot\left(\dot{!\omega}_i\times m_i!c_i "
        r"+ !\omega_i\times\left(!\omega_i\times m_i!c_i\right)\right) "
        r"+ \tfrac{1}{2}\dot{!\omega}_i\cdot!I_i\dot{!\omega}_i "
        r"+ \dot{!\omega}_i\cdot\left(!\omega_i\times!I_i!\omega_i\right)",
    )
    doc.mean(G, "energy of accelerations (Gibbs, Appell)")
    if _is_beside_bodies(doc):
        _beside_bodies(doc)
        doc.say("So the sum over the bodies has one more term:")
        doc.state(G, rf"\sum_i {G}_i + \tfrac{{1}}{{2}}\,!!v^T!M'\,!!v + !!v^T!h'")
    doc.say("In the rates of the quasi-velocities it is a polynomial of second degree:")
    terms, wdot = doc.terms, doc.terms.wdot
    M_w, h = terms.named("M_w"), balance(terms, ca.SX.zeros(wdot.numel())) + _force(terms)
    free = ca.SX.sym("trial", wdot.numel())
    slope = _appell_left(terms, free) + _force(terms)
    collected = ca.mtimes(M_w, free) + h
    doc.law(
        "acceleration energy",
        G,
        r"\tfrac{1}{2}\,!!w^T!M_w\,!!w + !!w^T!h_c + \ldots",
        ca.substitute(slope - collected, free, TRIAL[: wdot.numel()]),
    )
    doc.mean(r"!h_c", "what of the bias is no gravity and no potential, $!h_w-!S^T!V$")
    _printed_energy(doc)
    doc.section("Gibbs and Appell's equations")
    doc.say("Differentiated with respect to the rates of the quasi-velocities it gives the forces:")
    doc.law(
        "Appell",
        rf"\frac{{\partial {G}}}{{\partial !!w}}",
        r"!S^T\left(!Q - !V\right)",
        _appell_left(terms, wdot),
    )
    doc.mean(r"!V", "bias of gravity and potential, $!h$ where $!v=!0$")
    final(doc)


TRIAL = ca.DM([0.7 + 0.31 * k * (-1) ** k for k in range(200)])  # any accelerations


def _printed_energy(doc: Manuscript) -> None:
    """The linear part, where it is short."""
    terms, s = doc.terms, doc.system
    potential = ca.mtimes(terms.named("S").T, s.Q - active(s))
    linear = at_quasi_velocities(terms, column_bias(terms) - potential)
    entries = doc.reader.whole(linear, SHORT)
    if entries is None:
        return
    doc.vector("h_c", "h^{c}", linear, entries)
    if all(x == 0 for x in entries):
        doc.say("Here $!h_c=!0$.")


def _solution(terms: Terms) -> ca.SX:
    wdot = ca.SX.sym("wdot", terms.w.numel())
    return solved(terms, _left(terms, wdot), wdot)


def _appell_solution(terms: Terms) -> ca.SX:
    wdot = ca.SX.sym("wdot", terms.w.numel())
    return solved(terms, _appell_left(terms, wdot), wdot)


KANE = Road(
    name="kane",
    title="Kane's equations",
    about="partial velocities of every body, generalised active and inertia forces",
    source="Kane, Levinson: Dynamics, Theory and Applications, 1985",
    write=_write,
    accelerations=_solution,
    unknowns=lambda terms: terms.w.numel(),
    needs="partial velocities and accelerations of every body; no energy is differentiated",
    fails="where the quasi-velocities do not fix the twists: the same singular positions of [A; B]",
    left=_left,
)
GIBBS_APPELL = Road(
    name="gibbs_appell",
    title="Gibbs–Appell equations",
    about="the energy of accelerations, differentiated by the rates of the quasi-velocities",
    source="Gibbs: On the fundamental formulae of dynamics, 1879; Appell 1899",
    write=_appell,
    accelerations=_appell_solution,
    unknowns=lambda terms: terms.w.numel(),
    needs="one scalar, quadratic in the accelerations, and one derivative of it",
    fails="where [A; B] is singular; the scalar grows with the square of the bodies' accelerations",
    left=_appell_left,
)
