"""A part on a body moves against that body as it moves on the ground alone: also where it says
nothing of its ground.

Of derive.model.composing: grounded, renaming.
"""

from pathlib import Path

import numpy as np
import pytest

from derive.diagnostics import ModelError
from derive.expressions.tree import Call
from derive.formulations import equations
from derive.formulations.evaluate import Evaluator, evaluator
from derive.model import load
from derive.states import system

PART = """
model: part
plane: xy
{more}
bodies: {{b: {{mass: 2 kg, com: [0.1 m, 0.2 m], inertia: 0.3}}}}
joints: {{j: {{type: planar, parent: ground, child: b, coordinates: [x, y, turn]}}}}
{rest}
"""
WHOLE = """
model: whole
plane: xy
bodies: {base: {mass: 1 kg}}
joints: {mount: {type: fixed, parent: ground, child: base, at: [3 m, 4 m], angle: 90 deg}}
submodels: {a: {use: part.yaml, ground: GROUND}}
"""
ON_A_FRAME = "{body: ground, position: [1 m, 2 m], angle: 40 deg}"
PARTS = {
    "a force": "loads: {f: {type: force, body: b, at: [0.3, 0], components: [1 N, 2 N*sin(turn)]}}",
    "a force along its ground": "loads: {f: {type: force, body: b, components: [1 N, 2 N], frame: ground}}",
    "a force along its own axes": "loads: {f: {type: force, body: b, components: [1 N, 2 N], frame: body}}",
    "a wrench": "loads: {f: {type: wrench, frame: b, force: [1 N, 2 N], moment: 3 N*m}}",
    "a wrench along its ground": "loads: {f: {type: wrench, frame: j, force: [1 N, 2 N], axes: ground}}",
    "a wrench along its frame": "loads: {f: {type: wrench, frame: j, force: [1 N, 2 N], axes: frame}}",
    "a contact": "loads: {f: {type: contact, body: b, plane: {normal: y, origin: [0, 5 m]}, "
    "stiffness: 100 N/m, friction: 0.2, smoothing: 1 m/s}}",
    "rolling": "constraints: {r: {type: rolling, body: b, shape: {wheel: {radius: 0.1 m}}, "
    "plane: {normal: y}}}",
    "rolling on a surface": "constraints: {r: {type: rolling, body: b, shape: {wheel: {radius: 0.1 m}}, "
    "surface: y - 0.1*x}}",
    "a point on a surface": "constraints: {r: {type: point_on_surface, body: b, surface: y - 0.2*x}}",
    "formulas": "loads: {f: {type: expression, velocity: j.vx, expression: "
    '"(2 N/m)*position(b, [0.1, 0]).y + (1 N)*angle(b) + (3 N*s/m)*velocity(b).x"}}',
}  # fmt: skip
OUTPUTS = (
    'outputs: {p: position(b), p2: "position(b, [0.1, 0])", v: velocity(b), an: angle(b), '
    'd: "direction(b, x)", w: angular_velocity(b), o: orientation(b).xy, '
    'both: "(position(b) - velocity(b)*(1 s)).x + distance(b, ground)"}'
)  # fmt: skip


def derived(file: Path) -> Evaluator:
    return evaluator(equations(system(load(str(file)))))


def results(tmp_path: Path, ground: str, rest: str, names: tuple[str, ...]) -> list[np.ndarray]:
    """Of the part alone where the whole's ground is not given."""
    (tmp_path / "part.yaml").write_text(PART.format(more="", rest=rest), encoding="utf-8")
    whole = tmp_path / "whole.yaml"
    whole.write_text(WHOLE.replace("GROUND", ground), encoding="utf-8")
    mechanics = derived(whole if ground else tmp_path / "part.yaml")
    count = len(mechanics.equations.argument("x").labels)
    x = np.random.default_rng(3).normal(size=count)
    return [np.array(mechanics(name, 0.0, x, [], [])) for name in names]


@pytest.mark.parametrize("ground", ["base", ON_A_FRAME, "{body: base, angle: 20 deg}"])
@pytest.mark.parametrize("name", PARTS)
def test_rates_are_those_of_the_part_alone(tmp_path: Path, name: str, ground: str) -> None:
    (alone,), (mounted,) = (results(tmp_path, x, PARTS[name], ("dynamics",)) for x in ("", ground))
    np.testing.assert_allclose(mounted, alone, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("ground", ["base", ON_A_FRAME])
def test_outputs_are_seen_from_the_part_s_ground(tmp_path: Path, ground: str) -> None:
    (alone,), (mounted,) = (results(tmp_path, x, OUTPUTS, ("outputs",)) for x in ("", ground))
    np.testing.assert_allclose(mounted, alone, rtol=1e-12, atol=1e-12)


def test_on_the_ground_nothing_is_added(tmp_path: Path) -> None:
    (tmp_path / "part.yaml").write_text(PART.format(more="", rest=OUTPUTS), encoding="utf-8")
    whole = tmp_path / "whole.yaml"
    whole.write_text(WHOLE.replace(", ground: GROUND", ""), encoding="utf-8")
    first = load(str(whole)).outputs[0].expression
    assert isinstance(first, Call) and len(first.arguments) == 2


def test_no_slip_on_a_body_is_refused(tmp_path: Path) -> None:
    rest = "constraints: {s: {type: no_slip, body: b, at: [0, 0], direction: y}}"
    with pytest.raises(ModelError, match="a no_slip in a part whose ground is a body") as caught:
        results(tmp_path, "base", rest, ())
    assert caught.value.diagnostics[0].file.endswith("part.yaml")


def test_what_holds_a_part_takes_no_name_of_it(tmp_path: Path) -> None:
    rest = "frames: {mount: {body: b}, mount2: {body: b, position: [1, 0]}}"
    (tmp_path / "part.yaml").write_text(PART.format(more="", rest=rest), encoding="utf-8")
    whole = tmp_path / "whole.yaml"
    whole.write_text(WHOLE.replace("GROUND", ON_A_FRAME), encoding="utf-8")
    model = load(str(whole))
    assert [joint.name for joint in model.joints] == ["mount", "a_mount3", "a_j"]
    assert {frame.name for frame in model.frames} == {"a_mount", "a_mount2"}


WORDS = {
    "units of a table": (
        "parameters: {m: 1 kg, s: 2}\ntables: {T: {points: [[0, 0], [1, 2]], units: [m/s, N*m]}}",
        "loads: {f: {type: expression, joint: k, expression: T(der(q)*(1 m))}}",
    ),
    "a symbol": (
        'parameters: {m: {value: 1 kg, symbol: "m_{1}"}, d: {value: 1, symbol: "\\\\delta_{b}"}}',
        "",
    ),
    "the axes of a body called body": (
        "", "loads: {f: {type: force, body: body, components: [1 N, 0], frame: body}}"
    ),
    "the direction of an event": (
        "parameters: {rising: 1}",
        "events: {e: {formula: q - rising, direction: rising, stop: false}}",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WORDS)
def test_words_stay_words(tmp_path: Path, name: str) -> None:
    before, rest = WORDS[name]
    part = f"""
model: part
plane: xy
{before}
bodies: {{b: {{mass: 2 kg, inertia: 0.3}}, body: {{mass: 1 kg, inertia: 1}}}}
joints:
  k: {{type: revolute, parent: ground, child: b, coordinate: q}}
  l: {{type: planar, parent: b, child: body}}
{rest}
"""
    (tmp_path / "part.yaml").write_text(part, encoding="utf-8")
    whole = tmp_path / "whole.yaml"
    whole.write_text(WHOLE.replace("GROUND", "base"), encoding="utf-8")
    alone, mounted = load(str(tmp_path / "part.yaml")), load(str(whole))
    for section in ("events", "tables", "symbols"):
        said = [repr(getattr(model, section)).replace("a_", "") for model in (alone, mounted)]
        assert len(said[0]) > 0 and said[0].count("rising") == said[1].count("rising")
    assert [x for _, x in alone.symbols] == [x for _, x in mounted.symbols]
