"""What is to be reached: our time over the peer's, at most. Best of the variants of each."""

from __future__ import annotations

from dataclasses import dataclass

from peers.peak import vector_lanes


@dataclass(frozen=True)
class Target:
    function: str
    model: str
    peer: str
    ratio: float


SCALAR, BATCH, INVERSE, MASS = "dynamics", "dynamics batch", "inverse_dynamics", "mass"
DERIVATIVES, DERIVATIVES_BATCH, CONTRACTION = "derivatives", "derivatives batch", "contraction"
FRAMES, REGRESSOR = "pose and Jacobian", "regressor"
AUGMENTED, PYDY, PINOCCHIO, THROUGH_CASADI = (
    "augmented, CasADi SX",
    "SymPy Kane → PyDy C + LU",
    "Pinocchio C++",
    "Pinocchio→CasADi→C",
)
AUGMENTED_MX = "augmented, CasADi MX"
LANES, PEAK, BEST = "CasADi C in lanes", "the core's peak", "best peer"
CHAINS = (2, 5, 10, 20, 50)

TARGETS = (
    Target(SCALAR, "panda", PINOCCHIO, 0.12),
    Target(SCALAR, "panda", THROUGH_CASADI, 0.65),
    Target(SCALAR, "panda", "MuJoCo", 0.24),
    Target(SCALAR, "panda", "SymForce", 0.75),
    Target(SCALAR, "ur5", THROUGH_CASADI, 0.60),
    Target(SCALAR, "stanford_arm", THROUGH_CASADI, 0.60),
    Target(SCALAR, "humanoid", THROUGH_CASADI, 0.70),
    Target(BATCH, "panda", PINOCCHIO, 0.015),
    Target(BATCH, "panda", LANES, 0.7),
    Target(BATCH, "panda", "JAX", 0.1),
    Target(BATCH, "panda", "MuJoCo rollout", 0.1),
    Target(BATCH, "panda", "numba", 0.1),
    Target(SCALAR, "snake3", AUGMENTED, 0.35),
    Target(SCALAR, "snake3", PYDY, 0.25),
    Target(SCALAR, "four_bar", AUGMENTED, 0.6),
    Target(SCALAR, "four_bar", PYDY, 0.45),
    Target(SCALAR, "four_bars40", AUGMENTED, 0.6),
    Target(SCALAR, "four_bars40", AUGMENTED_MX, 0.3),
    Target(SCALAR, "four_bars40", "MuJoCo", 0.05),
    Target(SCALAR, "four_bars40", "Pinocchio lcaba", 0.05),
    *(Target(SCALAR, f"chain{n}", BEST, 0.8) for n in CHAINS),
    Target(INVERSE, "panda", THROUGH_CASADI, 0.75),
    Target(MASS, "panda", THROUGH_CASADI, 0.75),
    Target(FRAMES, "panda", PINOCCHIO, 0.2),
    Target(REGRESSOR, "panda", PINOCCHIO, 0.2),
    Target(DERIVATIVES, "panda", PINOCCHIO, 0.14),
    Target(DERIVATIVES, "panda", THROUGH_CASADI, 0.5),
    # states side by side: four of them, or eight
    Target(DERIVATIVES_BATCH, "panda", PINOCCHIO, 0.2 / vector_lanes()),
    Target(DERIVATIVES, "humanoid", PINOCCHIO, 0.3),
    Target(CONTRACTION, "panda", DERIVATIVES, 2.0),
    Target(CONTRACTION, "humanoid", DERIVATIVES, 2.0),
    Target(SCALAR, "panda", PEAK, 1 / 0.7),
    Target(BATCH, "panda", PEAK, 1 / 0.6),
)
