"""Functions of frames and over quasi-velocities as a module: shapes, batches, C beside NumPy, single
precision, charts; and nothing of them where nobody asks.

Of codegen.passes.pipeline (requests of families), hamel.build.stages.
"""

import json
from pathlib import Path

import numpy as np
import pytest

import hamel
from codegen.loader import load as load_module
from codegen.loader import part
from derive.diagnostics import HamelError
from hamel.build.module import published, temporary_module
from hamel.build.stages import program_of
from hamel.cli import main
from tests.scenes import ROOT, derived

NAMES = (
    "default",
    "pose_coupler",
    "jacobian_coupler",
    "jacobian_w_local_coupler",
    "pose_jacobian_B",
    "jdot_v_coupler",
    "frame_acceleration_world_coupler",
    "jacobian_ground",
    "mass_w",
    "coriolis_w",
    "partial_velocities",
    "inverse_dynamics_u",
)
SHAPES = {
    "pose_coupler": (3, 4),
    "jacobian_coupler": (6, 3),
    "jacobian_w_local_coupler": (6, 1),
    "pose_jacobian_B": (30,),
    "jdot_v_coupler": (6,),
    "jacobian_ground": (6, 3),
    "mass_w": (1, 1),
    "partial_velocities": (3, 1),
}
X = np.array([[1.0, -0.5, 1.7, 5.0], [1.1, -0.6, 1.7, -2.0], [0.9, -0.4, 1.6, 0.3]])


def test_nothing_of_frames_is_emitted_unless_it_is_asked_for():
    names = [kernel.name for kernel in program_of(derived("four_bar")).kernels]
    assert not [name for name in names if "coupler" in name or name.endswith("_w")]


def test_shapes_and_batches_in_c_and_numpy(tmp_path: Path):
    program = program_of(derived("four_bar", "crank"), NAMES)
    folder = tmp_path / "four_bar"
    published(program, folder)
    module = load_module(folder)
    plain = part(module, "_numpy")
    manifest = json.loads((folder / "manifest.json").read_text("utf-8"))["functions"]
    for name, shape in SHAPES.items():
        one, many = getattr(module, name)(0.0, X[0]), getattr(module, name)(0.0, X)
        assert one.shape == shape and many.shape == (3, *shape)
        assert np.array_equal(many[0], one)
        assert tuple(manifest[name]["shape"]) == shape
        assert np.allclose(getattr(plain, name)(0.0, X), many, atol=1e-13)
    both = module.pose_jacobian_B(0.0, X[0])
    assert np.allclose(both[:12].reshape(3, 4)[:, 3], [0.2 * np.cos(1.0), 0.2 * np.sin(1.0), 0.0])
    u = module.inverse_dynamics_u(0.0, np.append(X[0], 0.7))
    assert module.dynamics(0.0, X[0], u)[3] == pytest.approx(0.7, abs=1e-12)


def test_single_precision():
    with temporary_module(derived("four_bar", "crank"), functions=NAMES, real="float32") as module:
        pose = module.pose_coupler(0.0, X[0].astype(np.float32))
        assert pose.dtype == np.float32
        assert np.allclose(pose[:, :3] @ pose[:, :3].T, np.eye(3), atol=1e-6)


def test_functions_over_w_are_there_in_every_chart_and_poses_once():
    found = derived("four_bar", "crank+rocker")
    names = [
        k.name for k in program_of(found, ("mass_w", "jacobian_w_coupler", "pose_coupler")).kernels
    ]
    assert {"mass_w", "mass_w_chart1", "jacobian_w_coupler_chart1", "pose_coupler"} <= {*names}
    assert "pose_coupler_chart1" not in names


def test_an_unknown_frame_is_refused_with_the_nearest_function():
    with pytest.raises(HamelError, match="did you mean 'pose_coupler'"):
        program_of(derived("four_bar"), ("pose_cuopler",))


@pytest.mark.slow
def test_links_and_joints_of_a_urdf_by_the_command_line(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arm = str(ROOT / "tests/robots/arm.urdf")
    names = [body.name for body in hamel.list(arm).kinds["bodies"]]
    joint = hamel.list(arm).kinds["joints"][0].name
    asked = f"pose_{names[-1]},jacobian_{names[-1]},pose_{joint}"
    with pytest.raises(SystemExit) as ended:
        main(["build", arm, "-o", "arm", "--functions", asked])
    assert ended.value.code == 0
    module = hamel.load("arm")
    assert getattr(module, f"pose_{names[-1]}")(0.0, np.zeros(module.nx)).shape == (3, 4)
    with pytest.raises(SystemExit) as ended:
        main(["build", arm, "-o", "other", "--functions", f"pose_{names[-1]}x"])
    assert ended.value.code == 1
    assert f"did you mean 'pose_{names[-1]}'" in capsys.readouterr().err
    assert not Path("other").exists()
