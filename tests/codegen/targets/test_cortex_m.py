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


def on_board(base, model, choice=None):
    """`dynamics` of a model in float32, with its target."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        equations = equations_of(MODELS / f"{model}.yaml", choice)
        options = BuildOptions(functions=("dynamics",), targets=("cortex-m",), real="float32")
        made = program_for(equations, options)
        names = [kernel.name for kernel in made.kernels]
        rows = shipped(with_emitted(equations, made), names, 0, real=made.real)
        folder = published(made, base / made.name).folder
        return subject_of(made, loader.load(folder), rows)


@pytest.fixture(scope="module")
def four_bar(tmp_path_factory):
    return on_board(tmp_path_factory.mktemp("cortex"), "four_bar", "crank")


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


@needs_qemu
@pytest.mark.slow
def test_first_order_states_stand_behind_the_others(tmp_path):
    """The controller reads w from its place, and the check takes longer rows."""
    muscle = on_board(tmp_path, "gallery/muscle_activation")
    names = [result.name for result in checked.check(muscle) if result.passed]
    assert names == [result.name for result in checked.check(muscle)]
    assert "values on M7" in names


@needs_qemu
@pytest.mark.slow
def test_sines_of_the_library_are_linked(tmp_path):
    """newlib's sinf tells of errors where a C library would be asked to."""
    cart_pole = on_board(tmp_path, "cart_pole")
    assert not [result for result in checked.check(cart_pole) if not result.passed]
    place = cart_pole.folder / "cortex-m" / "start.c"
    place.write_text(place.read_text("utf-8").replace("__errno", "_other"))
    failed = [result for result in checked.check(cart_pole) if not result.passed]
    assert "undefined reference to `__errno'" in failed[0].about


def test_lines_that_the_program_did_not_print_are_none_of_its_results():
    said = "ld: in function with_errno: in\ndynamics 00000000 3f800000\nmake: *** run Error 1\n"
    run = checked._run(said + "instructions dynamics 00000010 00000020\n")
    assert run.cost == {"dynamics": (16, 32)}
    assert {name: [list(row) for row in rows] for name, rows in run.results.items()} == {
        "dynamics": [[1.0]]
    }


def test_symbols_of_double_heap_and_printing_are_known():
    wanted = ["__aeabi_dadd", "__aeabi_f2d", "__aeabi_ui2d", "__muldf3", "__fixunsdfsi", "malloc"]
    others = ["__math_invalidf", "__aeabi_fadd", "__aeabi_idiv", "sinf", "four_bar_dynamics"]
    assert all(map(checked.UNWANTED.fullmatch, [*wanted, "_sbrk_r", "sprintf", "__gedf2"]))
    assert not any(map(checked.UNWANTED.fullmatch, others))


def test_double_is_refused_and_a_controller_is_there_where_it_can_be():
    with pytest.raises(AssumptionError, match="--real float32"):
        emit(replace(program(toy()), targets=("cortex-m",)))
    options = BuildOptions(functions=("dynamics",), targets=("cortex-m",), real="float32")
    made = program_for(equations_of(MODELS / "cart_pole.yaml"), options)
    files = emit(made)
    assert "cortex-m/check.c" in files and "cortex-m/control.c" not in files
