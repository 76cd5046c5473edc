"""A sample of the trials in every run of the tests, in fresh processes.

`make matrix`, `make faults` and `make fuzz` run all of them from a wheel in an environment of its
own.
"""

from __future__ import annotations

import itertools
import random
import sys
from pathlib import Path

import pytest

sys.path.insert(
    0, str(Path(__file__).parent)
)  # the trials are scripts that find each other by their folder

import environment
import fuzz
import matrix
import mechanisms
from environment import Outcome, complaint
from scenes import SCENES, Schema, of_kind


@pytest.fixture(scope="module")
def here(tmp_path_factory):
    """The checkout in place of the wheel."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(environment, "HOME", tmp_path_factory.mktemp("trials"))
        patch.setattr(environment, "PATHS", {"PYTHONPATH": str(environment.ROOT)})
        yield environment.HOME


@pytest.fixture(scope="module")
def schema(here):
    return Schema(environment.run(["schema"], here).out)


def test_the_smallest_hinge_meets_what_users_try_first(here, schema):
    hinge = next(kind for kind in schema.kinds() if kind.name == "joints revolute")
    worker = environment.Worker()
    file = next(
        of_kind(schema, hinge, "planar", matrix.oracle(worker, environment.Record("sample")))
    )
    worker.stop()
    assert set(file.model["joints"]["C"]) == {"type", "parent", "child"}
    for verb in ("build", "list"):
        assert matrix.tried((file.kind, ".yaml", file.text, verb, verb == "list"))[1] == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", [4, 11])
def test_a_random_mechanism_through_the_front_door(here, seed):
    assert mechanisms.tried(seed) == (["mechanism"], [])


def test_an_interrupted_run_goes_on_where_it_was(tmp_path):
    """What went well is counted, what failed is tried again."""
    tried = []

    def work(number):
        tried.append(number)
        return ["trial"], ["odd"] if number % 2 and len(tried) < 3 else []

    items = [(str(number), number) for number in range(4)]
    first = environment.Record("sample", folder=tmp_path)
    first.all(work, items[:2], processes=1)
    assert first.write() == 1
    again = environment.Record("sample", resume=True, folder=tmp_path)
    again.all(work, items, processes=1)
    assert tried == [0, 1, 1, 2, 3] and again.tried["trial"] == 4 and again.write() == 0


def test_the_schema_tells_every_kind_that_hamel_lists(here, schema):
    """So that nothing is left out of the matrix by a schema that says less than `hamel list`."""
    listed = environment.json.loads(environment.run(["list", "--json"], here).out)["kinds"]
    names = {kind.name for kind in schema.kinds()}
    for section in ("joints", "closures", "loads"):
        assert {f"{section} {entry['name']}" for entry in listed[section]} <= names


def test_each_scene_is_a_model_of_its_own():
    assert len({str(scene.model) for scene in SCENES}) == len(SCENES)


@pytest.mark.parametrize(
    ("code", "err", "words"),
    [
        (70, "error: internal error", "exit 70"),
        (1, "Traceback (most recent call last)", "Traceback"),
        (0, "warning: divide by zero encountered in divide", "encountered in"),
        (0, "m.py:3: RuntimeWarning: overflow", "RuntimeWarning"),
        (-11, "", "exit -11"),
        (1, "", "without a word"),
        (3, "error: no compiler", "no true reason"),
        (0, "warning: joint a has no limits", ""),
        (1, "error: m.yaml:1:1: no such key", ""),
    ],
)
def test_what_counts_as_a_failure(here, code, err, words):
    assert words in complaint(Outcome(("check", "m.yaml"), code, "", err)) or not words
    assert bool(complaint(Outcome(("check", "m.yaml"), code, "", err))) == bool(words)


@pytest.mark.parametrize("seed", range(12))
def test_random_mechanisms_meet_their_own_constraints(seed):
    made = mechanisms.mechanism(seed)
    total, rank, least = made.rank(made.pose)
    assert abs(made.residual(made.pose)).max(initial=0) < 1e-12 and total > rank and 0 < least <= 1


def test_slips_change_files_and_repeat_by_their_seed():
    given = fuzz.seeds()
    first, second = ([fuzz.mutated(given, random.Random(k)) for k in range(30)] for _ in range(2))
    originals = set(given)
    assert first == second and sum(one in originals for one in first) < 10
    assert len(list(itertools.chain(given))) > 20


@pytest.mark.parametrize("robot", ["arm.urdf", "hand.xml"])
def test_what_hamel_says_of_a_robot_file_is_no_warning_of_a_library(here, robot):
    worker = environment.Worker()
    end = worker.call("check", str(environment.ROBOTS / robot), limit=60.0)
    worker.stop()
    assert end["code"] == 0 and not end["warnings"]
