"""Functions on request by name: the single ones, and those of a family for each named frame."""

from __future__ import annotations

from collections.abc import Collection

from derive.diagnostics import AssumptionError, HamelError, did_you_mean, listed, nearest
from derive.formulations.named_frames import about_frame
from derive.formulations.records import Equations, Family, Request
from derive.model.mechanism.named_frames import frames_of, is_shared, readings, shared_name


def request_of(equations: Equations, name: str) -> Request | None:
    """The function of that name that is made when it is asked for; None where there is none. Raises
    AssumptionError where the name may stand for two."""
    single = {request.name: request for request in equations.requests}
    if name in single:
        return single[name]
    offered = {family.name: family for family in equations.families}
    known = frames_of(equations.system.model) if offered else {}
    matches = [(family, frame) for family, frame in readings(name, known) if family in offered]
    if len(matches) > 1:
        meanings = " or ".join(f"{family} of {frame}" for family, frame in matches)
        raise AssumptionError(
            f"'{name}' may be {meanings}", "give one of the two a name of its own under `frames:`"
        )
    return _of_frame(name, offered[matches[0][0]], matches[0][1]) if matches else None


def _misspelt_frames(
    name: str, prefixes: Collection[str], frames: Collection[str]
) -> dict[str, str]:
    """Functions of the frame that is nearest to what stands behind each family's name, and that
    text."""
    behind = {family: name[len(family) + 1 :] for family in sorted(prefixes, key=len, reverse=True)}
    near = {family: nearest(frame, frames) for family, frame in behind.items()}
    return {f"{family}_{frame}": behind[family] for family, frame in near.items() if frame}


def _of_frames(equations: Equations, name: str, frames: Collection[str]) -> list[str]:
    """The functions of the frame whose name is at the end of this one, where the family in front
    may be misspelt."""
    ends = [frame for frame in frames if name.endswith(f"_{frame}")]
    return [f"{family.name}_{frame}" for frame in ends for family in equations.families]


def _of_frame(name: str, family: Family, frame: str) -> Request:
    return Request(name, about_frame(family.about, frame), lambda: family.make(frame))


# functions that models may lack, by what these lack
_OF_INPUTS = ("jacobian_u", "jacobian_u_values", "input_map", "inverse_dynamics_u")
_OF_PARAMETERS = ("jacobian_p", "jacobian_p_values")
_OF_OUTPUTS = ("outputs", "outputs_jacobian")
_OF_QUASI_VELOCITIES = (
    "partial_velocities", "mass_w", "bias_w", "gravity_w", "coriolis_w", "input_map",
    "inverse_dynamics_u", "regressor_w",
)  # fmt: skip
_OF_CONSTRAINTS = ("constraints", "project", "reactions", "constraint_rows")


def _reason(equations: Equations, name: str) -> str:
    """Why equations have no function of that name, where other models have it."""
    slots = {argument.name: argument.labels for argument in equations.arguments}
    if name in _OF_INPUTS and not slots["u"]:
        return "it has no inputs"
    if name in _OF_PARAMETERS and not slots["p"]:
        return "it has no parameters, or all of them are baked in"
    if name in _OF_OUTPUTS and not equations.has("outputs"):
        return "it has no outputs"
    if name in _OF_CONSTRAINTS and not equations.system.rows:
        return "it has no constraints"
    if name == "events" and not equations.has("events"):
        return "it has no events"
    if name in _OF_QUASI_VELOCITIES and equations.generalized_velocities:
        return f"formulation {equations.formulation} chooses no quasi-velocities w"
    return ""


def unknown_function(equations: Equations, name: str) -> HamelError:
    """What to say of a name that is none of a function: the frame, or the function, that was
    probably meant."""
    model = equations.system.model
    offered = [request for request in equations.requests if request.refusal is None]
    single = [x.name for x in (*equations.functions, *offered)]
    prefixes = [x.name for x in equations.families if name.startswith(f"{x.name}_")]
    frames = frames_of(model)
    if readings(name, frames):
        return HamelError(
            f"{model.name} has no function '{name}'",
            f"formulation {equations.formulation} chooses no quasi-velocities w",
        )
    if name in {family.name for family in equations.families}:
        return HamelError(
            f"'{name}' is a function of a frame, and none is named",
            f"give {name}_FRAME, with one of the frames {listed(frames)}",
        )
    if reason := _reason(equations, name):
        return HamelError(f"{model.name} has no function '{name}'", reason)
    asked = [name[len(prefix) + 1 :] for prefix in prefixes]
    if shared := [frame for frame in asked if is_shared(model, frame)]:
        return HamelError(*shared_name(model, shared[0]))
    misspelt = _misspelt_frames(name, prefixes, frames)
    best = nearest(name, (*misspelt, *_of_frames(equations, name, frames)))
    if best in misspelt:
        return HamelError(
            f"{model.name} has no frame '{misspelt[best]}'", f"did you mean '{best}'?"
        )
    hint = f"did you mean '{best}'?" if best else did_you_mean(name, single)
    if prefixes and not hint:
        frame = name[len(max(prefixes, key=len)) + 1 :]
        return HamelError(f"{model.name} has no frame '{frame}'", f"it has {listed(frames)}")
    families = [f"{family.name}_FRAME" for family in equations.families]
    hint = hint or f"it has {', '.join((*single, *families))}"
    return HamelError(f"{model.name} has no function '{name}'", hint)
