"""First-order states z: their rates ż = r(t, q, v, z, u, p) and what they store."""

from __future__ import annotations

import casadi as ca

from derive.mechanics.scene import Scene


def rates_of_states(scene: Scene) -> ca.SX:
    """ż, nz × 1, in the units of the states per second."""
    rates = [scene.over_v(ca.SX(scene.symbols.scalar(x.rate))) for x in scene.model.states]
    return ca.vertcat(*rates) if rates else ca.SX(0, 1)


def energy_of_states(scene: Scene) -> ca.SX:
    """The energy (J) that the states store, of those of which the file says it."""
    energies = [ca.SX(scene.symbols.scalar(x.energy)) for x in scene.model.states if x.energy]
    return sum(energies, ca.SX(0))
