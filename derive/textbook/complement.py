"""Trees of simple joints as Saha reads them: the decoupled natural orthogonal complement and the
pivots of U D Uᵀ.

Source: Saha, Dynamics of serial multibody systems using the decoupled natural orthogonal complement
matrices, J. Appl. Mech. 66 (1999). Twists are (ω, v) of the link's frame at its origin, written in
that frame, so that no ground frame enters.
"""

from __future__ import annotations

import casadi as ca

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.rotations import cross
from derive.mechanics.records import Link, System
from derive.mechanics.recursions.tree import twists
from derive.textbook.manuscript import Manuscript
from derive.textbook.names import words

FEWEST, MOST = 2, 8  # links for which the factors are written out


def complement(doc: Manuscript) -> None:
    """N_l, N_d, M = N_dᵀ N_lᵀ 𝓜 N_l N_d and its pivots, where the system is a tree of joints with
    one velocity each. Twists are (ω, v) at the links' origins, in their frames."""
    if not _fits(doc.system):
        return
    doc.section("Decoupled natural orthogonal complement")
    factors = _Factors(doc.system)
    _twists(doc, factors)
    _mass(doc, factors)
    _pivots(doc, factors)


def _fits(system: System) -> bool:
    links = system.links
    simple = all(len(link.columns) == 1 for link in links)
    return (
        simple
        and FEWEST <= len(links) <= MOST
        and not system.rows
        and len(links) == system.v.numel()
    )


class _Factors:
    """p_i, B_ij, M_i and what Saha's elimination makes of them; lists are over the links."""

    def __init__(self, system: System) -> None:
        self.links, self.v = system.links, system.v
        self.columns = [link.columns[0] for link in self.links]
        self.p = [_motion(link) for link in self.links]
        self.carried = [_carried(link) for link in self.links]  # B_i,parent
        self.M = [_spatial(link) for link in self.links]
        self.blocks = self._blocks()
        self.psi, self.pivots = self._eliminated()

    def _blocks(self) -> dict[tuple[int, int], ca.SX]:
        """B_ij of every link i and every link j that carries it, itself among them."""
        blocks: dict[tuple[int, int], ca.SX] = {}
        for i, link in enumerate(self.links):
            blocks[i, i] = ca.SX.eye(6)
            for j in range(i):
                if link.parent >= 0 and (link.parent, j) in blocks:
                    blocks[i, j] = ca.mtimes(self.carried[i], blocks[link.parent, j])
        return blocks

    def _eliminated(self) -> tuple[list[ca.SX], list[ca.SX]]:
        """ψ_i and m̂_i, tip to base."""
        hat, n = [ca.SX(m) for m in self.M], len(self.links)
        psi, pivots = [ca.SX()] * n, [ca.SX()] * n
        for i in reversed(range(n)):
            momentum = ca.mtimes(hat[i], self.p[i])
            pivots[i] = ca.mtimes(self.p[i].T, momentum)
            psi[i] = momentum / pivots[i]
            parent, B = self.links[i].parent, self.carried[i]
            if parent >= 0:
                # what the parent feels of the link once its joint has taken up what it can
                hat[parent] += ca.mtimes([B.T, hat[i] - ca.mtimes(momentum, psi[i].T), B])
        return psi, pivots

    @property
    def N_l(self) -> ca.SX:
        """The block lower triangular part of the orthogonal complement, 6n × 6n: how a twist passes
        from link j on to link i. A block that is not there is zero: j does not carry i."""
        n = len(self.links)
        return ca.blockcat(
            [[self.blocks.get((i, j), ca.SX(6, 6)) for j in range(n)] for i in range(n)]
        )

    @property
    def N_d(self) -> ca.SX:
        """The block diagonal part, 6n × nv: the motion axis pᵢ of each joint in the rows of its own
        link. Twists are N_l N_d v."""
        blocks = ca.SX(6 * len(self.links), self.v.numel())
        for i, column in enumerate(self.columns):
            blocks[6 * i : 6 * i + 6, column] = self.p[i]
        return blocks

    @property
    def U(self) -> ca.SX:
        """U_ij = p_iᵀ B_jiᵀ ψ_j, one on the diagonal."""
        U = ca.SX.eye(self.v.numel())
        for (j, i), block in self.blocks.items():
            if i != j:
                entry = ca.mtimes([self.p[i].T, block.T, self.psi[j]])
                U[self.columns[i], self.columns[j]] = entry
        return U

    @property
    def D(self) -> ca.SX:
        """The pivots, in the order of v."""
        pivots = ca.SX(self.v.numel(), 1)
        for column, pivot in zip(self.columns, self.pivots):
            pivots[column] = pivot
        return pivots


def _motion(link: Link) -> ca.SX:
    """p: the twist at the link's origin per joint rate."""
    omega, velocity = link.motion[0][:3], link.motion[0][3:]
    return ca.vertcat(*(ca.SX(x) for x in (*omega, *_sum(velocity, cross(link.b, omega)))))


def _sum(a: Vector, b: Vector) -> Vector:
    return [x + y for x, y in zip(a, b)]


def _carried(link: Link) -> ca.SX:
    """B: the twist of the link that a twist of its parent gives while the joint rests."""
    R = _matrix(link.R)
    arm = ca.mtimes(_skew(link.b), R.T) - ca.mtimes(R.T, _skew(link.a))
    return ca.blockcat([[R.T, ca.SX(3, 3)], [arm, R.T]])


def _spatial(link: Link) -> ca.SX:
    """M_i: ½ tᵀ M_i t is the link's kinetic energy."""
    inertia = link.inertia
    coupling = _skew(inertia.moment)
    return ca.blockcat(
        [[_matrix(inertia.tensor), coupling], [coupling.T, inertia.mass * ca.SX.eye(3)]]
    )


def _matrix(rows: Matrix) -> ca.SX:
    return ca.vertcat(*(ca.horzcat(*(ca.SX(x) for x in row)) for row in rows))


def _skew(vector: Vector) -> ca.SX:
    x, y, z = vector
    zero: Scalar = 0.0
    return _matrix([[zero, -z, y], [z, zero, -x], [-y, x, zero]])


def _twists(doc: Manuscript, factors: _Factors) -> None:
    """t = N_l N_d v."""
    doc.say(
        "The twists $!t_i=(!\\omega_i,!v_i)$ of all links, each at its link's origin and in its "
        "link's frame, follow from the generalized velocities in two decoupled steps (Saha's "
        "natural orthogonal complement): the block diagonal $!N_d$ holds the motions $!p_i$ of the "
        "joints, and the block triangular $!N_l$ holds the matrices $!B_{ij}$ that carry a twist "
        "from link $j$ out to link $i$:"
    )
    product = ca.mtimes([factors.N_l, factors.N_d, factors.v])
    doc.law("complement", r"!t", r"!N_l\,!N_d\,!v", _column_of_twists(factors) - product)
    doc.mean(r"!N_l,\; !N_d", "factors of the natural orthogonal complement, $!t=!N_l\\,!N_d\\,!v$")
    for i, link in enumerate(factors.links):
        _link(doc, factors, i, link)
    doc.state(r"!B_{ij}", r"!B_{i,i-1}\,!B_{i-1,j}")


def _column_of_twists(factors: _Factors) -> ca.SX:
    """(ω, v) of one link after the other, by recursion."""
    entries: list[Scalar] = []
    for omega, velocity in twists(factors.links, ca.vertsplit(factors.v)):
        entries += [*omega, *velocity]
    return ca.vertcat(*(ca.SX(x) for x in entries))


def _link(doc: Manuscript, factors: _Factors, i: int, link: Link) -> None:
    """p_i and B_i,parent."""
    index = i + 1
    doc.say("For {name}:", name=words(link.name))
    doc.matrix(f"p[{index}]", rf"!p_{{{index}}}^T", rf"p^{{{index}}}", factors.p[i].T)
    if link.parent >= 0:
        pair = f"{index},{link.parent + 1}"
        doc.matrix(f"B[{pair}]", rf"!B_{{{pair}}}", rf"B^{{{pair}}}", factors.carried[i])


def _mass(doc: Manuscript, f: _Factors) -> None:
    doc.say(
        "With the links' own mass matrices $!M_i$ on the diagonal of $!E$, the mass matrix of the "
        "tree is:"
    )
    whole = ca.diagcat(*f.M)
    N = ca.mtimes(f.N_l, f.N_d)
    rotors = doc.system.M_extra
    more = r" + !M_r" if rotors.nnz() else ""
    doc.law(
        "mass by complement",
        r"!M",
        r"!N_d^T\,!N_l^T\,!E\,!N_l\,!N_d" + more,
        doc.system.M - ca.mtimes([N.T, whole, N]) - rotors,
    )
    if more:
        doc.say("where $!M_r$ is the inertia of rotors and added coordinates.")


def _pivots(doc: Manuscript, f: _Factors) -> None:
    if doc.system.M_extra.nnz():
        return
    doc.say(
        "Eliminated from the tip to the base it is $!U\\,!D\\,!U^T$, whose pivots are the inertias "
        "that the joints feel while everything beyond them is free (articulated bodies):"
    )
    doc.state(r"\hat{m}_i", r"!p_i^T\,\hat{!M}_i\,!p_i,\qquad !\psi_i = \hat{!M}_i\,!p_i/\hat{m}_i")
    doc.state(
        r"\hat{!M}_{i-1}",
        r"!M_{i-1} + !B_{i,i-1}^T\left(\hat{!M}_i - \hat{m}_i\,!\psi_i\,!\psi_i^T\right)!B_{i,i-1}",
    )
    U, D = f.U, f.D
    doc.law("U D U^T", r"!M", r"!U\,!D\,!U^T", doc.system.M - ca.mtimes([U, ca.diag(D), U.T]))
    doc.say(
        "The factors have $U_{ij}=!p_i^T!B_{ji}^T!\\psi_j$. The entries of $!D$ are the pivots "
        "$\\hat{m}_i$."
    )
    doc.vector("m_hat", r"\hat{m}", D)
    doc.mean(r"!U,\; !D", "factors of the mass matrix, tip to base, $!M=!U\\,!D\\,!U^T$")
