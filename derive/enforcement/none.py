"""Nothing: positions drift with the integrator's error, in t for quasi-velocities and in t² where
velocities drift too."""

from derive.enforcement.records import Enforcement

NONE = Enforcement(
    name="none",
    about="nothing: the constraints drift with the integrator's error",
    source="",
    level="none",
    refusal=lambda found, options: "",
)
