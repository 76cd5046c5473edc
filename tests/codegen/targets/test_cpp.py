"""The C++ header: every standard takes it without a warning, its values are those of the module,
errors in it are seen, and names that C++ keeps for itself are refused.

Of codegen.targets: cpp.
Of hamel.verify.targets: cpp.
"""

import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from codegen import compiler
from codegen.emit import emit
from codegen.passes import program
from derive.diagnostics import AssumptionError
from hamel.verify.targets import cpp
from tests.subjects import subject
from tests.toy import toy

EIGEN = """#include "cart_pole.hpp"
namespace m = hamel::cart_pole;
int main()
{
    Eigen::Matrix<double, 4, 1> x, out;
    const Eigen::Matrix<double, 1, 1> u(1.0);
    x << 0.0, 0.1, 0.2, 0.3;
    const m::Parameters p = m::defaults();
    const Eigen::Map<const Eigen::Matrix<double, 5, 1>> own(p.data());
    Eigen::Matrix<double, 2, 2, Eigen::RowMajor> M;
    m::State same;
    if (m::dynamics(0.0, x, u, own, out) != m::Status::ok || m::mass(0.0, x, u, own, M) != m::Status::ok)
        return 1;
    if (m::dynamics(0.0, m::State{{0.0, 0.1, 0.2, 0.3}}, m::Inputs{{1.0}}, p, same) != m::Status::ok)
        return 2;
    return out == Eigen::Map<const Eigen::Matrix<double, 4, 1>>(same.data()) && M == M.transpose() ? 0 : 3;
}
"""

pytestmark = pytest.mark.skipif(
    compiler.find_compiler() is None or not shutil.which("g++"), reason="no compilers"
)


@pytest.fixture(scope="module")
def cart_pole(tmp_path_factory):
    base = tmp_path_factory.mktemp("cpp")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        return subject(base, "cart_pole", ["cpp"], ("dynamics", "mass", "jacobian_u", "jacobian_t"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("before", "after", "seen"),
    [
        ("cart_pole_jacobian_u(t", "cart_pole_jacobian_t(t", "values"),
        ("nu = 1", "nu = 2", "values"),
        ("cart_pole_mass(t", "cart_pole_mass(0.5 + t", None),  # nothing depends on time
        (
            "noexcept\n{\n    return s",
            "noexcept\n{\n    int lost = t;\n    return s",
            "no warnings",
        ),
    ],
)
def test_errors_in_the_header_are_seen(cart_pole, tmp_path, before, after, seen):
    text = (cart_pole.folder / "cart_pole.hpp").read_text("utf-8")
    (tmp_path / "cart_pole.hpp").write_text(text.replace(before, after))
    for name in ("cart_pole.h", compiler.shared_library("cart_pole")):
        shutil.copy(cart_pole.folder / name, tmp_path)
    failed = [
        result.name
        for result in cpp.check(replace(cart_pole, folder=tmp_path))
        if not result.passed
    ]
    assert failed == ([seen] if seen else [])


def eigen() -> list[str]:
    """Where packages of Debian and of the index put Eigen."""
    places = ["/usr/include/eigen3", *(f"{path}/cmeel.prefix/include/eigen3" for path in sys.path)]
    return [place for place in places if Path(place).is_dir()]


@pytest.mark.slow
def test_matrices_of_eigen_are_taken(cart_pole, tmp_path):
    if not eigen():
        pytest.skip("Eigen is not installed")
    (tmp_path / "main.cpp").write_text(EIGEN)
    library = cart_pole.folder / compiler.shared_library("cart_pole")
    command = ["g++", "-std=c++11", *cpp.STRICT, f"-I{cart_pole.folder}", "-isystem", eigen()[0]]
    linked = ["main.cpp", str(library), f"-Wl,-rpath,{cart_pole.folder}", "-o", "main"]
    subprocess.run([*command, *linked], cwd=tmp_path, check=True)
    assert subprocess.run([tmp_path / "main"], check=False).returncode == 0


@pytest.mark.parametrize("name", ["namespace", "co_await", "std", "linux"])
def test_names_that_cpp_keeps_are_refused(name):
    made = replace(program(toy(name)), targets=("cpp",))
    with pytest.raises(AssumptionError, match=f"'{name}'"):
        emit(made)
    assert emit(replace(made, targets=()))  # it is the header alone that cannot have the name
