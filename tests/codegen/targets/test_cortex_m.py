"""The Cortex-M target: values in QEMU, errors that are seen, what is refused, a controller only
where inputs give every rate.

Of codegen.targets: cortex_m.
Of hamel.verify.targets: cortex_m.
"""

import shutil
from dataclasses import replace

import pytest

from codegen import compiler, loader
from codegen.emit import emit
from codegen.passes import program
from derive.diagnostics import AssumptionError
from hamel.build.module import published
from hamel.build.options import BuildOptions
from hamel.build.stages import equations_of, program_for, with_emitted
from hamel.build.targets import subject_of
from hamel.verify.shipped import shipped
from hamel.verify.targets import cortex_m as checked
from tests.scenes import MODELS
from tests.toy import toy

needs_qemu = pytest.mark.skipif(
    compiler.find_compiler() is None or not all(map(shutil.which, checked.TOOLS)),
    reason="no arm-none-eabi-gcc, or no QEMU",
)

# a function in double, which the main calls as it calls the others
DOUBLE = """volatile double twice;
int four_bar_double(void);
int four_bar_double(void)
{
    twice = twice * 3.0;
    return (int)twice;
}
__attribute__((used, section(".vectors"))) static int (*const kept)(void) = four_bar_double;
int four_bar_dynamics(float t"""


@pytest.fixture(scope="module")
def four_bar(tmp_path_factory):
    base = tmp_path_factory.mktemp("cortex")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        equations = equations_of(MODELS / "four_bar.yaml", "crank")
        options = BuildOptions(functions=("dynamics",), targets=("cortex-m",), real="float32")
        made = program_for(equations, options)
        names = [kernel.name for kernel in made.kernels]
        rows = shipped(with_emitted(equations, made), names, 0)
        folder = published(made, base / "four_bar").folder
        return subject_of(made, loader.load(folder), rows)


@needs_qemu
@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "before", "after", "seen"),
    [
        ("check.c", "print_word(word);", "print_word(word ^ 65536);", "values"),
        ("check.c", "x[-1], x, u, p", "x[-1], x, p, u", "values"),
        ("control.c", "at[NX + NW]", "at[NX + NW + 600]", "stack of the controller"),
        ("../four_bar.c", "int four_bar_dynamics(float t", DOUBLE, "no double, no heap"),
        ("check.c", "MOST = ", "MOST = 10 + ", None),
    ],
)
def test_errors_are_seen(four_bar, tmp_path, file, before, after, seen):
    shutil.copytree(four_bar.folder, tmp_path / "four_bar")
    place = tmp_path / "four_bar" / "cortex-m" / file
    text = place.read_text("utf-8")
    assert before in text
    place.write_text(text.replace(before, after))
    results = checked.check(replace(four_bar, folder=tmp_path / "four_bar"))
    failed = {result.name.split(" on ")[0] for result in results if not result.passed}
    assert (seen in failed) if seen else not failed


@needs_qemu
@pytest.mark.slow
def test_instructions_and_stack_are_measured(four_bar):
    run = checked.measured(four_bar, "cortex-m7")
    instructions, stack = run.cost["dynamics"]
    assert 100 < instructions < 5000 and 0 < stack < 2048


def test_double_is_refused_and_a_controller_is_there_where_it_can_be():
    with pytest.raises(AssumptionError, match="--real float32"):
        emit(replace(program(toy()), targets=("cortex-m",)))
    options = BuildOptions(functions=("dynamics",), targets=("cortex-m",), real="float32")
    made = program_for(equations_of(MODELS / "cart_pole.yaml"), options)
    files = emit(made)
    assert "cortex-m/check.c" in files and "cortex-m/control.c" not in files
