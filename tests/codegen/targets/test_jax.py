"""The JAX target: derivatives as JAX's own test sees them, gradients through many steps, errors
that are seen, what is refused at a call.

Of codegen.targets: jax.
Of hamel.verify.targets: jax.
"""

from dataclasses import replace

import numpy as np
import pytest

from codegen import compiler
from hamel.verify.targets import jax as checked
from hamel.verify.targets.records import generated
from tests.subjects import subject

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler"),
]


@pytest.fixture(scope="module")
def jax():
    found = pytest.importorskip("jax")
    found.config.update("jax_enable_x64", True)
    return found


@pytest.fixture(scope="module")
def four_bar(jax, tmp_path_factory):
    base = tmp_path_factory.mktemp("jax")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        return subject(base, "four_bar", ["jax"])


@pytest.fixture(scope="module")
def cart_pole(jax, tmp_path_factory):
    base = tmp_path_factory.mktemp("jax")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        return subject(base, "cart_pole", ["jax"])


def test_gradients_pass_the_test_of_jax(jax, four_bar):
    """At a state of the crank, by every argument, in both modes, alone and under vmap."""
    test_util = pytest.importorskip("jax.test_util")
    dynamics = generated(four_bar, "jax").dynamics
    t, *given = four_bar.row("dynamics", 0)
    test_util.check_grads(dynamics, (t, *given), order=1, modes=["fwd", "rev"], rtol=1e-4)
    several = jax.vmap(dynamics, (None, 0, None, 0))
    x, u, p = given
    many = (t, np.stack([x, x * 1.01]), u, np.stack([p, p]))
    test_util.check_grads(several, many, order=1, modes=["fwd", "rev"], rtol=1e-4)


def test_a_gradient_through_a_hundred_steps_is_that_of_differences(jax, cart_pole):
    functions = generated(cart_pole, "jax")

    @jax.jit
    def end(u):
        def step(x, force):
            return x + 1e-2 * functions.dynamics(0.0, x, force[None]), None

        return jax.lax.scan(step, jax.numpy.array([0.0, 0.1, 0.5, 0.0]), u)[0][1]

    u = np.full(100, 1.0)
    gradient, unit = jax.grad(end)(u), np.eye(100)[50]
    slope = float(end(u + 1e-5 * unit) - end(u - 1e-5 * unit)) / 2e-5
    assert float(gradient[50]) == pytest.approx(slope, rel=1e-6)
    rollouts = jax.vmap(end)(np.stack([u, 2 * u]))
    assert np.asarray(rollouts) == pytest.approx([float(end(u)), float(end(2 * u))], rel=1e-14)


@pytest.mark.parametrize(
    ("t", "x", "u", "p"),
    [
        ((), (5, 3), (), ()),  # one row for all but x
        ((), (1, 3), (5, 1), ()),  # each along an axis of its own
        ((5, 1), (5, 3), (1, 3), (5, 1)),
        ((3,), (5, 1), (5, 3), (3,)),
        ((), (2, 1, 3), (1, 4, 1), (2, 4, 1)),
        ((2, 1, 1), (4, 1), (3,), ()),
        ((), (0, 3), (0, 1), ()),
    ],
)
def test_leading_axes_broadcast_row_by_row(jax, cart_pole, t, x, u, p):
    """As the module has it row by row: in a call, under jit, and under a vmap for each axis."""
    functions, module = generated(cart_pole, "jax"), cart_pole.module
    random = np.random.default_rng(4)
    shapes = ((*t, 1), (*x, 4), (*u, 1), (*p, len(module.defaults)))
    given = [random.uniform(0.5, 1.0, shape) for shape in shapes]
    lead = np.broadcast_shapes(t, x, u, p)
    rows = [np.broadcast_to(part, (*lead, part.shape[-1])) for part in given]
    expected = np.zeros((*lead, 4))
    for place in np.ndindex(*lead):
        one = [row[place] for row in rows]
        expected[place] = module.dynamics(one[0][0], *one[1:])
    given[0] = given[0][..., 0]
    dynamics = functions.dynamics
    for call in (dynamics, jax.jit(dynamics), mapped(jax, dynamics, (t, x, u, p))):
        assert np.asarray(call(*given)) == pytest.approx(expected, rel=1e-13, abs=1e-13)


def mapped(jax, dynamics, leads):
    """A vmap for each leading axis, over the arguments that are long there; XLA is given the others
    with an axis of length 1."""
    rank = max(map(len, leads))
    padded = [(1,) * (rank - len(lead)) + lead for lead in leads]
    call = dynamics
    for lengths in reversed(list(zip(*padded))):
        call = jax.vmap(call, tuple(None if length == 1 else 0 for length in lengths))
    kept = [[length for length in lead if length != 1] for lead in leads]

    def value(*given):
        shapes = [(*kept[k], *np.shape(part)[len(leads[k]) :]) for k, part in enumerate(given)]
        return call(*map(np.reshape, given, shapes))

    return value


@pytest.mark.parametrize(
    ("before", "after", "seen"),
    [
        ("return None, None, None, None, _by_x", "return None, None, None, None, -_by_x", ["vjp"]),
        ("[x, dx, du], -1", "[x, -dx, du], -1", ["jvp"]),
        ('"...ij,...j->...i"', '"...ij,...j->...j"', None),
        ("[x, dx, du], -1", "[x, dx, du], -1", []),
    ],
)
def test_errors_are_seen(cart_pole, tmp_path, before, after, seen):
    text = (cart_pole.folder / "cart_pole_jax.py").read_text("utf-8")
    assert before in text
    (tmp_path / "cart_pole_jax.py").write_text(text.replace(before, after))
    library = compiler.shared_library("cart_pole")
    (tmp_path / library).symlink_to(cart_pole.folder / library)
    spoiled = replace(cart_pole, folder=tmp_path)
    if seen is None:  # shapes that do not fit are JAX's own affair
        with pytest.raises((TypeError, ValueError)):
            checked.check(spoiled)
    else:
        failed = [result.name for result in checked.check(spoiled) if not result.passed]
        assert failed == seen


def test_calls_that_do_not_fit_say_so(jax, cart_pole):
    functions = generated(cart_pole, "jax")
    with pytest.raises(ValueError, match="x has the shape"):
        functions.dynamics(0.0, np.zeros(3))
    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(RuntimeError, match="jax_enable_x64"):
            functions.dynamics(0.0, np.zeros(4))
    finally:
        jax.config.update("jax_enable_x64", True)


def test_a_row_without_a_value_is_not_a_number(cart_pole):
    functions = generated(cart_pole, "jax")
    states = np.zeros((3, 4))
    states[1] = np.inf
    values = np.asarray(functions.dynamics(0.0, states))
    assert np.isnan(values[1]).all() and np.isfinite(values[[0, 2]]).all()
