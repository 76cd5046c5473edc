"""The command line: one JSON object on standard output, documented exit codes, no traceback for a user's mistake."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hamel import failures
from hamel.cli import main

MODELS = Path(__file__).parent.parent / "models"
SNAKE = str(MODELS / "snake3.yaml")
FOUR_BAR = str(MODELS / "four_bar.yaml")
VERBS = ("build", "check", "choices", "derive", "explain", "list", "schema", "simulate", "verify")
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(MODELS.parent)}


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    """Every test runs in an empty folder."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def hamel(capsys):
    """Run the command in this process: (exit code, standard output, standard error)."""

    def run(*arguments):
        with pytest.raises(SystemExit) as ended:
            main(arguments)
        return (ended.value.code, *capsys.readouterr())

    return run


def spawn(*arguments, **options):
    return subprocess.Popen([sys.executable, "-m", "hamel", *arguments], env=ENVIRONMENT, text=True, **options)


def one_object(text: str):
    assert text.count("\n") == 1
    found = json.loads(text)
    assert isinstance(found, dict)
    return found


def test_help_names_every_verb(hamel):
    code, out, _ = hamel("--help")
    assert code == 0
    assert all(f"\n  {verb} " in out for verb in VERBS)


@pytest.mark.parametrize(
    "arguments",
    [
        ("check", SNAKE),
        ("build", SNAKE, "--choice", "head"),
        ("verify", SNAKE, "--choice", "head", "--states", "5"),
        ("simulate", SNAKE, "--time", "0.1"),
        ("derive", SNAKE, "--choice", "head"),
        ("choices", SNAKE),
        ("list",),
        ("list", SNAKE),
        ("explain", SNAKE),
        ("schema",),
    ],
    ids=" ".join,
)
def test_json_is_one_object_and_nothing_else(hamel, arguments):
    code, out, _ = hamel(*arguments, "--json")
    assert code == 0, out
    one_object(out)


@pytest.mark.parametrize("verb", ["check", "choices", "explain", "list"])
def test_people_get_text(hamel, verb):
    code, out, err = hamel(verb, FOUR_BAR)
    assert (code, err) == (0, "")
    assert "crank" in out and not out.startswith("{")


def test_build_reports_folder_operations_and_time(hamel, tmp_path):
    _, out, _ = hamel("build", FOUR_BAR, "--choice", "crank", "-o", "out/four_bar", "--json")
    built = one_object(out)
    manifest = json.loads((tmp_path / "out/four_bar/manifest.json").read_text())
    assert built["folder"] == "out/four_bar"
    assert built["verified"] is True
    assert built["operations"]["dynamics"] > 0
    assert set(built["seconds"]) >= {"model", "mechanics", "formulation", "passes", "code", "verify"}
    assert manifest["operations"] == built["operations"]
    assert os.listdir(tmp_path / "out") == ["four_bar"]


def test_build_replaces_only_what_it_made(hamel, tmp_path):
    assert hamel("build", SNAKE)[0] == 0
    assert hamel("build", SNAKE)[0] == 0
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/thesis.tex").write_text("years of work")
    code, _, err = hamel("build", SNAKE, "-o", "mine")
    assert code == 3 and "not hamel's to replace" in err
    assert (tmp_path / "mine/thesis.tex").read_text() == "years of work"


def test_verify_prefixes_checks_with_the_choice(hamel):
    _, out, _ = hamel("verify", FOUR_BAR, "--states", "5", "--json")
    found = one_object(out)
    assert found["passed"] and found["model"] == "four_bar"
    assert {check["name"].split(": ")[0] for check in found["checks"]} >= {"crank", "rocker", "tangent"}
    assert all({"name", "value", "tolerance", "passed"} <= set(check) for check in found["checks"])


# Mistakes ------------------------------------------------------------------------------------------------------------


def _binary(folder):
    (folder / "binary.yaml").write_bytes(bytes(range(256)))
    return "binary.yaml"


def _misspelt(folder):
    (folder / "misspelt.yaml").write_text(Path(SNAKE).read_text().replace("bodies:", "bodys:"))
    return "misspelt.yaml"


@pytest.mark.parametrize("verb", ["check", "build", "verify", "simulate", "derive", "choices", "list", "explain"])
@pytest.mark.parametrize(
    "make", [lambda folder: "none.yaml", str, _binary, _misspelt], ids=["missing", "folder", "binary", "misspelt"]
)
def test_unreadable_models_are_model_errors(hamel, tmp_path, verb, make):
    path = make(tmp_path)
    before = set(os.listdir(tmp_path))
    code, out, err = hamel(verb, path)
    assert (code, out) == (1, "")
    assert "error: " in err and "Traceback" not in err and "internal" not in err
    assert set(os.listdir(tmp_path)) == before


def test_errors_as_json_say_where(hamel, tmp_path):
    code, out, err = hamel("check", _misspelt(tmp_path), "--json")
    said = one_object(out)
    assert (code, said["exit_code"], err) == (1, 1, "")
    assert said["error"]["file"] == "misspelt.yaml"
    assert said["error"]["line"] > 1 and said["error"]["column"] == 1
    assert "bodys" in said["error"]["message"] and "bodies" in said["error"]["hint"]


def test_unknown_choice_names_the_known_ones(hamel):
    code, _, err = hamel("build", FOUR_BAR, "--choice", "cranc")
    assert code in (1, 2) and "cranc" in err and "crank" in err


@pytest.mark.parametrize("place", ["/proc/hamel", "occupied/below"])
@pytest.mark.parametrize("arguments", [("build", "-o"), ("derive", "-o"), ("simulate", "--time", "0.01", "--plot")], ids=" ".join)
def test_places_that_cannot_be_written(hamel, tmp_path, arguments, place):
    (tmp_path / "occupied").write_text("a file")
    suffix = "/motion.svg" if "simulate" in arguments else ""
    code, _, err = hamel(arguments[0], SNAKE, *arguments[1:], place + suffix)
    assert code == 3 and "cannot write" in err
    assert os.listdir(tmp_path) == ["occupied"]


def _failing(model, equations, module=None, **options):
    from hamel.verify.records import Check, Verification

    check = Check("acceleration", 1.0, 1e-10, False, "planted")
    return Verification(model.name, equations.choice, False, (check,), 20, 0)


def test_failed_verification_leaves_nothing_behind(hamel, tmp_path, monkeypatch):
    monkeypatch.setattr("hamel.verbs.build.verification", _failing)
    code, _, err = hamel("build", SNAKE)
    assert code == 4 and "acceleration" in err
    assert os.listdir(tmp_path) == []


def test_failed_verification_is_exit_code_4(hamel, monkeypatch):
    monkeypatch.setattr("hamel.verbs.verify.verification", _failing)
    code, out, _ = hamel("verify", SNAKE, "--json")
    assert code == 4 and one_object(out)["passed"] is False


def test_missing_compiler(hamel, tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    code, _, err = hamel("build", SNAKE)
    assert code == 3 and "install" in err
    assert os.listdir(tmp_path) == []
    with pytest.warns(RuntimeWarning, match="NumPy"):
        assert hamel("build", SNAKE, "--numpy")[0] == 0
    assert (tmp_path / "generated/snake3/manifest.json").exists()


@pytest.mark.parametrize(
    "arguments", [("build",), ("build", SNAKE, "--no-such"), ("bild", SNAKE), ("verify", SNAKE, "--states", "0")]
)
def test_wrong_usage(hamel, arguments):
    code, out, err = hamel(*arguments)
    assert (code, out) == (64, "") and "error: " in err
    code, out, _ = hamel(*arguments, "--json")
    assert one_object(out)["exit_code"] == code == 64


def test_internal_errors_ask_for_a_report(hamel, monkeypatch):
    monkeypatch.setattr("hamel.api.check", lambda path: 1 / 0)
    monkeypatch.setattr("hamel.check", lambda path: 1 / 0)
    code, _, err = hamel("check", SNAKE)
    assert code == 70 and "please report" in err and err.count("\n") == 1
    with pytest.raises(ZeroDivisionError):
        main(["check", SNAKE, "--debug"])


def test_interrupt(hamel, monkeypatch):
    def interrupted(path):
        raise KeyboardInterrupt

    monkeypatch.setattr("hamel.check", interrupted)
    assert hamel("check", SNAKE)[0] == 130


def test_closed_pipe():
    reading = spawn("list", stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert reading.stdout and reading.stderr
    reading.stdout.close()
    assert reading.stderr.read() == ""
    assert reading.wait() == failures.PIPE


def test_interrupted_build_leaves_nothing(tmp_path):
    working = spawn("build", SNAKE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path)
    time.sleep(0.4)
    working.send_signal(signal.SIGINT)
    _, err = working.communicate()
    assert working.returncode in (0, 130) and "Traceback" not in err
    assert working.returncode == 0 or os.listdir(tmp_path) in ([], ["generated"])
