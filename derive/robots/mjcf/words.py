"""Words of MJCF: those of MuJoCo's XML reference, with attributes that older versions had, in the
sections that are read; and two orientations on one element."""

from __future__ import annotations

from collections.abc import Mapping

from derive.robots.markup import Element
from derive.robots.robot import Reading
from derive.robots.words import Words, unread_words, words

TURNS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")
TURN = " ".join(TURNS)
SOLVER = "solref solimp"
CLASSED = "name class group user"
CONTACT = f"contype conaffinity condim priority friction solmix {SOLVER} margin gap"
LIMIT = "limited range margin solreflimit solimplimit solreffriction solimpfriction"
FORCES = (
    f"{LIMIT} stiffness damping frictionloss armature springyield actuatorfrclimited "
    "actuatorfrcrange"
)

# ---- what stands in bodies

INERTIAL = words(f"pos mass diaginertia fullinertia {TURN}")
JOINT = words(f"{CLASSED} type pos axis ref springdamper springref actuatorgravcomp {FORCES}")
GEOM = words(
    f"{CLASSED} type {CONTACT} size material rgba fromto pos {TURN} mass density shellinertia "
    "hfield mesh fitscale fluidshape fluidcoef adhesion castshadow surfacevel",
    closed="plugin",
)
SITE = words(f"{CLASSED} type size material mesh rgba fromto pos {TURN}")
CARRIED: Mapping[str, Words | None] = {
    "joint": JOINT,
    "freejoint": words("name group align"),
    "geom": GEOM,
    "site": SITE,
    "inertial": INERTIAL,
}
REST = "camera light plugin attach composite flexcomp"
BODY = words(
    f"name childclass pos {TURN} mocap gravcomp sleep simple fuse user", CARRIED, "inertial", REST
)
FRAME = words(f"name childclass pos {TURN}", CARRIED, "", REST)
REPLICATE = words("count offset euler sep childclass", CARRIED, "", REST)
for _inside in (BODY, FRAME, REPLICATE):
    _inside.elements |= {"body": BODY, "frame": FRAME, "replicate": REPLICATE}

# ---- what ties and drives them

MESH = words(
    "name class content_type file vertex normal face texcoord scale refpos refquat inertia "
    "smoothnormal maxhullvert material builtin params",
    closed="plugin",
)
TENDON = f"{CLASSED} {FORCES} springlength material rgba width"
EQUALITY = f"name class active {SOLVER}"
_DRIVER = (
    f"{CLASSED} ctrllimited forcelimited ctrlrange forcerange lengthrange gear cranklength "
    "joint jointinparent tendon cranksite slidersite site refsite body armature damping delay "
    "interp nsample actlimited actrange actearly actdim"
)
DRIVERS: Mapping[str, Words | None] = {
    "general": words(
        f"{_DRIVER} dyntype dynprm gaintype gainprm biastype biasprm inheritrange input ffrange "
        "velrange"
    ),
    "motor": words(_DRIVER),
    "position": words(f"{_DRIVER} kp kv dampratio timeconst inheritrange"),
    "velocity": words(f"{_DRIVER} kv"),
    "intvelocity": words(f"{_DRIVER} kp kv dampratio inheritrange"),
    "damper": words(f"{_DRIVER} kv"),
    "cylinder": words(f"{_DRIVER} timeconst area diameter bias"),
    **dict.fromkeys(("muscle", "adhesion", "orientation", "pid", "dcmotor", "plugin")),
}
DEFAULT = words(
    "class",
    {
        "mesh": MESH,
        "joint": JOINT,
        "geom": GEOM,
        "site": SITE,
        "tendon": words(TENDON),
        "equality": words(EQUALITY),
        **DRIVERS,
    },
    closed="material texture camera light pair",
)
DEFAULT.elements["default"] = DEFAULT

# ---- the sections

COMPILER = words(
    "angle eulerseq autolimits coordinate inertiafromgeom inertiagrouprange balanceinertia "
    "boundmass boundinertia settotalmass meshdir texturedir assetdir strippath alignfree "
    "fusestatic discardvisual conflict convexhull exactmeshinertia fitaabb passthrough "
    "savecanonical savecompiled saveinertial usethread",
    closed="lengthrange",
)
OPTION = words(
    "timestep gravity wind magnetic density viscosity integrator cone jacobian solver impratio "
    "iterations tolerance ls_iterations ls_tolerance noslip_iterations noslip_tolerance "
    "ccd_iterations ccd_tolerance mpr_iterations mpr_tolerance sdf_iterations sdf_initpoints "
    "sleep_tolerance o_margin o_solref o_solimp o_friction actuatorgroupdisable apirate collision",
    {
        "flag": words(
            "constraint equality frictionloss limit contact passive spring damper gravity "
            "clampctrl warmstart filterparent actuation refsafe sensor midphase nativeccd "
            "eulerdamp autoreset override energy fwdinv invdiscrete multiccd island sensornoise "
            "sleep diagexact ipc speculative"
        )
    },
)
SECTIONS = {
    "compiler": COMPILER,
    "option": OPTION,
    "default": DEFAULT,
    "worldbody": BODY,
    "asset": words("", {"mesh": MESH}, closed="hfield skin texture material model"),
    "tendon": words(
        "",
        {
            "spatial": words(
                TENDON,
                {
                    "site": words("site"),
                    "geom": words("geom sidesite"),
                    "pulley": words("divisor"),
                },
            ),
            "fixed": words(TENDON, {"joint": words("joint coef")}),
        },
    ),
    "equality": words(
        "",
        {
            "connect": words(f"{EQUALITY} body1 body2 anchor site1 site2"),
            "weld": words(f"{EQUALITY} body1 body2 anchor relpose torquescale site1 site2"),
            "joint": words(f"{EQUALITY} joint1 joint2 polycoef"),
            "tendon": words(f"{EQUALITY} tendon1 tendon2 polycoef"),
        },
        closed="flex flexvert flexstrain distance",
    ),
    "actuator": words("", DRIVERS),
}


def unread_in(reading: Reading, root: Element) -> list[str]:
    """What is unknown in the sections that are read, once for each kind; slips are reported, and so
    are elements with two orientations."""
    found: dict[str, None] = {}
    for section in root.children:
        if section.tag in SECTIONS:
            found |= dict.fromkeys(unread_words(reading, section, SECTIONS[section.tag]))
            for element in section.walk():
                _one_turn(reading, element)
    return list(found)


def _one_turn(reading: Reading, element: Element) -> None:
    given = [name for name in element.attributes if name in TURNS]
    if len(given) > 1:
        problem = f"a <{element.tag}> with several orientations: {', '.join(given)}"
        reading.report(element, problem, "one of them", attribute=given[1])
