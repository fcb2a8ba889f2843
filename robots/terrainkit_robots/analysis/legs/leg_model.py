"""The facts that the standing pose and the stance are computed from."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.legs.closed_loops import BodyLoop
from terrainkit_robots.analysis.legs.legs import Leg
from terrainkit_robots.analysis.symmetry.mirror import Mirror
from terrainkit_robots.description.model import Joint
from terrainkit_robots.mesh.mesh_cache import Meshes


@dataclass(frozen=True, kw_only=True, eq=False)
class LegModel:
    """Bodies, joints and legs of a robot."""

    bodies: Sequence[Body]
    """The bodies, parents first."""

    joints: Sequence[Joint]
    """Joints with one degree of freedom, parents first."""

    actuated: Collection[str]
    """Names of the joints with an actuator."""

    legs: Sequence[Leg]

    loops: Sequence[BodyLoop]

    mirror: Mirror

    keyframe: Mapping[str, float]
    """Joint positions [rad] or [m] of the first keyframe, by name. Empty without one."""

    meshes: Meshes
