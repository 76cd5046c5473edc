"""What is simulated is verified first, as quickly as what is built: `simulate` runs nothing that
`build` refuses. The outcome is stored by content, so that it costs once."""

from __future__ import annotations

from collections.abc import Callable, Collection
from types import ModuleType

import casadi as ca

from derive.diagnostics import NO_VALUE, VerificationError
from derive.formulations.charts import together
from derive.formulations.records import Equations
from hamel.build import store
from hamel.build.keys import content_key
from hamel.build.options import QUICK_STATES, affordable
from hamel.verify import CheckResult, quick_verification
from hamel.verify.checks import LOADED, QUICK
from hamel.verify.reference.outcome import reference
from hamel.verify.suite import evidence, results

VERIFIED = "verified"  # the kind of entry in the store


def assure(
    plain: Equations,
    held: Equations,
    module: Callable[[], ModuleType],
    real: str = "float64",
    functions: Collection[str] | None = None,
) -> None:
    """Raise VerificationError unless the module of that precision and these functions, asked for
    when it is needed, agrees with the independent derivation.

    `held` are the equations of the module: `plain` ones, or what an enforcement made of them by
    terms that are zero on the constraints. Then the two are looked at one after the other.
    """
    key = content_key(plain.system.model.content(), real, _listing(held))
    if store.stored(VERIFIED, key) is not None:
        return
    check_all(held, _checks(plain, held, module, functions), "nothing is simulated")
    store.put(VERIFIED, key, store.Entry(data={"model": plain.system.model.name}))


def check_all(
    equations: Equations, checks: tuple[CheckResult, ...], then: str, where: str = ""
) -> None:
    """Raise VerificationError where one of the checks failed; `then` says what does not happen,
    `where` at which state."""
    failed = [check.failure for check in checks if not check.passed]
    if failed:
        raise VerificationError(
            f"{equations.system.model.name}, choice {together(equations)}: "
            f"verification failed, {then}: {'; '.join([*failed, where] if where else failed)}",
            NO_VALUE if any(check.failure.endswith("not finite") for check in checks) else "",
        )


def _checks(
    plain: Equations,
    held: Equations,
    module: Callable[[], ModuleType],
    functions: Collection[str] | None,
) -> tuple[CheckResult, ...]:
    model, states = plain.system.model, affordable(plain, QUICK_STATES)
    if _listing(plain) == _listing(held) or held.charts:
        return quick_verification(model, held, module, states, functions=functions).checks
    ref = reference(model)
    terms = results(evidence(ref, plain, None, states, 0), QUICK)
    return (*terms, *results(evidence(ref, held, module(), states, 0), LOADED))


def _listing(equations: Equations) -> str:
    """The state derivative, every instruction, of all charts."""
    slots = {argument.name: argument.symbols for argument in equations.arguments}
    arguments = [slots.get(name, ca.SX(0, 1)) for name in ("t", "x", "u", "p")]
    dynamics = equations.function("dynamics").result.value
    text = ca.Function("dynamics", arguments, [dynamics]).serialize()
    return "".join([equations.choice, text, *map(_listing, equations.charts)])
