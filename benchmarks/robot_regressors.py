"""Regressors of a robot: Y π + rest beside our own inverse dynamics, and the inertial part of Y π
beside Pinocchio's inverse dynamics.

Angles within 1e-11 of whole degrees are read as these, and axes within 1e-9 of x, y and z likewise;
Pinocchio takes the digits of the file. That alone makes 4e-11 of the forces of a UR5. So Pinocchio
gets a file here in which the numbers are what hamel reads.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import casadi as ca
import numpy as np

from derive.formulations.records import Equations, Function
from derive.mechanics.regression.regressor import INERTIAL, parameters
from derive.robots.rotations import unit, whole_degrees

Note = Callable[[str, np.ndarray, np.ndarray], None]
# of the largest force: both sides are sums of some hundreds of products, each rounded to 1e-16 of
# terms that are up to a hundred times as large as their sum
TOLERANCE = 1e-12
NAMES = ("Y π", "Y π, Pinocchio")


@dataclass(frozen=True)
class Regressors:
    """Our functions over (t, x, u, p), which columns are inertial, and Pinocchio's model of the
    numbers that we read."""

    Y: ca.Function
    rest: ca.Function
    forces: ca.Function
    pi: np.ndarray
    inertial: np.ndarray
    model: Any

    def check(self, peer: Any, s: Any, rng: np.random.Generator, note: Note) -> None:
        """At one state, for accelerations that the mimicking joints share in."""
        pin_rates = peer.G @ rng.normal(size=peer.G.shape[1])
        rates = np.zeros(len(pin_rates))
        rates[peer.columns] = pin_rates
        motion = np.concatenate([s.q, s.v, rates])
        Y, rest, forces = (
            np.asarray(f(0.0, motion, np.zeros(f.size_in(2)), []))
            for f in (self.Y, self.rest, self.forces)
        )
        note("Y π", Y @ self.pi + rest.ravel(), forces.ravel())
        own = (Y[:, self.inertial] @ self.pi[self.inertial])[peer.columns]
        data = self.model.createData()
        theirs = peer.pin.rnea(self.model, data, s.pin_q, s.pin_v, pin_rates)
        note("Y π, Pinocchio", own, np.asarray(theirs))


def regressors(derived: Equations, peer: Any, file: Path, floating: bool) -> Regressors:
    pi = np.asarray(_requested(derived, "standard_parameters")(0.0, [], [], [])).ravel()
    kinds = [parameter.kind in INERTIAL for parameter in parameters(derived.system)]
    root = [peer.pin.JointModelFreeFlyer()] if floating else []
    return Regressors(
        _requested(derived, "regressor"),
        _requested(derived, "regressor_rest"),
        _of(derived, derived.function("inverse_dynamics")),
        pi,
        np.array(kinds),
        peer.pin.buildModelFromXML(as_read(file), *root),
    )


def as_read(file: Path) -> str:
    """The file with the angles and axes that hamel takes."""
    tree = ElementTree.parse(file).getroot()
    for element in tree.iter():
        if element.tag == "origin" and "rpy" in element.attrib:
            element.set("rpy", " ".join(map(_angle, element.get("rpy", "").split())))
        if element.tag == "axis" and "xyz" in element.attrib:
            axis = unit([float(x) for x in element.get("xyz", "").split()])
            element.set("xyz", " ".join(map(repr, axis or ())))
    return ElementTree.tostring(tree, "unicode")


def _angle(word: str) -> str:
    degrees = whole_degrees(float(word))
    return word if degrees is None else repr(math.radians(degrees))


def _requested(derived: Equations, name: str) -> ca.Function:
    return _of(derived, derived.request(name).function)


def _of(derived: Equations, chosen: Function) -> ca.Function:
    slots = [
        chosen.x if slot.name == "x" and chosen.x is not None else slot
        for slot in derived.arguments
    ]
    return ca.Function("f", [slot.symbols for slot in slots], [ca.densify(chosen.result.value)])
