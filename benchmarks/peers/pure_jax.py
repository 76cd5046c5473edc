"""Our own equations in pure JAX: the statements of the NumPy backend in jax.numpy."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any


def dynamics(folder: Path, numpy: ModuleType) -> Callable[..., Any]:
    """f(x, u, p) over leading axes, of the module in `folder`; `numpy` is jax.numpy."""
    source = (folder / "_numpy.py").read_text("utf-8")
    body = re.search(r"^def _dynamics\(.*?(?=^def |\Z)", source, re.DOTALL | re.MULTILINE)
    assert body
    lines = body[0].replace("np.", "jnp.").splitlines()[1:]
    kept = [re.sub(r"out\[\.\.\., (\d+)\]", r"out[\1]", line) for line in lines]
    kept = list(itertools.takewhile(lambda line: "_status(" not in line, kept))
    text = "\n".join(["def dynamics(x, u, p):", "    t, out = 0.0, {}", *kept])
    text += (
        "\n    return jnp.stack([jnp.broadcast_to(out[k], x.shape[:-1]) for k in sorted(out)], -1)"
    )
    space: dict[str, Any] = {"jnp": numpy}
    exec(text, space)  # our own generated text
    return space["dynamics"]
