"""The checks of targets on request, each by the tool that uses the target. To add one: a file with
a TargetCheck, and its line here."""

from hamel.verify.targets.acados import ACADOS
from hamel.verify.targets.casadi import CASADI
from hamel.verify.targets.cortex_m import CORTEX_M
from hamel.verify.targets.cpp import CPP
from hamel.verify.targets.fmu import FMU
from hamel.verify.targets.fmu2 import FMU2
from hamel.verify.targets.jax import JAX
from hamel.verify.targets.matlab import MATLAB
from hamel.verify.targets.numba import NUMBA
from hamel.verify.targets.records import Subject, TargetCheck
from hamel.verify.targets.wasm import WASM

TARGET_CHECKS: tuple[TargetCheck, ...] = (
    CASADI,
    ACADOS,
    CORTEX_M,
    CPP,
    FMU,
    FMU2,
    NUMBA,
    JAX,
    MATLAB,
    WASM,
)

__all__ = ["TARGET_CHECKS", "Subject", "TargetCheck"]
