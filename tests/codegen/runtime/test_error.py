"""The estimate of the error of a motion, beside what the error is."""

from types import ModuleType

import numpy as np
import pytest

from codegen import compiler, loader
from codegen.passes import program
from codegen.runtime import error
from hamel.build.module import published
from tests.scenes import derived

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
START = [0.9, -0.4, 1.5, 0.3]
METHODS = ("dop853", "verner9", "dopri5", "rk4")


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    base = tmp_path_factory.mktemp("error")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        made = program(derived("double_pendulum"), integrators=METHODS)
        return loader.load(published(made, base / "pendulum").folder)


def ratios(module: ModuleType, integrator: str) -> list[float]:
    """Estimate over error, of motions of several lengths, rows and tolerances."""
    found = []
    for time, count in ((1.0, 2), (3.0, 12), (3.0, 301)):
        times = np.linspace(0.0, time, count)
        exact = module.simulate(
            (0.0, time), START, rtol=1e-14, atol=1e-15, times=times, integrator="verner9"
        )
        for rtol in (1e-4, 1e-6, 1e-8, 1e-10):
            given = (
                {"step_size": rtol**0.25}
                if integrator == "rk4"
                else {"rtol": rtol, "atol": rtol / 10}
            )
            motion = module.simulate(
                (0.0, time), START, times=times, integrator=integrator, error=True, **given
            )
            true = np.maximum.accumulate(np.abs(motion.x - exact.x), axis=0)
            assert motion.error.shape == motion.x.shape
            if true[-1].max() > 1e-13:
                found.append(float(motion.error[-1].max() / true[-1].max()))
    return found


@pytest.mark.parametrize("integrator", METHODS)
def test_it_is_no_less_than_the_error_and_not_a_thousand_times(
    pendulum: ModuleType, integrator: str
) -> None:
    found = ratios(pendulum, integrator)
    assert len(found) > 5 and min(found) >= 1
    assert np.median(found) < 100


def test_an_estimate_without_safety_is_seen(
    pendulum: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pendulum._error, "SAFETY", 0.1)
    assert min(ratios(pendulum, "dopri5")) < 1


def test_many_motions_have_the_estimates_of_each(pendulum: ModuleType) -> None:
    x = np.array([START, [0.1, 0.2, 0.0, 0.0]])
    times = np.linspace(0.0, 2.0, 9)
    both = pendulum.simulate((0.0, 2.0), x, times=times, rtol=1e-7, atol=1e-8, error=True)
    for row, start in enumerate(x):
        alone = pendulum.simulate((0.0, 2.0), start, times=times, rtol=1e-7, atol=1e-8, error=True)
        np.testing.assert_allclose(both.error[row], alone.error, rtol=1e-6)


def test_motions_that_cannot_go_on_have_none(pendulum: ModuleType) -> None:
    """One is not finite; the other is as it is alone."""
    x = np.array([START, [np.nan, 0.0, 0.0, 0.0]])
    times = np.linspace(0.0, 2.0, 9)
    given = {"times": times, "rtol": 1e-7, "atol": 1e-8, "error": True}
    with pytest.warns(RuntimeWarning, match="1 of 2 motions") as told:
        both = pendulum.simulate((0.0, 2.0), x, **given)
    assert len(told) == 1
    alone = pendulum.simulate((0.0, 2.0), START, **given)
    np.testing.assert_allclose(both.error[0], alone.error, rtol=1e-6)
    assert np.isnan(both.error[1]).all()


def test_motions_that_an_event_stopped_have_estimates_up_to_there(pendulum: ModuleType) -> None:
    x, times = np.array([START, [0.1, 0.2, 0.0, 0.0]]), np.linspace(0.0, 2.0, 9)
    given = {"times": times, "rtol": 1e-7, "atol": 1e-8, "error": True}
    stop = {"events": {"stop": pendulum.Event(lambda t, x: t - 0.7, stop=True)}}
    both = pendulum.simulate((0.0, 2.0), x, **given, **stop)
    ended = pendulum.simulate((0.0, 2.0), START, **given, **stop)
    assert ended.t[-1] == pytest.approx(0.7) and (ended.error[-1] < 1e-4).all()
    assert both.error.shape == both.x.shape and (both.error < 1e-4).all()
    assert (both.error[:, 3:] == both.error[:, 3:4]).all()  # from the end on
    assert (both.error[:, 3] > 0.0).any(axis=-1).all()


def test_the_companion_ends_with_the_motion() -> None:
    assert error.rows(np.arange(6.0)).tolist() == [1, 3, 5]
    assert error.rows(np.arange(5.0)).tolist() == [0, 2, 4]
    factor = (7.0 / 3.0) ** 8
    assert error.coarser(1e-9, 1e-11, None, 8) == (factor * 1e-9, factor * 1e-11, None)
    assert error.coarser(1e-3, 1e-5, None, 8)[0] == pytest.approx(1e-2)
    assert error.coarser(1e-9, 1e-11, 0.1, 4) == (1e-9, 1e-11, 0.2)
