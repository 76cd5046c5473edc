"""Slips in the names of elements and attributes of robot files are told; words of others are noted.

Of derive.robots: words, urdf_words.
Of derive.robots.mjcf: words.
"""

from __future__ import annotations

import pytest

from derive.diagnostics import ModelError
from derive.robots import words as formats
from derive.robots.reading import Imported, imported

URDF = """<robot name="r">
  <link name="a"/>
  <link name="b">
    <inertial>
      <origin xyz="0.1 0 0"/>
      <mass value="1"/>
      <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <visual/>
  </link>
  <joint name="j" type="revolute">
    <parent link="a"/>
    <child link="b"/>
    <origin xyz="0 0 1"/>
    <axis xyz="0 1 0"/>
    <dynamics damping="0.1"/>
    <limit effort="1" velocity="1" lower="-1" upper="1"/>
  </joint>
</robot>"""

MJCF = """<mujoco>
  <option gravity="0 0 -9.81"/>
  <default><joint damping="1"/></default>
  <worldbody>
    <body name="b" pos="0 0 1">
      <joint name="j" axis="0 1 0"/>
      <geom type="capsule" size="0.1 0.2"/>
    </body>
  </worldbody>
  <actuator><motor joint="j" gear="3"/></actuator>
</mujoco>"""


def read(tmp_path, text: str) -> Imported:
    file = tmp_path / ("r.xml" if text.startswith("<mujoco") else "r.urdf")
    file.write_text(text)
    return imported(file)


def refused(tmp_path, text: str) -> str:
    with pytest.raises(ModelError) as caught:
        read(tmp_path, text)
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "old", "new", "word", "meant"),
    [
        (URDF, "<axis xyz", "<Axis xyz", "<Axis> in <joint>", "<axis>"),
        (URDF, "axis xyz", "axis xzy", "'xzy' of <axis>", "'xyz'"),
        (URDF, '<origin xyz="0 0 1"', '<orign xyz="0 0 1"', "<orign> in <joint>", "<origin>"),
        (URDF, '<origin xyz="0.1 0 0"', '<origin Xyz="0.1 0 0"', "'Xyz' of <origin>", "'xyz'"),
        (URDF, "damping", "dampening", "'dampening' of <dynamics>", "'damping'"),
        (URDF, "<limit", "<limits", "<limits> in <joint>", "<limit>"),
        (URDF, "inertial>", "Inertial>", "<Inertial> in <link>", "<inertial>"),
        (URDF, '<link name="a"/>', '<link nmae="a"/>', "'nmae' of <link>", "'name'"),
        (MJCF, "axis", "axsi", "'axsi' of <joint>", "'axis'"),
        (MJCF, "damping", "dampening", "'dampening' of <joint>", "'damping'"),
        (MJCF, "gravity", "gravty", "'gravty' of <option>", "'gravity'"),
        (MJCF, "gear", "gaer", "'gaer' of <motor>", "'gear'"),
        (MJCF, "<geom", "<Geom", "<Geom> in <body>", "<geom>"),
        (MJCF, "<motor", "<moter", "<moter> in <actuator>", "<motor>"),
    ],
)
def test_slips_are_told_where_they_are(text, old, new, word, meant, tmp_path):
    text = text.replace(old, new)
    said = refused(tmp_path, text)
    name = word.split()[0].strip("'<>")
    kind, at = ("element", "<" + name) if word.startswith("<") else ("attribute", name)
    before = text[: text.index(at)].split("\n")
    place = f":{len(before)}:{len(before[-1]) + 1}: error: unknown {kind} {word}\n"
    assert place in said and f"did you mean {meant}?" in said
    carets = next(line for line in said.splitlines() if "^" in line)
    assert carets.strip() == "^" * len(at)


@pytest.mark.parametrize(
    ("text", "old", "new", "noted"),
    [
        (URDF, "<visual/>", "<self_filter/><self_filter/>", ["<self_filter> in <link>"]),
        (URDF, "<visual/>", "<collision_checking/>", ["<collision_checking> in <link>"]),
        (URDF, "<limit ", '<limit gear_velocity="3" ', ["'gear_velocity' of <limit>"]),
        (URDF, "<dynamics ", '<dynamics D="3" ', ["'D' of <dynamics>"]),
        (URDF, "<dynamics ", '<dynamics v:dampin="3" ', ["'v:dampin' of <dynamics>"]),
        (URDF, "</robot>", '<gazebo><orign/></gazebo><links_of x="1"/></robot>',
         ["<gazebo>", "<links_of>"]),
        (URDF, "<robot ", '<robot xmlns:xsi="x" xsi:names="y" ', []),
        (URDF, "<visual/>", "<visual><orign/></visual>", []),
        (MJCF, "<geom ", '<geom glow="3" ', ["'glow' of <geom>"]),
        (MJCF, "<motor ", '<motor future="1" ', ["'future' of <motor>"]),
        (MJCF, "<option ", '<option apirate="1" mpr_iterations="5" ', []),
    ],
)  # fmt: skip
def test_words_of_others_are_noted_once(text, old, new, noted, tmp_path):
    plain, found = read(tmp_path, text), read(tmp_path, text.replace(old, new))
    said = [f"not read: {', '.join(sorted(noted))}"] if noted else []
    assert [one for one in found.assumed if one not in plain.assumed] == said
    parts = [one.text.split("\nmodel:")[1] for one in (plain, found)]
    assert parts[0] == parts[1]


@pytest.mark.parametrize(
    "element",
    ['<origin xyz="0 0 1"/>', '<axis xyz="0 1 0"/>', '<parent link="a"/>', '<child link="b"/>',
     '<dynamics damping="0.1"/>', '<mass value="1"/>'],
)  # fmt: skip
def test_what_stands_there_twice_names_both_lines(element, tmp_path):
    text = URDF.replace(f"{element}\n", f"{element}\n{element}\n")
    line = text[: text.index(element)].count("\n") + 1
    said = refused(tmp_path, text)
    assert f":{line + 1}:1: error: a second {element.split()[0]}>" in said
    assert f"the first is in line {line}" in said


def test_a_second_inertial_is_refused(tmp_path):
    start, end = URDF.index("<inertial>"), URDF.index("<visual/>")
    text = URDF[:end] + URDF[start:end] + URDF[end:]
    assert ":9:5: error: a second <inertial> in the <link> 'b'" in refused(tmp_path, text)
    inertial = '<inertial pos="0 0 0" mass="1"/>'
    said = refused(tmp_path, MJCF.replace("<geom", f"{inertial}\n{inertial}<geom"))
    assert ":8:1: error: a second <inertial> in the <body> 'b'" in said


@pytest.mark.parametrize("place", ["<body ", "<geom "])
def test_two_orientations_of_one_element_are_refused(place, tmp_path):
    text = MJCF.replace(place, f'{place}quat="1 0 0 0" euler="90 0 0" ')
    said = refused(tmp_path, text)
    assert f"a {place.strip()}> with several orientations: quat, euler" in said
    assert "one of them" in said


def test_a_class_may_have_another_orientation_than_its_geom(tmp_path):
    text = MJCF.replace("</default>", '<geom quat="1 0 0 0"/></default>')
    read(tmp_path, text.replace("<geom type", '<geom euler="90 0 0" type'))


def test_only_so_many_unknown_words_are_compared(tmp_path, monkeypatch):
    """A file with very many takes no more time; what is left is noted."""
    monkeypatch.setattr(formats, "MOST_UNKNOWN", 2)
    strange = 'odd1="1" odd1_2="1" dampening="1"'
    found = read(tmp_path, URDF.replace("<dynamics ", f"<dynamics {strange} "))
    assert any("'dampening' of <dynamics>" in sentence for sentence in found.assumed)
