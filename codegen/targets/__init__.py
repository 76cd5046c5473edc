"""The targets, in the order they are emitted: those of every module, and those on request. To add
one: a file with a Target, and its line here."""

from codegen.targets.acados import ACADOS
from codegen.targets.c import C
from codegen.targets.casadi import CASADI
from codegen.targets.charts import CHARTS
from codegen.targets.cortex_m import CORTEX_M
from codegen.targets.cpp import CPP
from codegen.targets.example import EXAMPLE
from codegen.targets.extension import EXTENSION
from codegen.targets.fmu import FMU
from codegen.targets.fmu2 import FMU2
from codegen.targets.jax import JAX
from codegen.targets.manifest import MANIFEST
from codegen.targets.matlab import MATLAB
from codegen.targets.nullspace import NULLSPACE
from codegen.targets.numba import NUMBA
from codegen.targets.numpy import NUMPY
from codegen.targets.package import PACKAGE
from codegen.targets.records import Target
from codegen.targets.simulate import SIMULATE
from codegen.targets.taylor import TAYLOR
from codegen.targets.wasm import WASM

TARGETS: tuple[Target, ...] = (
    C,
    CHARTS,
    NULLSPACE,
    EXTENSION,
    SIMULATE,
    TAYLOR,
    NUMPY,
    PACKAGE,
    EXAMPLE,
    MANIFEST,
)

# emitted where `--target` names them
ON_REQUEST: tuple[Target, ...] = (
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

__all__ = ["ON_REQUEST", "TARGETS", "Target"]
