"""The Boltzmann–Hamel equations: Lagrange's equations in quasi-velocities, with the coefficients γ.

Source: Boltzmann 1902; Hamel, Die Lagrange-Eulerschen Gleichungen der Mechanik, 1904.
"""

from __future__ import annotations

import casadi as ca

from derive.diagnostics import AssumptionError
from derive.mechanics.records import System
from derive.model.load_records import Armature, Exhaust
from derive.textbook.forces import active, along, solved
from derive.textbook.formulas.coefficients import Coefficients
from derive.textbook.formulas.terms import Terms
from derive.textbook.manuscript import Manuscript
from derive.textbook.methods import nonideal
from derive.textbook.names import words
from derive.textbook.projected import final
from derive.textbook.records import Math, Runs, Text
from derive.textbook.roads.records import Road

MOST_LISTED = 60  # coefficients that are printed one by one
SHORT = 60  # operations of a coefficient that is


def _write(doc: Manuscript) -> None:
    _check_masses(doc)
    nonideal(doc)
    coefficients = Coefficients(doc.terms)
    _directions(doc, coefficients)
    _coefficients(doc, coefficients)
    _momenta(doc, coefficients)
    _equations(doc, coefficients)
    final(doc)


def _check_masses(doc: Manuscript) -> None:
    """The rate of the momentum of a body that loses mass holds what leaves, too."""
    for load in doc.system.model.loads:
        if isinstance(load, Exhaust):
            raise AssumptionError(
                f"the mass of '{load.body}' depends on t, and this road differentiates momenta",
                "another road: block_inversion, kane, gibbs_appell",
            )


def _directions(doc: Manuscript, found: Coefficients) -> None:
    doc.section("Directions as vector fields")
    both = r"\begin{bmatrix} !S & !R \end{bmatrix}" if doc.terms.has("Y") else r"!S"
    rows = r"\begin{bmatrix} !B \\ !A \end{bmatrix}" if doc.terms.has("Y") else r"!B"
    doc.say(
        "Hamel takes all quasi-velocities at once: those that are free, $!w$, and those that the "
        "constraints fix. Each moves the mechanism along a direction $!u_r$, a column of:"
    )
    unit = ca.SX.eye(found.rows.size1())
    doc.law(
        "directions",
        rf"{rows}!U",
        rf"!1,\qquad !U = {both}",
        ca.mtimes(found.rows, found.directions) - unit,
    )
    doc.mean(r"!u_{r}", "direction of a quasi-velocity, a column of $!U$")
    doc.table(("index", "quasi-velocity", "is"), _indices(doc, found))


def _indices(doc: Manuscript, found: Coefficients) -> list[tuple[Runs, ...]]:
    rows: list[tuple[Runs, ...]] = [
        ((Text(str(k + 1)),), (Math(doc.notation.latex[symbol]),), (Text("free"),))
        for k, symbol in enumerate(doc.w)
    ]
    for k, (name, kind) in enumerate(_constraint_rows(doc)):
        index = found.free + k + 1
        rows.append(((Text(str(index)),), (Text(f"row {words(name)}"),), (Text(f"fixed, {kind}"),)))
    return rows


def _constraint_rows(doc: Manuscript) -> list[tuple[str, str]]:
    """Of the rows in Y: name, and whether it is the rate of a position constraint."""
    rows = [doc.system.rows[i] for i in doc.terms.independent]
    return [(x.name, "holonomic" if x.position >= 0 else "nonholonomic") for x in rows]


def _coefficients(doc: Manuscript, found: Coefficients) -> None:
    doc.section("Hamel's coefficients")
    doc.say(
        "Moving along $!u_r$ and then along $!u_l$ leads elsewhere than the other way round. The "
        "difference is their bracket (commutator); in generalized velocities it is how each "
        "direction changes along the other, and what the velocities $!v$ do not commute "
        "themselves, $!\\chi$. Its components along all directions are Hamel's coefficients:"
    )
    doc.state(
        r"\left[!u_r, !u_l\right]",
        r"\frac{\partial !u_l}{\partial !q}!N\,!u_r - \frac{\partial !u_r}{\partial !q}!N\,!u_l "
        r"+ !\chi\left(!u_r, !u_l\right) = \sum_s \gamma^{s}_{rl}\,!u_s",
    )
    doc.mean(
        r"\gamma^{s}_{rl}",
        r"Hamel's coefficients, $\left[!u_r, !u_l\right]=\sum_s \gamma^{s}_{rl}\,!u_s$",
    )
    _own(doc, found)
    _zeros(doc, found)
    _listed(doc, found)
    _drift(doc, found)


def _own(doc: Manuscript, found: Coefficients) -> None:
    """χ."""
    if not found.structure:
        doc.say("Here all $!v$ are rates of coordinates, which commute: $!\\chi=!0$.")
        return
    doc.say(
        "Components in the axes of a moving body do not commute. With $\\nu_j$ the direction of "
        "one generalized velocity alone, their brackets are:"
    )
    rows: list[tuple[Runs, ...]] = []
    for (i, j), numbers in found.structure.items():
        names = [rf"\nu_{{{doc.notation.latex[doc.v[k]]}}}" for k in (i, j)]
        terms = [
            ("+" if x > 0 else "-") + rf"\nu_{{{doc.notation.latex[doc.v[k]]}}}"
            for k, x in enumerate(numbers)
            if x
        ]
        bracket = rf"\left[{names[0]}, {names[1]}\right]"
        rows.append(((Math(bracket),), (Math("".join(terms).lstrip("+")),)))
    doc.table(("bracket", "equals"), rows)


def _zeros(doc: Manuscript, found: Coefficients) -> None:
    """Which vanish, and why."""
    reasons: list[Runs] = [
        (Math(r"\gamma^{s}_{rr}=0,\; \gamma^{s}_{lr}=-\gamma^{s}_{rl}"), Text(": by definition;"))
    ]
    kinds = [kind for _, kind in _constraint_rows(doc)]
    holonomic = [found.free + k + 1 for k, kind in enumerate(kinds) if kind == "holonomic"]
    if holonomic and found.table:
        listing = ",".join(map(str, holonomic))
        text = (
            ": rates of position constraints stay zero along every motion that satisfies them "
            "(Frobenius);"
        )
        reasons.append((Math(rf"\gamma^{{s}}_{{rl}}=0,\; s={listing}"), Text(text)))
    if not found.drifts and doc.terms.has("Y"):
        text = ": r of a constraint row is multiplied by its velocity, which is zero, and l of a "
        text += "constraint row belongs to an equation for a multiplier."
        reasons.append((Text("not needed"), Text(text)))
    doc.say("Of these coefficients:")
    doc.items(reasons, tuple)
    if not found.table:
        doc.say("With one quasi-velocity there is no pair: no coefficient enters the equations.")


def _listed(doc: Manuscript, found: Coefficients) -> None:
    """Those that are not zero, pair by pair."""
    count = sum(not zero for zeros in found.vanishing.values() for zero in zeros)
    if not found.table:
        return
    if not count:
        doc.say("The free directions commute: all coefficients vanish.")
        return
    if count > MOST_LISTED:
        doc.say(f"The other {count} coefficients are too many to be listed.")
        return
    doc.say("The others, each a component of its bracket, are:")
    for (r, k), value in found.table.items():
        _pair(doc, found, r, k, value)
    doc.say("All that are not listed are zero.")


def _pair(doc: Manuscript, found: Coefficients, r: int, k: int, value: ca.SX) -> None:
    """γ^s of [u_r, u_k], and the bracket over them."""
    places = [s for s, zero in enumerate(found.vanishing[r, k]) if not zero]
    if not places:
        return
    stems = {s: rf"\gamma^{{{s + 1}}}_{{{r + 1}{k + 1}}}" for s in places}
    bracket = rf"\left[!u_{{{r + 1}}}, !u_{{{k + 1}}}\right]"
    doc.state(bracket, " + ".join(rf"{stems[s]}\,!u_{{{s + 1}}}" for s in places))
    column = ca.densify(value)[places]
    entries = doc.reader.whole(column, SHORT)
    if entries is None:
        entries = doc.read(column)
    if entries is None:
        doc.too_long(", ".join(stems.values()))
        return
    names = [doc.notation.fresh(f"gamma[{s + 1};{r + 1},{k + 1}]", stems[s]) for s in places]
    doc.lines(f"gamma[{r + 1},{k + 1}]", names, entries, column)


def _drift(doc: Manuscript, found: Coefficients) -> None:
    if not found.drifts:
        return
    doc.say(
        "Constraints that move add a direction that the mechanism is taken along, index 0, with "
        "the velocity one:"
    )
    doc.state(
        r"\gamma^{s}_{0l}",
        r"\sum_r c_r\,\gamma^{s}_{rl} + !Y^{s}\,\frac{\partial !u_l}{\partial t}",
    )


def _momenta(doc: Manuscript, found: Coefficients) -> None:
    doc.section("Momenta")
    doc.say(
        "The kinetic energy is written in all quasi-velocities before any constraint is put into "
        "it, for it is differentiated with respect to all of them. Its derivatives are the momenta "
        "$p_s$; only then the constraints hold:"
    )
    if not _rotors(doc.system).is_zero():
        doc.say(
            "Rotors that turn with a velocity which is no rate of a coordinate are left out of $T$ "
            "here: their angles are further coordinates, which nothing else depends on."
        )
    value = _momentum(doc.terms)
    s = doc.system
    at_motion = ca.substitute(ca.gradient(_kinetic(s), s.v), s.v, doc.terms.named("v"))
    doc.law(
        "momenta",
        r"!p",
        r"!U^T\frac{\partial T}{\partial !v}",
        value - ca.mtimes(found.directions.T, at_motion),
    )
    doc.vector("momentum", "p", value)
    doc.mean(r"!p", r"momenta of all quasi-velocities, $!U^T\partial T/\partial !v$")


def _equations(doc: Manuscript, found: Coefficients) -> None:
    doc.section("Boltzmann–Hamel equations")
    moving = r" - \sum_s \gamma^{s}_{0l}\,p_s" if found.drifts else ""
    doc.say(
        "Lagrange's equations in quasi-velocities keep a term for every coefficient. For each free "
        "direction, with $!u_l\\left[T\\right]$ the change of the kinetic energy along it while "
        "all quasi-velocities are held, and $V_l$ the bias of gravity and potential:"
    )
    turning = "" if _rotors(doc.system).is_zero() else r" + !u_l^T!J_R\,!!v"
    if turning:
        doc.mean(r"!J_R", "inertias of these rotors, on the diagonal")
    doc.law(
        "Boltzmann–Hamel",
        r"\dot{p}_l - \sum_{r,s} \gamma^{s}_{rl}\,w_r\,p_s"
        + moving
        + r" - !u_l\left[T\right]"
        + turning,
        r"!u_l^T\left(!Q - !V\right),\qquad l = 1,\ldots," + str(found.free),
        _left(doc.terms, doc.terms.wdot),
    )
    doc.mean(r"!V", "bias of gravity and potential, $!h$ where $!v=!0$")
    doc.say("The changes of the kinetic energy along the directions are:")
    value = _energy_change(doc.terms)
    if doc.vector("change", "T", value) and all(x == [0] for x in doc.entries["change"]):
        doc.say("It changes along none of them.")


def _momentum(terms: Terms) -> ca.SX:
    """p = ∂T̂/∂(w, ω_c) on the constraints, nv × 1, T̂(q, w, ω_c) = T(q, S w + R ω_c)."""
    energy, speeds, values = _energy(terms)
    return ca.substitute(ca.gradient(energy, speeds), speeds, values)


def _energy(terms: Terms) -> tuple[ca.SX, ca.SX, ca.SX]:
    """T̂ over free symbols of all quasi-velocities, these symbols, and what they are."""
    s, coefficients = terms.system, Coefficients(terms)
    speeds = ca.SX.sym("omega", coefficients.directions.size2())
    energy = ca.substitute(_kinetic(s), s.v, ca.mtimes(coefficients.directions, speeds))
    c = terms.of_independent(s.c) if terms.has("Y") else ca.SX(0, 1)
    return energy, speeds, ca.vertcat(terms.w, ca.substitute(c, s.v, terms.named("v")))


def _rotors(s: System) -> ca.SX:
    """Inertias of rotors that turn with velocities which are no rates, on the diagonal (nv × nv).

    The rotor's angle follows such a velocity by a nonholonomic constraint, which must not be put
    into T: only J v̇ is left of it."""
    result = ca.SX(s.v.numel(), s.v.numel())
    for load in s.model.loads:
        if isinstance(load, Armature):
            j = s.model.velocity_index(load.velocity)
            if not s.model.velocities[j].rate_of:
                result[j, j] += s.symbols.scalar(load.inertia)
    return result


def _kinetic(s: System) -> ca.SX:
    """T without these rotors."""
    rotors = _rotors(s)
    return s.T if rotors.is_zero() else s.T - 0.5 * ca.bilin(rotors, s.v, s.v)


def _energy_change(terms: Terms) -> ca.SX:
    """u_l[T̂] at constant quasi-velocities, nw × 1."""
    s = terms.system
    energy, speeds, values = _energy(terms)
    slope = ca.mtimes(s.N.T, ca.gradient(energy, s.q))
    return ca.substitute(ca.mtimes(terms.named("S").T, slope), speeds, values)


def _left(terms: Terms, wdot: ca.SX) -> ca.SX:
    """ṗ_l − Σ γ^s_rl w_r p_s − u_l[T] + u_lᵀ J_R v̇ − u_lᵀ (Q − V)."""
    coefficients, p = Coefficients(terms), _momentum(terms)
    nw, rotors = coefficients.free, _rotors(terms.system)
    rates = along(terms, p[:nw], wdot)
    if not rotors.is_zero():
        vdot = along(terms, terms.named("v"), wdot)
        rates = rates + ca.mtimes(terms.named("S").T, ca.mtimes(rotors, vdot))
    force = ca.mtimes(terms.named("S").T, active(terms.system))
    force = ca.substitute(force, terms.system.v, terms.named("v"))
    left = rates - _energy_change(terms) - force
    return left - ca.vertcat(*[_gyroscopic(terms, coefficients, p, k) for k in range(nw)])


def _gyroscopic(terms: Terms, found: Coefficients, p: ca.SX, other: int) -> ca.SX:
    """Σ γ^s_rl w_r p_s."""
    total = ca.SX(0)
    for r in range(found.free):
        if r != other:
            pair, sign = ((r, other), 1) if r < other else ((other, r), -1)
            total = total + sign * terms.w[r] * ca.dot(found.table[pair], p)
    return total + ca.dot(found.drift(other), p) if found.drifts else total


def _solution(terms: Terms) -> ca.SX:
    wdot = ca.SX.sym("wdot", terms.w.numel())
    return solved(terms, _left(terms, wdot), wdot)


BOLTZMANN_HAMEL = Road(
    name="boltzmann_hamel",
    title="Boltzmann–Hamel equations",
    about="Lagrange's equations in quasi-velocities, with the coefficients γ of their brackets",
    source="Hamel: Die Lagrange-Eulerschen Gleichungen der Mechanik, 1904",
    write=_write,
    accelerations=_solution,
    unknowns=lambda terms: terms.w.numel(),
    needs="energies alone, and the brackets of all directions: n_w (n_w − 1) / 2 columns of γ",
    fails="where [A; B] is singular; and wrongly, where constraints are put into T too early",
    left=_left,
)
