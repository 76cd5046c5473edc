"""Pinocchio: its own C++ (`aba`, `rnea`, `crba`), and the same algorithms through CasADi's C
generator."""

from __future__ import annotations

import functools
import sysconfig
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from derive.model.records import Model
from hamel.verify.reference.outcome import reference, state_of
from peers.casadi_c import Read, of_matrices, of_source
from peers.contest import BUILD, HERE, NATIVE, Contender, Unavailable, compiled, run

_writing = threading.Lock()
# lcaba was seen to be off by 2e-3 where loops of a plane are closed in space; constraintDynamics is
# exact and slower
SOFT = 1e-2
SITE = Path(sysconfig.get_paths()["purelib"])
PREFIX = SITE / "cmeel.prefix/include"
EIGEN = next(
    (path for path in (PREFIX / "eigen3", Path("/usr/include/eigen3")) if path.exists()),
    Path("/usr/include/eigen3"),
)
FLAGS = (
    *(
        "-std=c++17",
        "-DNDEBUG",
        "-fno-gnu-unique",
        "-DBOOST_MPL_LIMIT_LIST_SIZE=30",
        "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30",
    ),
    *("-DBOOST_FUSION_INVOKE_MAX_ARITY=12", "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS"),
    *(
        "-isystem",
        f"{SITE}/cmeel.prefix/include",
        "-isystem",
        str(EIGEN),
        "-isystem",
        f"{SITE}/casadi/include",
    ),
)


def written(model: Any, name: str) -> Path:
    """The tree as text for tree.hpp. Entries of rotations within 1e-12 of 0 and ±1 are made exact,
    which saves CasADi work."""
    path = BUILD / "models" / f"{name}.tree"
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = [_numbers(model.gravity.linear)]
    for i in range(1, model.njoints):
        kind, axis = _kind(model.joints[i])
        place, body = model.jointPlacements[i], model.inertias[i]
        R = np.where(
            np.abs(place.rotation - np.round(place.rotation)) < 1e-12,
            np.round(place.rotation),
            place.rotation,
        )
        numbers = (
            axis,
            R.ravel(),
            place.translation,
            [body.mass],
            body.lever,
            body.inertia.ravel(),
        )
        lines.append(f"{model.parents[i]} {kind} " + " ".join(_numbers(part) for part in numbers))
    path.write_text("\n".join(lines) + "\n")
    return path


def _numbers(values: Any) -> str:
    return " ".join(repr(float(x)) for x in values)


def model_of(model: Model) -> Any:
    """A tree of revolute and sliding joints in hamel's records as Pinocchio's model."""
    from hamel.verify.reference.engines.pinocchio import tree

    start = np.zeros(len(model.coordinates))
    return tree(model, state_of(reference(model), 0.0, start, np.zeros(len(model.velocities))))


def _kind(joint: Any) -> tuple[str, np.ndarray]:
    name = joint.shortname().removeprefix("JointModel")
    if name.endswith("Unaligned"):
        return name[0], joint.extract().axis if hasattr(joint, "extract") else joint.axis
    return {"FreeFlyer": "Free"}.get(name, name), np.zeros(3)


def library() -> Path:
    """Its own algorithms in double precision: minutes of templates."""
    _check_headers()
    return compiled("pinocchio", {HERE / "pinocchio.cpp": ["-O3", *NATIVE, *FLAGS]})


def derivatives_library() -> Path:
    """Its analytic derivatives of forward dynamics."""
    _check_headers()
    return compiled(
        "pinocchio_derivatives",
        {HERE / "pinocchio_derivatives.cpp": ["-O3", *NATIVE, *FLAGS]},
    )


def derivatives(tree: Path, inputs: np.ndarray, size: int, read: Read) -> Contender:
    """v̇, ∂v̇/∂q, ∂v̇/∂v and M⁻¹ by `computeABADerivatives`."""
    library = derivatives_library()
    return Contender("Pinocchio C++", library, inputs, size, str(tree.resolve()), read)


def frames(argument: str, inputs: np.ndarray, size: int) -> Contender:
    """Pose and Jacobian of a frame by `computeFrameJacobian`."""
    _check_headers()
    library = compiled(
        "pinocchio_frames", {HERE / "pinocchio_frames.cpp": ["-O3", *NATIVE, *FLAGS]}
    )
    return Contender("Pinocchio C++", library, inputs, size, argument)


def regressor(tree: Path, inputs: np.ndarray, size: int, read: Read) -> Contender:
    """Y by `computeJointTorqueRegressor`."""
    _check_headers()
    library = compiled(
        "pinocchio_regressor", {HERE / "pinocchio_regressor.cpp": ["-O3", *NATIVE, *FLAGS]}
    )
    return Contender("Pinocchio C++", library, inputs, size, str(tree.resolve()), read)


def generated_derivatives(tree: Path, inputs: np.ndarray, nv: int, read: Read) -> list[Contender]:
    """v̇, ∂v̇/∂q, ∂v̇/∂v and ∂v̇/∂u: CasADi's Jacobians of `aba` on casadi::SX, of joints with one
    velocity."""
    shapes = [(nv, 1), (nv, nv), (nv, nv), (nv, nv)]
    return [
        contender
        for source in slopes(tree)
        for contender in of_matrices("Pinocchio→CasADi→C", source, inputs, shapes, read)
    ]


def loops_library() -> Path:
    """Those for closed loops."""
    _check_headers()
    return compiled("pinocchio_loops", {HERE / "pinocchio_loops.cpp": ["-O2", *NATIVE, *FLAGS]})


def maker() -> Path:
    """The program that writes C of the algorithms on casadi::SX."""
    _check_headers()
    link = [f"-L{SITE}/casadi", "-lcasadi", f"-Wl,-rpath,{SITE}/casadi"]
    return compiled(
        "pinocchio_casadi", {HERE / "pinocchio_casadi.cpp": ["-O1", *FLAGS]}, link, shared=False
    )


def slopes(tree: Path) -> list[Path]:
    """C that CasADi makes of `aba` on casadi::SX and its Jacobians, for both conventions."""
    _check_headers()
    link = [f"-L{SITE}/casadi", "-lcasadi", f"-Wl,-rpath,{SITE}/casadi"]
    # it only writes: half the time to compile
    by = compiled(
        "pinocchio_slopes", {HERE / "pinocchio_slopes.cpp": ["-O0", *FLAGS]}, link, shared=False
    )
    folder = BUILD / "models" / f"{tree.stem}-slopes"
    folder.mkdir(exist_ok=True)
    run([str(by), str(tree.resolve())], folder=folder)
    return [folder / f"{name}.c" for name in ("slopes", "slopes_world")]


def own(tree: Path, function: str, inputs: np.ndarray, size: int, read: Read) -> Contender:
    """`function`: aba, aba_world, rnea or crba."""
    return Contender(
        "Pinocchio C++",
        library(),
        inputs,
        size,
        f"{function} {tree.resolve()}",
        read,
        variant=function,
    )


def generated(
    tree: Path, function: str, inputs: np.ndarray, size: int, read: Read
) -> list[Contender]:
    """`function`: aba, aba_world, rnea, crba or crba_world; straight-line C with all numbers folded
    in."""
    source = code(tree) / f"{function}.c"
    return of_source("Pinocchio→CasADi→C", source, inputs, size, read)


def closed(
    tree: Path, closures: Sequence[Sequence[float]], inputs: np.ndarray, size: int, read: Read
) -> list[Contender]:
    """Loops closed in points: lines of two joints and the point on each. Both of Pinocchio's
    methods, mu = 1e-8."""
    loops = tree.with_suffix(".loops")
    loops.write_text(
        "".join(f"{int(a)} {int(b)} {_numbers(points)}\n" for a, b, *points in closures)
    )
    library = loops_library()
    return [
        Contender(
            "Pinocchio lcaba",
            library,
            inputs,
            size,
            f"{name} {tree.resolve()} {loops.resolve()}",
            read,
            SOFT,
            variant=name,
        )
        for name in ("lcaba", "constraintDynamics")
    ]


def code(tree: Path) -> Path:
    """The folder with the C of all functions."""
    by = maker()
    with _writing:
        return _code(by, tree)


@functools.cache
def _code(by: Path, tree: Path) -> Path:
    folder = BUILD / "models" / f"{tree.stem}-casadi"
    folder.mkdir(exist_ok=True)
    run([str(by), str(tree.resolve())], folder=folder)
    return folder


def _check_headers() -> None:
    if not EIGEN.exists():
        raise Unavailable("Eigen's headers are missing: pip install cmeel-eigen")
    if not (SITE / "cmeel.prefix/include/pinocchio").exists():
        raise Unavailable("Pinocchio's headers are missing: pip install pin")
