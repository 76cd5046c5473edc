"""∂ẋ/∂x and ∂ẋ/∂u from the slopes of inverse dynamics: M ∂v̇ = −∂(M v̇ + h − Q), v̇ held.

With τ(q, v, v̇) = M v̇ + h − Q, v = S w + R c, v̇ = S ẇ + σ and λ = Rᵀ τ, so that Sᵀ τ = 0:

    (Sᵀ M S) ∂ẇ = −Sᵀ (∂τ/∂q − ∂(Aᵀλ)/∂q + ∂τ/∂v ∂v + M ∂v̇)        (λ held, ẇ held in ∂v̇)
    Y ∂v = [∂c − ∂(A v); −∂(B v)],   Y ∂v̇ = [∂β − ∂(A v̇); −∂(B v̇ + Ḃ v)],   Y = [A; B], Y⁻¹ = [R S]

since Y S = [0; 1] gives ∂S = −R ∂A S − S ∂B S. Nothing that was eliminated is differentiated. A
tree on a free root does not feel where it is, how it is turned and how fast it goes: with u = 0,
g = 0 and a' = u̇ + ω × u − Rᵀ g in the place of u̇ those columns are zero but for closed forms.

Sources: J. Carpentier, N. Mansard, RSS 2018; S. Singh, R. P. Russell, P. M. Wensing, IEEE RA-L 7
(2022) 1776–1783.
"""

from __future__ import annotations

from collections.abc import Iterator

from derive.formulations.motion import Motion
from derive.formulations.structured.records import Slopes
from derive.formulations.structured.reduction import of_reduction
from derive.formulations.structured.tree import is_tree, looped, of_tree
from derive.mechanics.records import System

__all__ = ["Slopes", "by_structure", "looped"]


def by_structure(system: System, motion: Motion) -> Iterator[Slopes]:
    """Every way there is; none in generalized velocities that multipliers hold together, and none
    with first-order states."""
    if system.model.states:
        return iter(())
    return (of_tree if is_tree(system, motion) else of_reduction)(system, motion)
