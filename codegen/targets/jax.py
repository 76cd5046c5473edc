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
    curves = program.has("dynamics_hessian")
    bends = curves and program.has("jacobian_forward")
    data: dict[str, Any] = {
        "prefix": program.name,
        "PREFIX": program.name.upper(),
        "batched": [kernel.name for kernel in program.kernels if is_batched(kernel)],
        "curves": curves,
        "bends": bends,
        "affine": bends and _affine(program),
        "differentiable": all(map(program.has, ("dynamics", *DERIVATIVES[:2]))),
    }
    return {
        f"{program.name}_jax.py": text.render("jax.py.j2", program, **data),
        f"{program.name}_jax.c": text.render("jax.c.j2", program, **data),
    }


def _affine(program: Program) -> bool:
    """Whether ẋ is affine in u: the second derivative by u is zero by structure."""
    nx, nu = (len(program.argument(name).names) for name in "xu")
    values = program.kernel("dynamics_hessian").outputs
    places = [(nx + i) * (nx + nu) + nx + j for i in range(nu) for j in range(nu)]
    return all(values[place] == 0.0 for place in places)


JAX = Target(
    "jax",
    "XLA custom calls of the compiled library, with derivatives",
    files,
    needs=DERIVATIVES,
    readme="jax.md.j2",
)
