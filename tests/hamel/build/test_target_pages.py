"""The pages of docs/targets: their commands and their code run, in the order they stand there, where
the tools they are about are installed. For acados, which no package index carries, a package of the
same name and fields stands in."""

import importlib.util
import os
import re
import shlex
import shutil
import subprocess
import sys

import pytest

from codegen.compiler import find_compiler
from codegen.targets import ON_REQUEST
from tests.scenes import MODELS, ROOT

PAGES = sorted((ROOT / "docs" / "targets").glob("[a-z]*.md"))
# what the code of each page imports
PACKAGES = {
    "casadi": "casadi", "acados": "acados_template", "fmu": "fmpy", "fmu2": "fmpy",
    "numba": "numba", "jax": "jax",
}  # fmt: skip
# the fields that our pages and generated code fill; no others can be set
STAND_INS = {
    "acados_template": """
class AcadosModel:
    __slots__ = ["name", "x", "xdot", "u", "z", "p", "f_impl_expr", "f_expl_expr", "disc_dyn_expr",
        "dyn_ext_fun_type", "dyn_generic_source", "dyn_disc_fun", "dyn_disc_fun_jac",
        "dyn_disc_fun_jac_hess"]
class AcadosOcpOptions:
    __slots__ = ["integrator_type", "hessian_approx"]
class AcadosOcp:
    __slots__ = ["model", "parameter_values", "solver_options"]
    def __init__(self):
        self.solver_options = AcadosOcpOptions()
"""
}
# and what its commands run
TOOLS = {
    "wasm": ("node", "wasm-ld"),
    "matlab": ("octave-cli", "mkoctfile"),
    "cortex-m": ("arm-none-eabi-gcc", "qemu-system-arm"),
}
OTHERS = {"js": ("main.mjs", "node"), "matlab": ("main_script.m", "octave-cli")}
BLOCK = re.compile(r"^```(sh|python|cpp|js|matlab)\n(.*?)^```", re.DOTALL | re.MULTILINE)

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(find_compiler() is None, reason="no C compiler"),
]


def run(place, *command):
    paths = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    environment = {**os.environ, "PYTHONPATH": paths, "XDG_CACHE_HOME": str(place / "cache")}
    done = subprocess.run(
        command, check=False, cwd=place, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, f"{shlex.join(command)}\n{done.stdout}{done.stderr}"


def test_every_target_on_request_has_its_page():
    assert {target.name for target in ON_REQUEST} <= {page.stem for page in PAGES}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_the_page_shows_runs(page, tmp_path):
    package = PACKAGES.get(page.stem, "hamel")
    if importlib.util.find_spec(package) is None:
        if package not in STAND_INS:
            pytest.skip(f"{package} is not installed")
        (tmp_path / f"{package}.py").write_text(STAND_INS[package])
    missing = [tool for tool in TOOLS.get(page.stem, ()) if shutil.which(tool) is None]
    if missing:
        pytest.skip(f"{missing[0]} is not installed")
    shutil.copytree(MODELS, tmp_path / "models")
    code = ""
    for language, text in BLOCK.findall(page.read_text("utf-8")):
        if language == "sh":
            for line in text.splitlines():
                command = shlex.split(line, comments=True)
                hamel = [sys.executable, "-m", "hamel"]
                run(tmp_path, *(hamel if command[0] == "hamel" else command[:1]), *command[1:])
        elif language == "cpp":
            (tmp_path / "main.cpp").write_text(text)
        elif language in OTHERS:
            file, program = OTHERS[language]
            (tmp_path / file).write_text(text)
            run(tmp_path, program, file)
        else:
            code += text
    run(tmp_path, sys.executable, "-c", code)
