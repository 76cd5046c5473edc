"""The derivatives emitted on request are those of `dynamics`: central differences say the same."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import hamel
from derive.diagnostics import AssumptionError, VerificationError
from derive.formulations import FORMULATIONS, equations
from derive.formulations.derivatives import derivatives
from derive.formulations.evaluate import slots_of
from derive.formulations.records import Equations, Function
from derive.model import load, load_text
from derive.states import sampling, system
from hamel.build import pipeline
from hamel.build.stages import program_of
from tests.scenes import MODELS

DENSE = (
    "jacobian",
    "jacobian_u",
    "jacobian_p",
    "jacobian_t",
    "dynamics_forward",
    "dynamics_adjoint",
    "jacobian_forward",
    "dynamics_hessian",
)
VALUES = ("jacobian_values", "jacobian_u_values", "jacobian_p_values")
NAMES = (*DENSE, *VALUES)


class Graph:
    """`dynamics` and what was derived from it as CasADi evaluates them, at random admissible
    states."""

    def __init__(self, found: Equations) -> None:
        self.found = found
        made = {request.name: request for request in found.requests}
        self.functions = {f.name: f for f in found.functions} | {
            name: made[name].function for name in NAMES if name in made
        }
        self.graph = {
            name: ca.Function(name, slots_of(found, f), [ca.densify(f.result.value)])
            for name, f in self.functions.items()
        }

    def __call__(self, name: str, *arguments: object) -> np.ndarray:
        return np.array(self.graph[name](*arguments))

    def states(self) -> list[tuple[float, np.ndarray, np.ndarray, np.ndarray]]:
        s = sampling.states(self.found.system, 3, 3, parameters=0.2)
        rows = zip(s.t, s.q, s.v, s.u, s.p)
        return [(t, self("state", t, np.r_[q, v], u, p).ravel(), u, p) for t, q, v, u, p in rows]

    def slope(self, name: str, row: tuple, slot: int, x_only: int | None = None) -> np.ndarray:
        """Central differences of a function in an argument, result × entries; of its x slot perhaps
        the first few alone."""
        columns = []
        point = [np.atleast_1d(np.array(part, dtype=float)) for part in row]
        for j in range(len(point[slot]) if x_only is None else x_only):
            h = 1e-5 * max(1.0, abs(point[slot][j]))
            ends = []
            for sign in (1.0, -1.0):
                moved = [part.copy() for part in point]
                moved[slot][j] += sign * h
                ends.append(self(name, *moved).ravel())
            columns.append((ends[0] - ends[1]) / (2 * h))
        return np.array(columns).T.reshape(self.functions[name].result.value.shape[0], -1)

    def close(self, got: np.ndarray, wanted: np.ndarray) -> None:
        assert got.shape == wanted.shape
        np.testing.assert_allclose(
            got, wanted, rtol=1e-5, atol=1e-6 * max(1.0, float(np.abs(wanted).max(initial=0.0)))
        )


def fitting(name: str) -> list[tuple[str, str]]:
    mechanics = system(load(MODELS / f"{name}.yaml"))
    return [(name, f.name) for f in FORMULATIONS if not _misfit(mechanics, f.name)]


def _misfit(mechanics, formulation: str) -> bool:
    try:
        equations(mechanics, None, formulation)
    except AssumptionError:
        return True
    return False


CASES = [
    ("rolling_disk", "quasi_velocities"),
    ("snake3", "quasi_velocities"),
    ("bead_on_wire", "quasi_velocities"),
]


@pytest.fixture(
    scope="module", params=[*CASES, *fitting("four_bar"), *fitting("cart_pole")], ids="-".join
)
def graph(request: pytest.FixtureRequest) -> Graph:
    name, formulation = request.param
    return Graph(equations(system(load(MODELS / f"{name}.yaml")), None, formulation))


def test_jacobians_are_slopes_of_dynamics(graph: Graph) -> None:
    for row in graph.states():
        wanted = {name: graph.slope("dynamics", row, slot) for slot, name in enumerate("txup")}
        graph.close(graph("jacobian", *row), wanted["x"])
        graph.close(graph("jacobian_t", *row), wanted["t"])
        for name in "up":
            assert (f"jacobian_{name}" in graph.functions) == bool(wanted[name].size)
            if wanted[name].size:
                graph.close(graph(f"jacobian_{name}", *row), wanted[name])


def test_values_stand_where_the_pattern_says(graph: Graph) -> None:
    row = graph.states()[0]
    for name in set(VALUES) & set(graph.functions):
        pattern = graph.functions[name].result.pattern
        assert pattern is not None
        dense = np.zeros(pattern.shape)
        dense[pattern.rows, pattern.columns] = graph(name, *row).ravel()
        np.testing.assert_allclose(dense, graph(name.removesuffix("_values"), *row), rtol=1e-14)
        assert list(zip(pattern.rows, pattern.columns)) == sorted(
            set(zip(pattern.rows, pattern.columns))
        )


def test_products_are_those_of_the_jacobians(graph: Graph) -> None:
    rng = np.random.default_rng(0)
    for t, x, u, p in graph.states():
        J = graph("jacobian", t, x, u, p)
        both = np.hstack([J, graph("jacobian_u", t, x, u, p)]) if len(u) else J
        d, y = rng.normal(size=both.shape[1]), rng.normal(size=len(x))
        scale = np.abs(both).max()
        np.testing.assert_allclose(
            graph("dynamics_forward", t, np.r_[x, d], u, p).ravel(),
            both @ d,
            rtol=1e-10,
            atol=1e-11 * scale,
        )
        np.testing.assert_allclose(
            graph("dynamics_adjoint", t, np.r_[x, y], u, p).ravel(),
            y @ both,
            rtol=1e-10,
            atol=1e-11 * scale,
        )


def test_the_slope_of_a_product_is_that_of_the_jacobians(graph: Graph) -> None:
    """∂(J d + f_t τ)/∂(x, u), by differences of the products."""
    rng = np.random.default_rng(1)
    for t, x, u, p in graph.states():
        d = rng.normal(size=len(x) + 1)

        def product(x: np.ndarray, u: np.ndarray, t=t, p=p, d=d) -> np.ndarray:
            J, rate = graph("jacobian", t, x, u, p), graph("jacobian_t", t, x, u, p).ravel()
            return J @ d[:-1] + rate * d[-1]

        columns = []
        for k in range(len(x) + len(u)):
            e = np.zeros(len(x) + len(u))
            e[k] = 1e-5
            ends = [product(x + s * e[: len(x)], u + s * e[len(x) :]) for s in (1.0, -1.0)]
            columns.append((ends[0] - ends[1]) / 2e-5)
        graph.close(graph("jacobian_forward", t, np.r_[x, d], u, p), np.array(columns).T)


def test_the_hessian_is_the_slope_of_the_adjoint_product(graph: Graph) -> None:
    """∂((∂ẋ/∂(x, u))ᵀ y)/∂(x, u), by differences of the products; it is symmetric."""
    rng = np.random.default_rng(2)
    for t, x, u, p in graph.states():
        y = rng.normal(size=len(x))
        columns = []
        for k in range(len(x) + len(u)):
            e = np.zeros(len(x) + len(u))
            e[k] = 1e-5
            ends = [
                graph("dynamics_adjoint", t, np.r_[x + s * e[: len(x)], y], u + s * e[len(x) :], p)
                for s in (1.0, -1.0)
            ]
            columns.append((ends[0] - ends[1]).ravel() / 2e-5)
        hessian = graph("dynamics_hessian", t, np.r_[x, y], u, p)
        graph.close(hessian, np.array(columns).T)
        np.testing.assert_array_equal(hessian, hessian.T)


def test_a_module_has_them_verified(tmp_path: Path) -> None:
    hamel.build(
        MODELS / "cart_pole.yaml",
        out=tmp_path / "cart_pole",
        functions=("default", *NAMES, "step", "step_sensitivity"),
    )
    module = hamel.load(tmp_path / "cart_pole")
    found = Graph(equations(system(load(MODELS / "cart_pole.yaml"))))
    t, x, u, p = found.states()[0]
    assert module.jacobian_u(t, x, u, p).shape == (len(x), 1)
    np.testing.assert_allclose(
        module.jacobian_u(t, x, u, p), found("jacobian_u", t, x, u, p), rtol=1e-12
    )
    described = json.loads((tmp_path / "cart_pole" / "manifest.json").read_text())
    assert described["functions"]["step"]["shape"] == [4]
    assert described["step_methods"] == ["rk4", "rosenbrock"]
    pattern = json.loads((tmp_path / "cart_pole" / "manifest.json").read_text())["functions"][
        "jacobian_values"
    ]["pattern"]
    dense = np.zeros(pattern["shape"])
    dense[pattern["rows"], pattern["columns"]] = module.jacobian_values(t, x, u, p)
    np.testing.assert_allclose(dense, module.jacobian(t, x, u, p), rtol=1e-13)


def test_a_wrong_requested_function_is_not_published(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The code is compared with a graph that was planted an error: what was emitted on request is
    compared too."""
    whole = pipeline.with_emitted

    def wrong(found: Equations, program) -> Equations:
        extended = whole(found, program)
        last = next(f for f in extended.functions if f.name == "jacobian")
        planted = replace(last, result=replace(last.result, value=1.001 * last.result.value))
        return replace(
            extended, functions=tuple(planted if f is last else f for f in extended.functions)
        )

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(pipeline, "with_emitted", wrong)
    with pytest.raises(VerificationError, match="nothing is written"):
        hamel.build(
            MODELS / "pendulum.yaml", out=tmp_path / "pendulum", functions=("default", "jacobian")
        )
    assert not (tmp_path / "pendulum").exists()


def test_what_is_not_there_cannot_be_asked_for() -> None:
    found = equations(
        system(
            load_text(
                "model: free\ncoordinates: {x: m}\nkinetic: der(x)**2/2 * 1 kg\ninitial: {x: 1 m}\n"
            )
        )
    )
    names = {request.name for request in derivatives(found.arguments, found.functions)}
    assert not {"jacobian_u", "jacobian_p", "jacobian_u_values"} & names
    assert {"jacobian", "jacobian_values", "step"} <= names
    still = "model: idle\ncoordinates: {x: m}\nparameters: {a: 1 m}\nkinetic: der(x)**2/2 * 1 kg\noutputs: {y: a*x/(1 m)}\n"
    asked = {request.name: request for request in equations(system(load_text(still))).requests}
    with pytest.raises(AssumptionError, match="does not depend on the parameters"):
        _ = asked["jacobian_p_values"].function


def test_the_only_row_may_say_nothing() -> None:
    """A wheel whose point never moves: of its row no multiplier is left."""
    text = """model: still
plane: xy
bodies: {c: {mass: 1, inertia: 0.1}}
joints: {C: {type: revolute, parent: ground, child: c}}
constraints: {e: {type: no_slip, body: c, direction: y}}
inputs: {u: {joint: C}}
"""
    program = program_of(equations(system(load_text(text))), ("jacobian", "derivatives"))
    assert program.kernel("jacobian").outputs == (0.0, 1.0, 0.0, 0.0)


def test_a_function_on_request_is_made_once() -> None:
    """Choosing functions, making their code and verifying it all ask for it."""
    found, made = equations(system(load(MODELS / "pendulum.yaml"))), list[str]()
    requests = tuple(
        replace(request, make=_counted(request.make, request.name, made))
        for request in found.requests
        if request.make is not None
    )
    for _ in range(2):
        program_of(replace(found, requests=requests), ("jacobian",))
    assert made == ["jacobian"]


def _counted(make: Callable[[], Function], name: str, made: list[str]) -> Callable[[], Function]:
    def counted() -> Function:
        made.append(name)
        return make()

    return counted
