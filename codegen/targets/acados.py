"""acados: the discrete model x⁺ = φ(x, u) in its generic C interface, with Jacobian and Hessian,
and a function that fills an AcadosModel.

Source of the interface: R. Verschueren et al., acados — a modular open-source framework for fast
embedded optimal control, Math. Prog. Comp. 14 (2022) 147-183. The derivatives are those of the
classical Runge-Kutta step itself, the Hessian by its adjoint: Griewank, Walther, Evaluating
Derivatives, chapter 5.
"""

from __future__ import annotations

from typing import Any

from codegen import text
from codegen.program import Program
from codegen.targets.records import HELPERS, WIDEST, Target, is_apart, unsteady

FOLDER = "acados"
TAKER = "an optimizer"
NEEDS = ("derivatives", "dynamics_hessian")


def files(program: Program) -> dict[str, str]:
    """acados/NAME_acados.c, which includes the C of the module, and NAME_acados.py."""
    called = ("dynamics", *NEEDS)
    long = [k.name for k in program.kernels if k.name in called and is_apart(k)]
    data: dict[str, Any] = {
        "prefix": program.name,
        "PREFIX": program.name.upper(),
        "long": long,
        "helpers": HELPERS,
        "nx": len(program.argument("x").names),
        "nu": len(program.argument("u").names),
        "np": len(program.argument("p").names),
    }
    return {
        f"{FOLDER}/{program.name}_acados.c": text.render("acados.c.j2", program, **data),
        f"{program.name}_acados.py": text.render("acados.py.j2", program, **data),
    }


def refusal(program: Program) -> str:
    """One state of one kind, in float64, with its matrices of derivatives."""
    reason = unsteady(program, TAKER)
    if reason:
        return reason
    if program.real.words:
        return f"acados computes in float64, not in {program.real.name}"
    if not program.has("dynamics_hessian"):
        size = len(program.argument("x").names)
        return f"{size} states are too many for dense Hessians; up to {WIDEST} are not"
    return ""


ACADOS = Target(
    "acados",
    "generic discrete model of acados in C, with Jacobian and Hessian",
    files,
    needs=NEEDS,
    refusal=refusal,
    taker=TAKER,
    readme="acados.md.j2",
)
