"""JAX: the functions as XLA custom calls of the compiled library, with derivatives of the state
derivative by its forward and adjoint products."""

from __future__ import annotations

from typing import Any

from codegen import text
from codegen.passes.lanes import is_batched
from codegen.program import Program
from codegen.targets.records import Target

DERIVATIVES = ("dynamics_forward", "dynamics_adjoint", "jacobian_p", "jacobian_t")


def files(program: Program) -> dict[str, str]:
    """NAME_jax.py and NAME_jax.c."""
    data: dict[str, Any] = {
        "prefix": program.name,
        "PREFIX": program.name.upper(),
        "batched": [kernel.name for kernel in program.kernels if is_batched(kernel)],
        "differentiable": all(map(program.has, ("dynamics", *DERIVATIVES[:2]))),
    }
    return {
        f"{program.name}_jax.py": text.render("jax.py.j2", program, **data),
        f"{program.name}_jax.c": text.render("jax.c.j2", program, **data),
    }


JAX = Target(
    "jax",
    "XLA custom calls of the compiled library, with derivatives",
    files,
    needs=DERIVATIVES,
    readme="jax.md.j2",
)
