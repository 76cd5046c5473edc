"""Motions side by side with what keeps them on their constraints: every explicit method with every
enforcement, in charts and along a frame, gives the rows of the loop for one motion."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from codegen import compiler, loader
from codegen.integrators import INTEGRATORS, Tableau
from codegen.passes import program
from codegen.passes.lanes import side_by_side
from codegen.passes.taylor import SERIES, series_in_lanes
from derive.enforcement import ENFORCEMENTS, Options, kept_equations
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.mechanics.records import System
from derive.model import load_text
from derive.states import system
from derive.states.initial import initial_state
from hamel.build.module import published
from tests.scenes import MODELS

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
EXPLICIT = (*(x.name for x in INTEGRATORS if isinstance(x, Tableau)), SERIES)
OWN = ("baumgarte", "feedback")  # which change the equations
STAGES = tuple(x.name for x in ENFORCEMENTS if x.level == "stages")
MANY, FEW, SPAN = 9, 2, 1.5
COUNTS = {"steps": 2, "rejected": 2, "charts": 1, "switches": 0, "bases": 0}  # and how far apart
IN_CHARTS = ("charts", "parameters")
# The error estimate of verner9 is rounding in short steps, and moves the sizes of those after it:
# rows differ by what they are wrong by, which is a thousand times as much by singular positions.
NOISY = "verner9"
AGREES, AGREES_NOISY, AGREES_PASSING = 1e-7, 1e-6, 2e-4


@dataclass(frozen=True)
class Scene:
    """A model with some of its text replaced, and how it is formed; `spread` is that of starts."""

    model: str
    formulation: str
    choice: str | None = None
    own: str = ""  # the enforcement that the equations are made for
    changes: tuple[tuple[str, str], ...] = ()
    spread: float = 1.0
    constants: str | tuple[str, ...] = "all"


# The slider's speed fails at the dead centres, the rod's turning rate half way between.
ROD = ("  slider: [der(s)]", "  slider: [der(s)]\n  rod: [der(q1) + der(q2)]")
FAST = ("der(q1): 10 rad/s", "der(q1): 20 rad/s")
SCENES = {
    "loop": Scene("four_bar", "quasi_velocities"),
    "velocities": Scene("four_bar", "augmented", constants=()),
    "rolling": Scene("rolling_disk", "augmented", spread=0.3),
    "snake": Scene("snake3", "augmented"),
    "fed_back": Scene("four_bar", "quasi_velocities", own="feedback"),
    "stabilised": Scene("four_bar", "augmented", own="baumgarte"),
    "charts": Scene("slider_crank", "quasi_velocities", "slider+rod", changes=(ROD, FAST)),
    "parameters": Scene(
        "slider_crank", "quasi_velocities", "slider+rod", changes=(ROD, FAST), constants=()
    ),
    "frame": Scene("snake3", "quasi_velocities", "orthonormal", spread=2.0, constants=()),
}


def mechanics(scene: Scene) -> System:
    text = (MODELS / f"{scene.model}.yaml").read_text()
    for old, new in scene.changes:
        assert old in text
        text = text.replace(old, new)
    return system(load_text(text), scene.constants)


@functools.cache
def formed(name: str) -> tuple[Equations, tuple[str, ...]]:
    """The equations with all that their enforcements need, and the names of these."""
    scene = SCENES[name]
    model = mechanics(scene)
    options = Options(20.0, (), (0.0,) * model.u.numel(), tuple(model.parameters))
    if scene.own:
        own = next(x for x in ENFORCEMENTS if x.name == scene.own)
        found = kept_equations(model, scene.choice, scene.formulation, own, options)
        return found, (scene.own,)
    plain = equations(model, scene.choice, scene.formulation, moving=True)
    fitting = [x for x in ENFORCEMENTS if x.name not in OWN and not x.refusal(plain, options)]

    def kept(chart: Equations) -> Equations:
        return functools.reduce(lambda e, x: x.equations(e, options), fitting, chart)

    charts = tuple(map(kept, plain.charts))
    return replace(kept(plain), charts=charts), tuple(x.name for x in fitting)


Modules = Callable[[str], ModuleType]


@pytest.fixture(scope="module")
def modules(tmp_path_factory: pytest.TempPathFactory) -> Modules:
    """Of the scenes by name, each built once."""
    base = tmp_path_factory.mktemp("enforced")

    @functools.cache
    def module(name: str) -> ModuleType:
        made = program(formed(name)[0], None, EXPLICIT, formed(name)[1])
        assert side_by_side(made) and series_in_lanes(made)
        return loader.load(published(replace(made, name=f"of_{name}"), base / name).folder)

    return module


def starts(module: ModuleType, name: str) -> np.ndarray:
    """Consistent states: the motion of the model, with other speeds all along it."""
    model = mechanics(SCENES[name])
    initial, random = initial_state(model), np.random.default_rng(3)
    scene = SCENES[name]
    w = module.state(0.0, np.concatenate([initial.q, initial.v]), np.zeros(module.nu))
    factor = 1.0 + scene.spread * random.uniform(-0.5, 1.5, MANY)
    x = np.tile(np.asarray(w), (MANY, 1))
    x[:, len(initial.q) :] *= factor[:, None]
    return x


def how(integrator: str, enforcement: str) -> dict[str, Any]:
    step = {"step_size": 0.005} if integrator == "rk4" else {}
    return {
        "integrator": integrator,
        "enforcement": enforcement,
        "rtol": 1e-8,
        "atol": 1e-10,
        "times": [0.3, SPAN],
        **step,
    }


@pytest.mark.parametrize("name", SCENES)
def test_rows_are_those_of_one_motion(modules: Modules, name: str) -> None:
    module = modules(name)
    x = starts(module, name)
    for enforcement in formed(name)[1]:
        for integrator in _integrators(enforcement):
            _compare(module, name, x, enforcement, integrator)


def _compare(
    module: ModuleType, name: str, x: np.ndarray, enforcement: str, integrator: str
) -> None:
    options = how(integrator, enforcement)
    many = module.simulate((0.0, SPAN), x, **options)
    ones = [module.simulate((0.0, SPAN), start, **options) for start in x]
    assert not many.status.any()
    _agree(name, many, ones, _tolerance(name, integrator))
    for counts, most in COUNTS.items() if integrator != NOISY else ():
        wanted = np.array([getattr(one, counts) for one in ones])
        assert np.all(abs(getattr(many, counts) - wanted) <= most), counts
    if enforcement != "projection" and integrator != NOISY:  # which goes on less where it can
        calls = np.array([one.calls for one in ones])
        assert np.all(abs(many.calls - calls) <= 0.05 * calls)
    few = module.simulate((0.0, SPAN), x[:FEW], **options)  # lanes that have no motion
    np.testing.assert_array_equal(few.steps, many.steps[:FEW])
    assert np.any(many.switches) or name not in IN_CHARTS
    assert np.any(many.bases) or name != "frame"


def _tolerance(name: str, integrator: str) -> float:
    if integrator != NOISY:
        return AGREES
    return AGREES_PASSING if name in IN_CHARTS else AGREES_NOISY


def _integrators(enforcement: str) -> Sequence[str]:
    return EXPLICIT[:-1] if enforcement in STAGES else EXPLICIT


def _agree(name: str, many: Any, ones: Sequence[Any], tolerance: float) -> None:
    """Rows; of motions along a frame, which is not the same to rounding, coordinates and work."""
    nq = program(formed(name)[0], ["dynamics"]).coordinates
    rows = np.array([one.x for one in ones])
    np.testing.assert_allclose(many.x[..., :nq], rows[..., :nq], rtol=tolerance, atol=tolerance)
    work = np.array([one.work for one in ones])
    np.testing.assert_allclose(many.work, work, rtol=tolerance, atol=10 * tolerance)
    if name != "frame":
        np.testing.assert_allclose(many.x, rows, rtol=tolerance, atol=10 * tolerance)
