"""URDF files as exporters write them: names, frames, limits of infinity, few digits.

Of derive.robots: urdf, tree, naming, transmissions.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

import hamel
from derive.diagnostics import AssumptionError, ModelError
from derive.formulations import equations
from derive.model.load_records import Armature
from derive.model.mechanism.named_frames import frames_of
from derive.robots.reading import imported
from derive.states import system


def file_of(tmp_path, text: str) -> hamel.RobotFile:
    file = tmp_path / "robot.urdf"
    file.write_text(text)
    return hamel.RobotFile(file)


SOLID = """<inertial><origin xyz="0.1 0 0.2"/><mass value="1"/>
  <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>"""


def hinge(name: str, parent: str, child: str, more: str = "", kind: str = "continuous") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{more}</joint>'


def link(name: str) -> str:
    return f'<link name="{name}">{SOLID}</link>'


def robot_of(*parts: str) -> str:
    return f'<robot name="r">{"".join(parts)}</robot>'


@pytest.mark.parametrize("axis", ["1 0 0", "0 -1 0", "0 0 1", "0 1 0", "0 0 -1", "-1 0 0", "1 2 3"])
def test_the_frame_of_a_planar_joint_is_its_link_s(axis, tmp_path):
    """At zero it is the joint's origin, whatever the normal of the plane."""
    more = f'<origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 0.1"/><axis xyz="{axis}"/>'
    text = robot_of(link("a"), link("b"), hinge("slab", "a", "b", more, "planar"))
    frames = frames_of(imported(file_of(tmp_path, text)).model)
    assert frames["slab"] == replace(frames["b"], name="slab")


def test_a_planar_joint_may_have_its_link_s_name(tmp_path):
    text = robot_of(link("a"), link("b"), hinge("b", "a", "b", '<axis xyz="0 1 0"/>', "planar"))
    assert "b" in frames_of(imported(file_of(tmp_path, text)).model)


def test_a_link_called_base_need_not_be_the_root(tmp_path):
    more = '<origin xyz="0 0 1"/>'
    text = robot_of(
        '<link name="world"/>', link("base"), link("arm"),
        hinge("w", "world", "base", more, "fixed"), hinge("j", "base", "arm"),
    )  # fmt: skip
    model = imported(file_of(tmp_path, text)).model
    assert frames_of(model)["base"].body == "base"
    assert [joint.name for joint in model.joints] == ["root", "w", "j"]


def test_legal_names_are_kept_whichever_comes_first(tmp_path):
    text = robot_of(
        link("a-b"),
        link("a_b"),
        link("a.b"),
        hinge("j-1", "a-b", "a_b"),
        hinge("j_1", "a_b", "a.b"),
    )
    model = imported(file_of(tmp_path, text)).model
    assert [body.name for body in model.bodies] == ["a_b_2", "a_b", "a_b_3"]
    assert [joint.name for joint in model.joints] == ["base", "j_1_2", "j_1"]


def test_drake_s_gear_ratio_is_that_of_its_rotor(tmp_path):
    motor = """<transmission name="t"><joint name="j"/><actuator name="m">
      <mechanicalReduction>10</mechanicalReduction><drake:gear_ratio value="5"/>
      <drake:rotor_inertia value="0.01"/></actuator></transmission>"""
    found = imported(file_of(tmp_path, robot_of(link("a"), link("b"), hinge("j", "a", "b"), motor)))
    (armature,) = (x for x in found.model.loads if isinstance(x, Armature))
    assert armature.inertia.value == pytest.approx(0.25)


def test_damping_in_several_directions_is_said_to_be_left_out(tmp_path):
    more = '<dynamics damping="2"/>'
    text = robot_of(link("a"), link("b"), hinge("slab", "a", "b", more, "planar"))
    assert "not read: <dynamics> of 'slab'" in " ".join(imported(file_of(tmp_path, text)).assumed)


@pytest.mark.parametrize("number", ["1e308", "1.7976931348623157e+308", "inf", "1e999"])
def test_limits_of_infinity_are_none(number, tmp_path):
    limit = f'<limit lower="-{number}" upper="{number}" effort="{number}" velocity="2"/>'
    text = robot_of(link("a"), link("b"), hinge("j", "a", "b", limit, "revolute"))
    assert imported(file_of(tmp_path, text)).model.joints[-1].limits is None
    with pytest.raises(ModelError, match="'nan' in 'effort'"):
        imported(file_of(tmp_path, text.replace(f'effort="{number}"', 'effort="nan"')))


def test_what_the_mechanics_find_points_into_the_robot_file(tmp_path):
    point = SOLID.replace("0.1 0 0.2", "0 0 0").replace('"0.1"', '"0"')
    text = robot_of("\n\n", link("a"), f'\n  <link name="b">{point}</link>', hinge("j", "a", "b"))
    model = imported(file_of(tmp_path, text)).model
    with pytest.raises(AssumptionError) as caught:
        equations(system(model))
    (problem,) = caught.value.diagnostics
    assert (problem.line, problem.column) == (
        text[: text.index('<link name="b">')].count("\n") + 1,
        3,
    )
    assert problem.source_line.startswith('  <link name="b">')


@pytest.mark.parametrize(("largest", "is_refused"), [("0.0666667", False), ("0.06667", True)])
def test_a_thin_disk_may_be_written_with_few_digits(largest, is_refused, tmp_path):
    disk = SOLID.replace(
        'ixx="0.1" iyy="0.1" izz="0.1"', f'ixx="0.0333333" iyy="0.0333333" izz="{largest}"'
    )
    text = robot_of(link("a"), f'<link name="b">{disk}</link>', hinge("j", "a", "b"))
    if is_refused:
        with pytest.raises(ModelError, match="no body has the inertia of 'b'"):
            imported(file_of(tmp_path, text))
    else:
        imported(file_of(tmp_path, text))
