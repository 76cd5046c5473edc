"""The MATLAB target, by Octave: the MEX file built by mkoctfile, and the class called for every
function and a motion, against the module."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from derive.diagnostics import ToolchainError
from hamel.verify.records import CheckResult
from hamel.verify.targets.motions import motion_of
from hamel.verify.targets.records import Subject, TargetCheck, result

INSTALL = "apt install octave octave-dev"
LIMIT = 300.0  # s, of the calls; the compiler takes as long as it needs
# every function one by one, then all its states at once
CALL = """
data = read('{function}.in', {width});
one = []; many = [];
for k = 1:columns(data)
    u = data({x} + 1:{u}, k);
    value = {name}.{function}(data(1, k), data(2:{x}, k), u, data({u} + 1:end, k));
    one(:, k) = value.'(:);
end
x = data(2:{x}, :); u = data({x} + 1:{u}, :); p = data({u} + 1:end, :);
value = {name}.{function}(data(1, :), x, u, p);
for k = 1:columns(data)
    page = value(:, k);
    if ndims(value) == 3 || columns(value) != columns(data)
        page = value(:, :, k).'(:);
    end
    many(:, k) = page(:);
end
write('{function}.out', [one(:); many(:)]);
"""
BUILD = """
addpath('{folder}/matlab');
{name}.build();
"""
HEAD = """
addpath('{folder}/matlab');
function data = read(file, width)
    id = fopen(file); data = fread(id, [width, Inf], 'double'); fclose(id);
end
function write(file, values)
    id = fopen(file, 'w'); fwrite(id, values, 'double'); fclose(id);
end
help_text = help('{name}');
write('help.out', numel(strfind(help_text, '{name}.build()')));
"""
MOTION = """
data = read('motion.in', 1);
times = data(1:{n}); x = data({n} + 1:{x}); u = data({x} + 1:{u}); p = data({u} + 1:end);
options = struct('rtol', {rtol}, 'atol', {rtol}); options.u = u; options.p = p;
motion = {name}.simulate(times, x, options);
write('motion.out', [motion.steps; motion.x(:)]);
"""


def check(subject: Subject) -> Iterator[CheckResult]:
    """ToolchainError without Octave or its mkoctfile."""
    for tool in ("octave-cli", "mkoctfile"):
        if shutil.which(tool) is None:
            raise ToolchainError(f"{tool} is not installed", INSTALL)
    motion = motion_of(subject)
    names = [name for name in subject.rows if subject.sizes(name)]
    with tempfile.TemporaryDirectory() as base:
        place = Path(base)
        folder = place / subject.name
        shutil.copytree(subject.folder, folder)
        script = HEAD.format(folder=folder, name=subject.name)
        for name in names:
            script += _call(subject, name, place)
        if motion is not None:
            parts = (motion.times, motion.x[0], motion.u, motion.p)
            np.concatenate(parts).tofile(place / "motion.in")
            n, x, u = np.cumsum([len(part) for part in parts[:3]])
            script += MOTION.format(name=subject.name, n=n, x=x, u=u, rtol=motion.rtol)
        (place / "build.m").write_text(BUILD.format(folder=folder, name=subject.name), "utf-8")
        (place / "check.m").write_text(script, "utf-8")
        said = _said_by_octave(place, "build.m") or _said_by_octave(place, "check.m", LIMIT)
        outputs = {file.stem: np.fromfile(file) for file in place.glob("*.out")}
    if "help" not in outputs or said:
        yield CheckResult("built and run by Octave", 1.0, 0.0, False, said)
        return
    helps = outputs["help"].tolist() == [1.0]
    yield CheckResult("help text", float(not helps), 0.0, helps, "help of the class")
    errors = [_errors(subject, name, outputs.get(name, np.empty(0))) for name in names]
    singles, columns = zip(*errors) if errors else ((), ())
    yield result(subject, "values in Octave", list(singles), "every function of the class")
    yield result(subject, "many columns in Octave", list(columns), "the same, all states at once")
    if motion is not None:
        steps, *rows = outputs.get("motion", [np.inf])
        given = rows if len(rows) == motion.x.size else np.full(motion.x.size, np.nan)
        yield from motion.checks("Octave", np.array(given), float(steps))


def _call(subject: Subject, name: str, place: Path) -> str:
    """The part of the script for a function, whose arguments are written."""
    rows = [subject.row(name, k) for k, _ in enumerate(subject.sizes(name))]
    np.array([np.concatenate([[t], x, u, p]) for t, x, u, p in rows]).tofile(place / f"{name}.in")
    x, u = 1 + len(rows[0][1]), 1 + len(rows[0][1]) + len(rows[0][2])
    width = u + len(rows[0][3])
    return CALL.format(name=subject.name, function=name, width=width, x=x, u=u)


def _said_by_octave(place: Path, script: str, limit: float | None = None) -> str:
    """What it complains of; nothing where all is well."""
    command = ["octave-cli", "--norc", "--quiet", script]
    try:
        done = subprocess.run(
            command, check=False, cwd=place, capture_output=True, text=True, timeout=limit
        )
    except subprocess.TimeoutExpired:
        return f"{script} did not end within {limit:g} s"
    return (" ".join(done.stderr.split())[:400] or "no word") if done.returncode else ""


def _errors(subject: Subject, name: str, values: np.ndarray) -> tuple[float, float]:
    """One by one, and all at once."""
    count = len(subject.sizes(name))
    if not values.size or values.size % (2 * count):
        return np.inf, np.inf
    one, many = values.reshape(2, count, -1)
    return _error(subject, name, one), _error(subject, name, many)


def _error(subject: Subject, name: str, rows: np.ndarray) -> float:
    rest = iter(rows)
    return subject.error(name, lambda *_: next(rest))


MATLAB = TargetCheck("matlab", "Octave", check)
