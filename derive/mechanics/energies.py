"""T, V, what of them is balanced by power, and that power."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import casadi as ca

from derive.expressions.scalars import Scalar, Vector
from derive.mechanics.analytic import Lagrangian
from derive.mechanics.loads import Loads
from derive.mechanics.recursions.tree import gravity_energy, kinetic_energy
from derive.mechanics.scene import Scene
from derive.mechanics.states import energy_of_states


@dataclass(frozen=True)
class Energies:
    """Of the links in `scene`, of what `loads` store, of the energies `extra` that the file gives
    by formula, and of states of its own; `zdot` is their rate. Each is written down when it is
    asked for, once.

    `only_formulas`: power leaves out the links, where neither they nor gravity change with time.
    """

    scene: Scene
    loads: Loads
    extra: Lagrangian
    gravity: Vector
    zdot: ca.SX
    only_formulas: bool

    @functools.cached_property
    def kinetic(self) -> ca.SX:
        """T."""
        return self._of_links + self.extra.T

    @functools.cached_property
    def potential(self) -> ca.SX:
        """V, what states store included."""
        still = self._lifted + self.extra.V + self.loads.stored
        return still + self._stored if self.scene.model.states else still

    @functools.cached_property
    def balanced(self) -> ca.SX:
        """T₂ − T₀ + V = T + V − (T₁ + 2 T₀): where rates are prescribed T + V is not conserved."""
        total = self.kinetic + self.potential
        return total if self.extra.missing.is_zero() else total - self.extra.missing

    @functools.cached_property
    def power(self) -> ca.SX:
        """Of the loads' forces, and what changes with time by itself. Where a mass depends on t,
        M v̇ has no part Ṁ v: what leaves takes ½ ṁ v² along."""
        s, formulas = self.scene.symbols, self.extra.V + self.loads.stored
        told = formulas if self.only_formulas else self.potential + self._of_links
        by_time = ca.jtimes(ca.SX(told), s.t, ca.SX(1)) - self.extra.explicit
        given = self.loads.power + by_time
        states = self.scene.model.states
        return given + ca.jtimes(self._stored, s.z, self.zdot) if states else given

    @functools.cached_property
    def _of_links(self) -> ca.SX:
        return ca.SX(kinetic_energy(self.scene.links, self.scene.numbers))

    @functools.cached_property
    def _lifted(self) -> Scalar:
        scene = self.scene
        return gravity_energy(scene.links, scene.positions, scene.rotations, self.gravity)

    @functools.cached_property
    def _stored(self) -> ca.SX:
        return energy_of_states(self.scene)
