"""What the module does with NaN, ±Inf, denormals and huge numbers in any argument: the graph's own result, or a refusal.

A number that comes out must be the one the graph gives; nothing that is no number may come out at all.
"""

import importlib
from pathlib import Path

import numpy as np
import pytest

from derive.formulations import equations
from derive.mechanics import system
from derive.model import load
from hamel.pipeline import temporary_module
from hamel.verify.evidence import graph, samples
from hamel.verify.reference import reference

MODELS = Path(__file__).parent.parent / "models"
STRANGE = {"nan": np.nan, "inf": np.inf, "-inf": -np.inf, "denormal": 5e-324, "huge": 1e300}
QUICK = ("four_bar", "free_body")


def spoiled(place):
    """The arguments with one entry after the other made strange."""
    for what, value in STRANGE.items():
        for k, argument in enumerate(place):
            for i in range(np.size(argument)):
                changed = np.array(argument, dtype=float)
                changed.reshape(-1)[i] = value
                yield f"argument {k}[{i}] {what}", (*place[:k], changed if changed.ndim else float(changed), *place[k + 1 :])


def wrong_answers(call, told, place, exact):
    """Where a result is not finite, or is finite where the graph's is not, or is another."""
    found = []
    for what, arguments in spoiled(place):
        try:
            got = np.ravel(call(*arguments))
        except FloatingPointError:
            continue
        wanted = np.ravel(told(*arguments))
        if not np.isfinite(got).all():
            found.append(f"{what}: {got} came out")
        elif "huge" in what or "denormal" in what or not exact:
            continue  # where squares or quotients overflow, the order of operations decides; nothing to be done needs no numbers
        elif not np.isfinite(wanted).all():
            found.append(f"{what}: {got} for {wanted}")
        elif (
            exact and "huge" not in what and not np.allclose(got, wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max(initial=1.0))
        ):
            found.append(f"{what}: {got} is not {wanted}")
    return found


@pytest.mark.parametrize(
    "name",
    [pytest.param(path.stem, marks=() if path.stem in QUICK else pytest.mark.slow) for path in sorted(MODELS.glob("*.yaml"))],
)
def test_what_comes_out_is_right_or_nothing_comes_out(name):
    mechanics = system(load(MODELS / f"{name}.yaml"))
    chosen = equations(mechanics)
    told = graph(chosen)
    sample = samples(mechanics, reference(mechanics.model), 1, 0)[0]
    with temporary_module(chosen) as module, np.errstate(all="ignore"):
        for backend in (module, importlib.import_module(f"{module.__name__}._numpy")):
            for function in chosen.functions:
                if not hasattr(backend, function.name):
                    continue
                taken = np.concatenate([sample.q, sample.v, sample.outcome.vdot])
                x = told("state", sample.t, np.concatenate([sample.q, sample.v]), sample.u, sample.p)
                if function.x is not None:
                    count = function.x.symbols.numel()
                    x = np.concatenate([sample.q, sample.q]) if function.name == "difference" else taken[:count]
                place = (sample.t, x, sample.u, sample.p)
                found = wrong_answers(
                    getattr(backend, function.name),
                    lambda *a, n=function.name: told(n, *a),
                    place,
                    exact=function.iteration is None,
                )
                assert not found, (backend.__name__, function.name, found[:3])
