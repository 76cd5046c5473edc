"""The core's measured peak in flop/ns, and the flop of one evaluation of ours, sine and cosine
polynomials counted."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from peers.contest import HERE, NATIVE, ROWS, Contender, compiled

LITERAL = re.compile(r"-?0x[0-9a-f.]+p[+-]?\d+|\b\d+\.\d+\b")


def contenders(lanes: int) -> list[Contender]:
    """Chains of additions, of fused multiply-adds, and of both; each result is the flop of its
    row."""
    options = [
        "-O2",
        *NATIVE,
        "-ffp-contract=fast",
        "-fno-tree-vectorize",
        "-Wno-psabi",
        *([f"-DLANES={lanes}"] if lanes > 1 else []),
    ]
    library = compiled(f"peak{lanes}", {HERE / "peak.c": options})
    inputs = np.tile([1.0, 1e-9], (ROWS, 1))
    return [
        Contender("peak", library, inputs, 1, kind, tolerance=np.inf, variant=kind)
        for kind in ("add", "fma", "both")
    ]


def flop(contender: Contender) -> float:
    """Of a row of these chains, by running it."""
    import ctypes

    library = ctypes.CDLL(str(contender.library))
    library.bench_open(contender.argument.encode())
    row, out = (ctypes.c_double * 2)(1.0, 0.0), (ctypes.c_double * 1)()
    library.bench_loop(ctypes.c_long(1), row, ctypes.c_long(2), out, ctypes.c_long(1))
    return out[0]


def of_turn(source: Path) -> int:
    """Additions and multiplications of one sine with its cosine, counted in the generated C."""
    text = source.read_text()
    start = re.search(r"const (double|four) near =", text)
    if not start:
        return 0
    lines = text[start.start() : text.index(";", text.index("sin_r =", start.start()))]
    return len(re.findall(r"[-+*]", LITERAL.sub("N", lines)))


def vector_lanes() -> int:
    """Doubles of a vector register of this processor."""
    flags = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    return 8 if "avx512f" in flags else 4 if "avx2" in flags else 2
