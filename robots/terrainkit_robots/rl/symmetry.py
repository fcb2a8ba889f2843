"""Left-right symmetry of observations and actions, for rsl-rl's symmetry extension.

The mirror plane is y = 0 of the base. It negates the y of a vector, and x and z of an axial vector
such as an angular velocity; joints and feet swap with their mirror pairs. So each map is a signed
permutation that is its own inverse. See Mittal et al., Symmetry Considerations for Learning Task
Symmetric Robot Policies, 2024.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from tensordict import TensorDict

from terrainkit.errors import ConfigError, PluginError, listing
from terrainkit_robots.rl.observations import SignedPermutation
from terrainkit_robots.rl.scene import Scene
from terrainkit_robots.spec.robot_arrays import Robot
from terrainkit_robots.transforms import FloatArray

if TYPE_CHECKING:
    from terrainkit_robots.rl.env import LeggedEnv

TOLERANCE = 1e-3
"""Allowed difference between left and right: default pose [rad], scan points [m], and action
scale, gains and effort, relative."""

_IMAGES = "mirror_images"
"""Key of the images of all samples among the observations in rsl-rl's storage."""


class MirrorMaps(NamedTuple):
    """The mirror map of each observation group, of the joints, and of the actions."""

    groups: dict[str, SignedPermutation]
    joints: SignedPermutation
    actions: SignedPermutation


def mirror_maps(env: "LeggedEnv") -> MirrorMaps:
    """Return the mirror maps of an environment.

    Raises:
        ConfigError: If left and right of the robot or its height scan differ.
    """
    robot, scene, scale = env.robot, env.scene, env.actions.scale
    names, pairs = robot.spec.joint_order, robot.spec.mirror_joints()
    joints = _map([names.index(pair.joint) for pair in pairs], [pair.sign for pair in pairs])
    _check_sides(robot, scene, scale, joints)
    controlled = np.flatnonzero(scale)
    images = np.searchsorted(controlled, joints.index[controlled])
    maps = {
        # A reflection of y changes the y of vectors, and the x and z of rotations (axial vectors).
        "vector": _map(range(3), [1, -1, 1]),
        "axial": _map(range(3), [-1, 1, -1]),
        "command": _map(range(3), [1, -1, -1]),
        "phase": _map(range(2), [-1, -1]),  # left and right are half a period apart
        "joints": joints,
        "actions": _map(images, joints.sign[controlled]),
        **_foot_maps(robot, scene),
    }
    group_maps = {}
    for name, group in env.obs_terms.items():
        index, sign = np.zeros(0, np.int64), np.zeros(0, np.float32)
        for term_name, term in group.items():
            width, start = term.function(env).shape[1], len(index)
            maps["scalar"] = _map(range(width), np.ones(width))
            if term.symmetry == "scan":
                maps["scan"] = _scan_map(env.scan_points)
            if term.symmetry == "history":  # repeats the terms before it
                repeated = index + np.arange(0, width, start)[:, None]
                maps["history"] = _map(repeated.ravel(), np.tile(sign, len(repeated)))
            given = term.symmetry
            part = given if isinstance(given, SignedPermutation) else maps.get(given)
            if part is None:
                got = f"observation {term_name}: got the symmetry {given!r}"
                raise PluginError(f"{got}; expected one of: {listing(maps)}")
            if len(part.index) != width:
                expected = f"expected {len(part.index)}, as in its symmetry"
                raise PluginError(f"observation {term_name}: got {width} numbers; {expected}")
            index, sign = np.append(index, part.index + start), np.append(sign, part.sign)
        group_maps[name] = SignedPermutation(index, sign)
    return MirrorMaps(group_maps, joints, maps["actions"])


def has_symmetry(env: "LeggedEnv") -> bool:
    """Return whether left and right of the robot and its height scan are mirror images.

    Raises:
        PluginError: If the symmetry of a term does not exist, or has another width.
    """
    try:
        return bool(env.mirror_maps)
    except PluginError:
        raise
    except (ConfigError, ValueError):
        return False


def augment(
    env: "LeggedEnv", obs: TensorDict | None, actions: torch.Tensor | None
) -> tuple[TensorDict | None, torch.Tensor | None]:
    """Return observations and actions followed by their mirror images.

    This is rsl-rl's `data_augmentation_func`; either argument may be None.

    Args:
        env: The environment, which has the mirror maps.
        obs: Observations of n samples by group, or None; with their images in `mirrored_update`.
        actions: Actions, shape (n, a), or None.

    Returns:
        Observations and actions of 2 n samples: the given samples, then their mirror images.
    """
    images = None if obs is None else obs.pop(_IMAGES, None)
    if images is None:
        images = _images(env.mirror_maps, obs, actions)
    if actions is not None:
        actions = torch.cat([actions, images["actions"]])
    if obs is not None:
        groups = {name: torch.cat([values, images[name]]) for name, values in obs.items()}
        obs = TensorDict(groups, [2 * obs.batch_size[0]], device=obs.device)
    return obs, actions


def mirrored_update(env: "LeggedEnv", alg: Any) -> Callable[[], dict[str, float]]:
    """Return the update of PPO with samples that are mirrored once, not in each mini-batch.

    Args:
        env: The environment, which has the mirror maps.
        alg: rsl-rl's PPO with symmetry.
    """
    update, storage = alg.update, alg.storage

    def update_with_images() -> dict[str, float]:
        images = _images(env.mirror_maps, storage.observations, storage.actions)
        storage.observations[_IMAGES] = images
        try:
            losses: dict[str, float] = update()
        finally:
            del storage.observations[_IMAGES]
        return losses

    return update_with_images


def _images(
    maps: MirrorMaps, obs: TensorDict | None, actions: torch.Tensor | None
) -> dict[str, torch.Tensor]:
    """Return the mirror images of observations by group and of `actions`, shape (..., width)."""
    values = {}
    if obs is not None:
        values = {name: (group, maps.groups[name]) for name, group in obs.items()}
    if actions is not None:
        values["actions"] = actions, maps.actions
    return {
        name: given[..., torch.from_numpy(image.index).to(given.device)]
        * torch.from_numpy(image.sign).to(given.device)
        for name, (given, image) in values.items()
    }


def _map(index: Sequence[int] | NDArray[np.int64], sign: ArrayLike) -> SignedPermutation:
    return SignedPermutation(np.array(index, np.int64), np.array(sign, np.float32))


def _check_sides(robot: Robot, scene: Scene, scale: FloatArray, joints: SignedPermutation) -> None:
    """Check that an action has the same effect on the left as on the right."""
    names, pose, model = robot.spec.joint_order, robot.default_pose, scene.model
    tables = {
        "action_scale": scale,
        "stiffness": -model.actuator_biasprm[:, 1],
        "damping": -model.actuator_biasprm[:, 2],
        "effort": model.actuator_forcerange[:, 1],
    }
    checks = [("default_pose", pose, joints(pose[None])[0], TOLERANCE)]
    checks += [(t, own, own[joints.index], TOLERANCE * np.abs(own)) for t, own in tables.items()]
    for table, own, mirrored, tolerance in checks:
        for k in np.flatnonzero(np.abs(own - mirrored) > tolerance):
            raise ConfigError(
                f"symmetry: {table} differs between left and right: {names[k]} has {own[k]:.6g}, "
                f"the mirror image of {names[joints.index[k]]} {mirrored[k]:.6g}"
            )


def mirror_feet(position: FloatArray) -> NDArray[np.int64]:
    """Return the foot on the other side of each foot.

    Args:
        position: Positions of the feet in the frame of the base [m], shape (f, 3).

    Returns:
        Index of the foot nearest to the mirror image of each foot, shape (f,).
    """
    return np.linalg.norm(position[:, None] - position * [1, -1, 1], axis=2).argmin(axis=1)


def _foot_maps(robot: Robot, scene: Scene) -> dict[str, SignedPermutation]:
    """Return the maps of a vector and of a number per foot: feet are paired by default position."""
    feet = robot.spec.feet
    index = mirror_feet(scene.foot_pos)
    for k in np.flatnonzero(index[index] != np.arange(len(feet))):
        got = f"the foot {feet[k]} is nearest to the mirror image of {feet[index[k]]}"
        raise ConfigError(f"symmetry: {got}, which is nearest to another; expected pairs of feet")
    vectors = _map((3 * index[:, None] + range(3)).ravel(), [1, -1, 1] * len(feet))
    return {"feet": vectors, "contacts": _map(index, np.ones(len(feet)))}


def _scan_map(points: FloatArray) -> SignedPermutation:
    """Return the map of the height scan: each point takes the height at the opposite side."""
    mirrored = points * (1, -1)
    distance = np.linalg.norm(mirrored[:, None] - points, axis=2)
    for k in np.flatnonzero(distance.min(axis=1) > TOLERANCE):
        got = "height scan: got a point at x = {:g} m, y = {:g} m".format(*points[k])
        expected = "as symmetry has the same points on both sides"
        raise ConfigError(f"{got}; expected another at y = {mirrored[k, 1]:g} m, {expected}")
    return _map(distance.argmin(axis=1), np.ones(len(points)))
