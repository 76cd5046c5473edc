"""`make matrix`: every verb of the command line on the smallest legal file of everything the
schema knows, each in a fresh process.

A process fails the trial when it ends by a code that is not documented or is no true reason here
(70, 3, 4), shows a traceback or a warning of a library, or prints no JSON under --json. The
smallest file of each kind meets every verb; one with another optional key is built, checked and
meets one more verb, in turn.
"""

from __future__ import annotations

import itertools
import json
import re
import shutil
import sys
from collections.abc import Callable, Collection, Iterator
from functools import cache
from pathlib import Path

import environment
import mechanisms
from environment import Ends, Outcome, Record, Worker, asked, complaint, documented, run
from scenes import File, Schema, files, put_beside

# What a verb is given beside the file so that it ends soon and writes where we look; any other verb
# is run with the file alone.
SHORT: dict[str, tuple[str, ...]] = {
    "build": ("-o", "module"),
    "verify": ("--states", "5"),
    "simulate": ("--time", "0.5", "-o", "motion.csv"),
    "derive": ("-o", "pages"),
    "linearize": ("-o", "page.html"),
    "report": ("--time", "0.5", "--budget", "2", "-o", "report"),
    "sweep": ("--vary", "rtol=1e-7, 1e-9", "--time", "0.1", "-o", "study"),
    "identify": ("--base",),
    "import": ("-o", "imported.yaml"),
}
SELDOM = ("report", "extremes", "book")  # on every fortieth smallest file: they take many runs
CLAIMS = ("reference", "extremes")  # sections whose made-up numbers verification may refuse
ROBOTS = ".urdf", ".xml"


@cache
def verbs() -> dict[str, str]:
    """The verbs of `hamel --help`, each with what its usage line says it takes."""
    listed = run(["--help"], environment.HOME).out.partition("Commands:")[2]
    names = re.findall(r"^  ([a-z]+) {2,}\S", listed, re.MULTILINE)
    return {name: run([name, "--help"], environment.HOME).out.partition("\n")[0] for name in names}


def with_model() -> list[str]:
    return [name for name, usage in verbs().items() if "MODEL" in usage]


def fails(kind: str, outcome: Outcome) -> str:
    """What is wrong with the end of one process; its arguments are as they should be."""
    claims = kind.split(",")[0].split()[0] in CLAIMS
    return complaint(outcome, (1, 2, 4) if claims else (1, 2))


Job = tuple[str, str, str, str, bool]  # kind, suffix, text, verb, as JSON


def tried(job: Job) -> Ends:
    """Run one verb on one file in a folder of its own."""
    kind, suffix, text, verb, as_json = job
    folder = Path(environment.tempfile.mkdtemp(dir=environment.HOME))
    (folder / f"m{suffix}").write_text(text)
    put_beside(folder)
    more = [*SHORT.get(verb, ()), *(["--json"] if as_json else [])]
    outcome = run([verb, f"m{suffix}", *more], folder)
    wrong = fails(kind, outcome)
    shutil.rmtree(folder)
    told = f"{' '.join(outcome.arguments)} of {kind}: {wrong}\n{compact(text)}"
    return [f"{verb} {outcome.code}"], [told] if wrong else []


def compact(text: str) -> str:
    return json.dumps(json.loads(text)) if text.startswith("{") else text[:2000]


def jobs_of(
    kind: str, suffix: str, text: str, smallest: bool, legal: bool, turn: Iterator[int]
) -> Iterator[tuple[str, Job]]:
    """Every verb on a smallest file; two on a legal other one, one on a refused one."""
    number = next(turn)
    one = with_model()[number % len(with_model())]
    chosen = with_model() if smallest else [*(["build"] if legal else []), one]
    often = smallest and number % 40 == 0
    for verb in dict.fromkeys(verb for verb in chosen if often or verb not in SELDOM):
        as_json = (number + len(verb)) % 3 == 0
        yield f"{kind}: {verb} {as_json} {text}", (kind, suffix, text, verb, as_json)


def robots() -> Iterator[tuple[str, str, str, bool]]:
    """URDF and MJCF files, small ones of every joint and those of the tests; and what `hamel
    import` writes of them."""
    small = [(f"urdf {kind}", ".urdf", URDF.format(kind=kind)) for kind in URDF_JOINTS]
    small += [
        (f"mjcf {kind or 'weld'}", ".xml", MJCF.format(joint=MJCF_JOINTS[kind]))
        for kind in MJCF_JOINTS
    ]
    whole = [
        (path.name, path.suffix, path.read_text())
        for path in sorted(environment.ROBOTS.glob("*.*"))
    ]
    for kind, suffix, text in (*small, *whole):
        yield kind, suffix, text, (kind, suffix, text) in small
        folder = Path(environment.tempfile.mkdtemp(dir=environment.HOME))
        (folder / f"m{suffix}").write_text(text)
        run(["import", f"m{suffix}", "-o", "m.yaml"], folder)
        if (folder / "m.yaml").exists():
            yield (
                f"{kind}, imported",
                ".yaml",
                (folder / "m.yaml").read_text(),
                (kind, suffix, text) in small,
            )


URDF_JOINTS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
URDF = """<robot name="m"><link name="base"/>
<link name="arm"><inertial><origin xyz="0.1 0 0.2" rpy="0 0 0"/><mass value="1"/>
<inertia ixx="0.1" iyy="0.2" izz="0.25" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="{kind}"><parent link="base"/><child link="arm"/>
<origin xyz="0 0 0.1" rpy="0 0.3 0"/><axis xyz="0 1 0"/>
<limit effort="1" velocity="1" lower="-1" upper="1"/></joint></robot>
"""
MJCF_JOINTS = {
    "hinge": '<joint axis="0 1 0"/>',
    "slide": '<joint type="slide" axis="0 1 0"/>',
    "ball": '<joint type="ball"/>',
    "free": "<freejoint/>",
    "": "",
}
MJCF = """<mujoco model="m"><worldbody><body name="arm" pos="0 0 1">{joint}
<geom type="box" size="0.1 0.2 0.3" mass="1" pos="0.1 0 0.2"/></body></worldbody></mujoco>
"""


def oracle(worker: Worker, record: Record) -> Callable[[dict], str]:
    """Why `hamel check` refuses a model; each is asked once. What it must not say of any model
    is a failure."""
    known: dict[str, str] = {}
    path = environment.HOME / "asked.yaml"
    put_beside(environment.HOME)

    def refusal(model: dict) -> str:
        text = json.dumps(model, indent=1)
        if text not in known:
            path.write_text(text)
            end = worker.call("check", str(path))
            known[text] = end["text"]
            wrong = end["warnings"] or ([end["text"]] if end["code"] not in (0, 1, 2) else [])
            record.note(
                f"hamel.check {end['code']}",
                f"hamel.check: {wrong[0]} of {json.dumps(model)}" if wrong else "",
            )
        return known[text]

    return refusal


def kinds_of_trial() -> list[str]:
    """Verbs alone, sections of a model file, the keys of the file itself, robots, mechanisms."""
    schema = Schema(run(["schema"], environment.HOME).out)
    sections = dict.fromkeys(kind.section for kind in schema.kinds())
    return ["verbs", *sections, "keys", "robots", "mechanisms"]


def all_jobs(
    record: Record, refusal: Callable[[dict], str], wanted: Collection[str]
) -> Iterator[tuple[str, Job]]:
    turn = itertools.count()
    schema = Schema(run(["schema"], environment.HOME).out)
    seen: set[str] = set()
    for file in files(schema, refusal, wanted):
        seen.add(file.kind.partition(",")[0])
        yield from jobs_of(named(file), ".yaml", file.text, not file.key, file.legal, turn)
    for kind in schema.kinds():
        if kind.section in wanted:
            missing = f"no legal file of {kind.name} could be written from the schema"
            record.note("kinds", "" if kind.name in seen else missing)
    if "robots" in wanted:
        yield from robot_jobs(turn)


def robot_jobs(turn: Iterator[int]) -> Iterator[tuple[str, Job]]:
    for kind, suffix, text, small in robots():
        yield from jobs_of(kind, suffix, text, small, True, turn)
        if suffix in ROBOTS:
            yield f"{kind}: import {text}", (kind, suffix, text, "import", False)


def named(file: File) -> str:
    return f"{file.kind}, {file.key} given" if file.key else file.kind


def alone(record: Record) -> None:
    """Every verb without a file."""
    for verb, usage in verbs().items():
        json_too = [] if "MODEL" in usage or "ROBOT" in usage else [[verb, "--json"]]
        for arguments in ([verb], [verb, "--help"], *json_too):
            outcome = run(arguments, environment.HOME)
            record.note(f"{verb} {outcome.code}", fault(arguments, complaint(outcome)))


def matrix(record: Record, wanted: Collection[str]) -> None:
    worker = Worker()
    record.all(tried, all_jobs(record, oracle(worker, record), wanted))
    worker.stop()


def fault(arguments: list[str], wrong: str) -> str:
    return wrong and f"hamel {' '.join(arguments)}: {wrong}"


def main() -> int:
    given = asked(__doc__ or "", kinds_of_trial(), count=300)
    record = Record("matrix", given.resume)
    assert 70 not in documented() and 1 in documented()
    if "verbs" in given.kinds:
        alone(record)
    matrix(record, given.kinds)
    if "mechanisms" in given.kinds:
        mechanisms.tried_all(record, given.count)
    return record.write()


if __name__ == "__main__":
    sys.exit(main())
