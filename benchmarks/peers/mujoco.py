"""MuJoCo in C: a tree's smooth dynamics step by step, or all of mj_forward with its soft loops."""

from __future__ import annotations

import sysconfig
from pathlib import Path

import numpy as np

from peers.casadi_c import Read
from peers.contest import HERE, NATIVE, Contender, Unavailable, compiled

SITE = Path(sysconfig.get_paths()["purelib"]) / "mujoco"
SOFT = 1e-2  # what its loops give way


def contender(
    file: Path, inputs: np.ndarray, size: int, read: Read, full: bool = False
) -> list[Contender]:
    found = sorted(SITE.glob("libmujoco.so*"))
    if not found:
        raise Unavailable("MuJoCo is not installed: pip install mujoco")
    options = ["-O2", *NATIVE, f"-I{SITE}/include"]
    library = compiled(
        "mujoco", {HERE / "mujoco.c": options}, [str(found[0]), f"-Wl,-rpath,{SITE}"]
    )
    kind = "full" if full else "minimal"
    made = Contender(
        "MuJoCo", library, inputs, size, f"{kind} {file.resolve()}", read, variant=kind
    )
    return [made if not full else Contender(**{**vars(made), "tolerance": SOFT})]


def four_bars(n: int, place: Path) -> Path:
    """IFToMM A02 with n four-bars of rods of one metre and one kilogram, loops closed by
    `connect`."""
    lines = ['<mujoco><compiler angle="radian"/><option gravity="0 -9.81 0"/>']
    lines.append(
        '<default><equality solref="0.002 1" solimp="0.9999 0.9999 0.001 0.5 2"/></default><worldbody>'
    )
    rod = '<inertial pos="0.5 0 0" mass="1" diaginertia="0.0001 0.0833333333333333333 0.0833333333333333333"/>'
    for i in range(n + 1):
        lines.append(f'<body name="crank{i}" pos="{i} 0 0"><joint name="q{i}" axis="0 0 1"/>{rod}')
        if i < n:
            lines.append(
                f'<body name="rod{i + 1}" pos="1 0 0"><joint name="s{i + 1}" axis="0 0 1"/>{rod}</body>'
            )
        lines.append("</body>")
    lines.append("</worldbody><equality>")
    lines += [f'<connect body1="rod{i}" body2="crank{i}" anchor="1 0 0"/>' for i in range(1, n + 1)]
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_text("\n".join([*lines, "</equality></mujoco>"]) + "\n")
    return place
