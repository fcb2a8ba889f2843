"""Proof: that what was written is the robot that was read, and that it stands.

Two legs fall unless they are balanced, so that of a biped it is asked whether it stands with its
joints held.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from terrainkit.errors import ExportError
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.legs.stance import stands_alone
from terrainkit_robots.export.base_link import with_world_base
from terrainkit_robots.export.canonical import has_unknown_inertia, to_canonical
from terrainkit_robots.onboarding.equivalence import Agreement, agreement, expected
from terrainkit_robots.onboarding.robot_files import MJCF, SCENE, URDF
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.simulation.assessment import judge

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts
    from terrainkit_robots.onboarding.robot_files import Onboarded
    from terrainkit_robots.simulation.pd_gains import Gain
    from terrainkit_robots.simulation.standing import Standing
    from terrainkit_robots.spec.robot_spec import RobotSpec

_SECONDS = 5.0
"""How long a robot has to stand [s]."""


@dataclass(frozen=True, kw_only=True)
class Proof:
    """What was seen of the files that were written."""

    agreements: tuple[Agreement, ...]
    """How far each is from the source."""

    standing: "Standing | None" = None
    """How the robot of scene.xml stood; None without legs, or with a base that cannot fall."""

    locked: bool = False
    """Whether its joints were held."""

    unknown: str = ""
    """Why a robot with legs could not be simulated."""

    @property
    def faults(self) -> tuple[str, ...]:
        """Return why it does not stand; nothing if it does, or has no legs."""
        if self.standing is None:
            return (f"it could not be simulated: {self.unknown}",) if self.unknown else ()
        return judge(self.standing).faults

    @property
    def stood(self) -> bool:
        """Whether it stood upright, on its feet alone; True without legs."""
        return not self.faults


def prove(source: "Facts", made: "Onboarded", folder: Path) -> Proof:
    """Return what is seen of the files in a folder.

    Raises:
        ExportError: if MuJoCo does not load them, or they are another robot than the source.
    """
    from terrainkit_robots.simulation.sim_model import plant_of
    from terrainkit_robots.simulation.standing import footholds, stand_still

    floating = bool(made.facts.model.floating)
    # MuJoCo compiles without the interpreter's lock. The scene includes the MJCF, which is compiled
    # only once so.
    with quiet_mujoco(), ThreadPoolExecutor(2) as beside:
        urdf, scene = (beside.submit(_loaded, folder / name) for name in (URDF, SCENE))
        wanted = expected(_with_masses(source, floating), made.facts)
    agreements = agreement(wanted, {URDF: urdf.result(), MJCF: scene.result()})
    for each in agreements:
        if each.faults:
            raise ExportError(f"{each.file} would be another robot: {'; '.join(each.faults)}")
    if not made.facts.legs or not floating:
        return Proof(agreements=agreements)
    locked = not stands_alone(made.facts)
    try:
        standing = stand_still(
            plant_of(scene.result(), base=made.facts.bodies[0].top.name),
            _gains(made.spec),
            positions=made.facts.positions,
            feet=footholds(made.facts),
            seconds=_SECONDS,
            joints_locked=locked,
        )
    except CannotCheckError as error:
        return Proof(agreements=agreements, unknown=str(error))
    return Proof(agreements=agreements, standing=standing, locked=locked)


def _with_masses(source: "Facts", floating: bool) -> "Facts":
    """Return the source with its base and all of its masses, which may come from meshes."""
    from terrainkit_robots.analysis.facts import Facts

    if not any(has_unknown_inertia(link.inertial) for link in source.links):
        return with_world_base(source, floating=floating)
    return Facts(to_canonical(source, floating=floating).model, source.meshes)


def _loaded(path: Path) -> Any:
    import mujoco

    try:
        return mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise ExportError(f"MuJoCo does not load the {path.name} made: {reason}") from None


def _gains(spec: "RobotSpec") -> "dict[str, Gain]":
    from terrainkit_robots.simulation.pd_gains import Gain

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
