"""The checks of steps see an error that is planted in the runtime: nothing is published.

Of hamel.verify.checks: steps.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import hamel
from codegen import compiler
from derive.diagnostics import VerificationError
from hamel.build import pipeline
from tests.scenes import MODELS

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
PLANTED = {
    "rk4 step": ("weight[] = {1.0 / 6.0, 1.0 / 3.0", "weight[] = {1.0 / 6.0, 1.001 / 3.0"),
    "implicit step": ("z[i] += U[ROSENBROCK_STAGES - 1][i]", "z[i] += 1.1 * U[ROSENBROCK_STAGES - 2][i]"),
    "slopes of rk4": ("K[c][i] += B[i * INPUTS + c - NX]", "K[c][i] += 1.01 * B[i * INPUTS + c - NX]"),
    "slopes of the Jacobian": ("+= H[i * SENSES + j] * s->D[c][j]", "+= 0.0 * H[i * SENSES + j] * s->D[c][j]"),
}  # fmt: skip


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] if k else []) for k, name in enumerate(PLANTED)],
)
def test_an_error_in_the_runtime_is_seen(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    emit = pipeline.emit

    def planted(program):
        texts = emit(program)
        changed = {n: text.replace(*PLANTED[name]) for n, text in texts.items()}
        assert changed != texts
        return changed

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(pipeline, "emit", planted)
    with pytest.raises(VerificationError, match="step"):
        hamel.build(
            MODELS / "cart_pole.yaml",
            out=tmp_path / "cart_pole",
            functions=("default", "step", "step_sensitivity"),
        )
    assert not (tmp_path / "cart_pole").exists()
