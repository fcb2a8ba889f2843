"""Units: what a joint is measured in, which turns or slides."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from terrainkit_robots.simulation.sim_model import Plant


@dataclass(frozen=True, kw_only=True)
class Units:
    """What the numbers of a joint are in."""

    place: str
    speed: str
    push: str
    """Of torque or force."""

    inertia: str


TURNING = Units(place="rad", speed="rad/s", push="N m", inertia="kg m2")
SLIDING = Units(place="m", speed="m/s", push="N", inertia="kg")


def units_of(scene: "Plant", name: str) -> Units:
    """Return the units of a joint; what is none, such as the base, turns."""
    import mujoco

    slides = int(mujoco.mjtJoint.mjJNT_SLIDE)
    sliding = name in scene.joints and int(scene.model.joint(name).type[0]) == slides
    return SLIDING if sliding else TURNING
