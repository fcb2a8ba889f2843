"""Proof: that what was written is the robot that was read, and that it stands.

Two legs fall unless they are balanced, so that of a biped it is asked whether it stands with its
joints held.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from terrainkit.errors import ExportError
from terrainkit_robots.onboard.agreement import Agreement, agreement
from terrainkit_robots.quiet_mujoco import quiet_mujoco

if TYPE_CHECKING:
    from terrainkit_robots.facts import Facts
    from terrainkit_robots.onboard.onboarding import Onboarded
    from terrainkit_robots.simulation.gains import Gain
    from terrainkit_robots.simulation.standing import Standing
    from terrainkit_robots.spec.robot_spec import RobotSpec

_SAME_PLACE = 1e-4
"""A written robot is the one that was read up to this distance of its links [m],"""

_SAME_MASS = 1e-3
"""and this share of its mass."""

_SECONDS = 5.0
"""How long a robot has to stand [s]."""

_STANDS_ALONE = 3
"""Robots with so many legs stand by the springs of their joints; those with fewer balance."""

_UPRIGHT = math.radians(3)
"""How far it may tilt [rad]."""


@dataclass(frozen=True, kw_only=True)
class Proof:
    """What was seen of the files that were written."""

    agreements: tuple[Agreement, ...]
    """How far each is from the source."""

    standing: "Standing | None" = None
    """How the robot of scene.xml stood; None without legs, or with a base that cannot fall."""

    locked: bool = False
    """Whether its joints were held."""

    @property
    def stood(self) -> bool:
        """Whether it stood upright, on its feet alone; True without legs."""
        seen = self.standing
        return seen is None or (seen.tilt < _UPRIGHT and not seen.touching and not seen.blew_up)


def prove(source: "Facts", made: "Onboarded", folder: Path) -> Proof:
    """Return what is seen of the files in a folder.

    Raises:
        ExportError: if MuJoCo does not load them, or they are another robot than the source.
    """
    from terrainkit_robots.simulation.plant import plant_of
    from terrainkit_robots.simulation.standing import footholds, stand_still

    # The scene includes the MJCF, which is compiled only once so.
    scene = _loaded(folder / "scene.xml")
    models = {made.spec.urdf: _loaded(folder / made.spec.urdf), made.spec.mjcf: scene}
    agreements = agreement(source, made.facts, models)
    for each in agreements:
        if each.distance > _SAME_PLACE or abs(each.mass) > _SAME_MASS:
            raise ExportError(
                f"{each.file} would be another robot: {each.link} is {1000 * each.distance:.3g} mm "
                f"away from where the source has it, the mass is off by {each.mass:.2%}"
            )
    if not made.facts.legs or not made.facts.model.floating:
        return Proof(agreements=agreements)
    locked = len(made.facts.legs) < _STANDS_ALONE
    standing = stand_still(
        plant_of(scene, base=made.facts.bodies[0].top.name),
        _gains(made.spec),
        positions=made.facts.positions,
        feet=footholds(made.facts),
        seconds=_SECONDS,
        joints_locked=locked,
    )
    return Proof(agreements=agreements, standing=standing, locked=locked)


def _loaded(path: Path) -> Any:
    import mujoco

    try:
        with quiet_mujoco():
            return mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise ExportError(f"MuJoCo does not load the {path.name} made: {reason}") from None


def _gains(spec: "RobotSpec") -> "dict[str, Gain]":
    from terrainkit_robots.simulation.gains import Gain

    stiffness, damping, armature = map(spec.per_joint, ("stiffness", "damping", "armature"))
    return {
        joint: Gain(
            stiffness=stiffness[joint],
            damping=damping[joint],
            armature=armature[joint],
            reason="of the spec",
        )
        for joint in spec.joint_order
    }
