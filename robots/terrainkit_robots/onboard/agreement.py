"""Agreement: whether what was written is the robot that was read.

The source is followed by our own kinematics, the two files by MuJoCo's readers of URDF and MJCF.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit_robots.body.kinematics import body_poses, position_of
from terrainkit_robots.leg.pose import range_of
from terrainkit_robots.model import Matrix
from terrainkit_robots.quiet_mujoco import quiet_mujoco

if TYPE_CHECKING:
    from terrainkit_robots.facts import Facts

POSES = 100
"""Poses at which links are compared."""

_WIDEST = np.pi
"""A joint without limits is turned by up to this [rad]."""


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """How far a written file is from the source."""

    file: str
    """The file."""

    mass: float
    """Its mass over that of the source, less 1."""

    distance: float
    """Largest distance of a link's frame from where it is in the source [m]."""

    link: str
    """The link that is farthest away."""


def agreement(
    source: "Facts", written: "Facts", models: Mapping[str, Any]
) -> tuple[Agreement, ...]:
    """Return how far written files are from their source, over POSES seeded poses.

    Args:
        source: The robot as it was read.
        written: The robot as it is written, whose joints may have other names.
        models: What MuJoCo made of its files, by their names.
    """
    draws = _draws(written)
    places = _places(source, _renamed(source, written, draws))
    return tuple(_compared(source, places, draws, each) for each in models.items())


def _draws(facts: "Facts") -> dict[str, Matrix]:
    """Return positions of each joint within its limits, shape (POSES,); the first are zero."""
    rng = np.random.default_rng(0)
    drawn: dict[str, Matrix] = {}
    for joint in facts.joints:
        lower, upper = np.clip(range_of(joint), -_WIDEST, _WIDEST)
        drawn[joint.name] = rng.uniform(lower, upper, POSES)
    for joint in facts.joints:
        drawn[joint.name] = np.broadcast_to(position_of(joint, drawn), (POSES,))
    return drawn


def _renamed(source: "Facts", written: "Facts", draws: Mapping[str, Matrix]) -> dict[str, Matrix]:
    """Return positions by the names that the source has for the same joints."""
    before = {joint.child: joint.name for joint in source.joints}
    return {before[j.child]: draws[j.name] for j in written.joints if j.child in before}


def _places(facts: "Facts", positions: Mapping[str, Matrix]) -> dict[str, Matrix]:
    """Return where each link is in the frame of the base, shapes (POSES, 3) [m]."""
    poses = body_poses(facts.bodies, positions)
    found = {}
    for body, pose in zip(facts.bodies, poses, strict=True):
        for link, local in zip(body.links, body.poses, strict=True):
            found[link.name] = np.broadcast_to((pose @ local)[..., :3, 3], (POSES, 3))
    return found


def _compared(
    source: "Facts",
    places: Mapping[str, Matrix],
    draws: Mapping[str, Matrix],
    named: tuple[str, Any],
) -> Agreement:
    import mujoco

    file, model = named
    base, kind = source.bodies[0].top.name, mujoco.mjtObj.mjOBJ_BODY
    shared = [name for name in places if mujoco.mj_name2id(model, kind, name) >= 0]
    with quiet_mujoco():
        here = _followed(model, draws, base, shared)
    mass = float(model.body_mass.sum())
    apart = {
        name: float(np.linalg.norm(places[name] - here[name], axis=1).max()) for name in shared
    }
    worst = max(apart, key=apart.__getitem__, default="")
    return Agreement(
        file=file,
        mass=mass / source.total_mass - 1 if source.total_mass else 0.0,
        distance=apart.get(worst, 0.0),
        link=worst,
    )


def _followed(
    model: Any, draws: Mapping[str, Matrix], base: str, links: Sequence[str]
) -> dict[str, Matrix]:
    """Return where MuJoCo has the links in the frame of the base, shapes (POSES, 3) [m]."""
    import mujoco

    data = mujoco.MjData(model)
    # The URDF reader makes the base a part of the world, at its origin.
    root = max(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, base), 0)
    bodies = [model.body(name).id for name in links]
    address = {name: int(model.joint(name).qposadr[0]) for name in draws}
    found = np.zeros((POSES, len(links), 3))
    for k in range(POSES):
        for name, positions in draws.items():
            data.qpos[address[name]] = positions[k]
        mujoco.mj_kinematics(model, data)
        turn = data.xmat[root].reshape(3, 3)
        found[k] = (data.xpos[bodies] - data.xpos[root]) @ turn
    return {name: found[:, index] for index, name in enumerate(links)}
