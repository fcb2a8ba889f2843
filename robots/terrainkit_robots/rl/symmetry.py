"""Left-right symmetry of observations and actions, for rsl-rl's symmetry extension.

The mirror plane is y = 0 of the base. It negates the y of a vector, and x and z of an axial vector
such as an angular velocity; joints and feet swap with their mirror pairs. So each map is a signed
permutation that is its own inverse. See Mittal et al., Symmetry Considerations for Learning Task
Symmetric Robot Policies, 2024.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from tensordict import TensorDict

from terrainkit.errors import ConfigError, listing
from terrainkit_robots.rl.scene import Robot

if TYPE_CHECKING:
    from terrainkit_robots.rl.env import LeggedEnv

FloatArray = NDArray[np.float32]

TOLERANCE = 1e-3
"""Allowed difference between left and right: default pose [rad], scan points [m], and action
scale, gains and effort, relative."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SignedPermutation:
    """Maps w numbers: number k of the result is `sign[k]` times number `index[k]`."""

    index: NDArray[np.int64]
    """Source of each number, shape (w,)."""
    sign: FloatArray
    """+1 or -1, shape (w,)."""

    def __call__(self, values: FloatArray) -> FloatArray:
        """Return the mirrored values, shape (n, w)."""
        return values[:, self.index] * self.sign


class MirrorMaps(NamedTuple):
    """The mirror map of each observation group, and that of the actions."""

    groups: dict[str, SignedPermutation]
    actions: SignedPermutation


def mirror_maps(env: "LeggedEnv") -> MirrorMaps:
    """Return the mirror maps of an environment.

    Raises:
        ConfigError: If left and right of the robot or its height scan differ.
    """
    joints = _joint_map(env.robot)
    _check_control(env, joints)
    cfg = env.cfg.terrain
    signs = {"vector": [1, -1, 1], "axial": [-1, 1, -1], "command": [1, -1, -1]}
    groups = {}
    for name, group in env.obs_groups.items():
        index, sign, start = [], [], 0
        for term in group:
            width = term.function(env.state).shape[1]
            if term.symmetry == "scalar":
                part = _map(range(width), np.ones(width))
            elif term.symmetry == "scan":
                part = _scan_map(cfg.measured_points_x, cfg.measured_points_y)
            elif term.symmetry == "feet":
                part = _foot_map(env)
            else:
                is_joints = term.symmetry == "joints"
                part = joints if is_joints else _map(range(3), signs[term.symmetry])
            if len(part.index) != width:
                raise ConfigError(
                    f"observation {term.name}: got {width} numbers; the symmetry "
                    f"{term.symmetry!r} expects {len(part.index)}"
                )
            index.append(part.index + start)
            sign.append(part.sign)
            start += width
        groups[name] = _map(np.concatenate(index), np.concatenate(sign))
    return MirrorMaps(groups, joints)


Tensors = tuple[torch.Tensor, torch.Tensor]
_cache: "WeakKeyDictionary[LeggedEnv, tuple[dict[str, Tensors], Tensors]]" = WeakKeyDictionary()


def augment(
    env: "LeggedEnv", obs: TensorDict | None, actions: torch.Tensor | None
) -> tuple[TensorDict | None, torch.Tensor | None]:
    """Return observations and actions followed by their mirror images.

    This is rsl-rl's `data_augmentation_func`.

    Args:
        env: The environment they come from.
        obs: Observations of n robots, or None.
        actions: Actions, shape (n, j), or None.
    """

    def tensors(permutation: SignedPermutation) -> Tensors:
        index, sign = torch.from_numpy(permutation.index), torch.from_numpy(permutation.sign)
        return index.to(env.device), sign.to(env.device)

    def doubled(values: torch.Tensor, index: torch.Tensor, sign: torch.Tensor) -> torch.Tensor:
        return torch.cat([values, values.index_select(1, index) * sign])

    if env not in _cache:
        groups, joints = mirror_maps(env)
        _cache[env] = {name: tensors(each) for name, each in groups.items()}, tensors(joints)
    obs_maps, action_map = _cache[env]
    if obs is not None:
        for name in obs.keys() - obs_maps.keys():
            expected = listing(env.obs_groups)
            raise ConfigError(f"observation group: got {name!r}; expected one of: {expected}")
        obs = TensorDict(
            {name: doubled(values, *obs_maps[name]) for name, values in obs.items()},
            batch_size=[2 * obs.batch_size[0]],
            device=obs.device,
        )
    return obs, None if actions is None else doubled(actions, *action_map)


def _map(index: Sequence[int] | NDArray[np.int64], sign: ArrayLike) -> SignedPermutation:
    return SignedPermutation(index=np.array(index, np.int64), sign=np.array(sign, np.float32))


def _joint_map(robot: Robot) -> SignedPermutation:
    """Return the map of one number per joint."""
    spec, mirror = robot.spec, robot.spec.mirror
    missing = [name for name in spec.joint_order if name not in mirror]
    if missing:
        raise ConfigError(
            f"mirror of {spec.name}: symmetry needs a pair for each joint; it has none for: "
            f"{listing(missing)}"
        )
    position = {name: k for k, name in enumerate(spec.joint_order)}
    pairs = [mirror[name] for name in spec.joint_order]
    for name, pair in zip(spec.joint_order, pairs, strict=True):
        back = mirror.get(pair.joint)
        if (
            pair.joint not in position
            or back is None
            or (back.joint, back.sign)
            != (
                name,
                pair.sign,
            )
        ):
            raise ConfigError(
                f"mirror of {spec.name}: {name} is paired with {pair.joint!r}, which is not a "
                f"joint that is paired with {name} with the sign {pair.sign}"
            )
    return _map([position[pair.joint] for pair in pairs], [pair.sign for pair in pairs])


def _check_control(env: "LeggedEnv", joints: SignedPermutation) -> None:
    """Check that an action has the same effect on the left as on the right."""
    names, pose, model = env.robot.spec.joint_order, env.robot.default_pose, env.scene.model
    tables = {
        "action_scale": env.action_scale,
        "stiffness": -model.actuator_biasprm[:, 1],
        "damping": -model.actuator_biasprm[:, 2],
        "effort": model.actuator_forcerange[:, 1],
    }
    checks = [
        ("default_pose", pose, pose[joints.index] * joints.sign, np.full(len(pose), TOLERANCE))
    ]
    checks += [(t, own, own[joints.index], TOLERANCE * np.abs(own)) for t, own in tables.items()]
    for table, own, mirrored, tolerance in checks:
        different = np.flatnonzero(np.abs(own - mirrored) > tolerance)
        if len(different):
            k = int(different[0])
            raise ConfigError(
                f"symmetry: {table} differs between left and right: {names[k]} has {own[k]:.6g}, "
                f"the mirror image of {names[joints.index[k]]} {mirrored[k]:.6g}"
            )


def _foot_map(env: "LeggedEnv") -> SignedPermutation:
    """Return the map of one vector per foot: feet are paired as the joints above them are."""
    spec, model = env.robot.spec, env.scene.model
    chains = []
    for foot in spec.feet:
        chain, body = set(), model.body(foot).id
        while body not in (0, env.scene.base):
            start, count = model.body_jntadr[body], model.body_jntnum[body]
            chain |= {model.joint(k).name for k in range(start, start + count)}
            body = model.body_parentid[body]
        chains.append(chain & set(spec.joint_order))
    pairs = []
    for foot, chain in zip(spec.feet, chains, strict=True):
        image = {spec.mirror[name].joint for name in chain}
        found = [k for k, other in enumerate(chains) if other == image]
        if len(found) != 1:
            raise ConfigError(
                f"symmetry: the foot {foot} of {spec.name} has {len(found)} mirror images; "
                f"expected 1 of: {listing(spec.feet)}"
            )
        pairs.append(found[0])
    index = (3 * np.array(pairs)[:, None] + np.arange(3)).ravel()
    return _map(index, np.tile([1, -1, 1], len(pairs)))


def _scan_map(x: Sequence[float], y: Sequence[float]) -> SignedPermutation:
    """Return the map of the height scan, whose points are ordered by x, then y."""
    lateral = np.array(y)
    error = np.abs(lateral[:, None] + lateral)
    unpaired = np.flatnonzero(error.min(axis=1) > TOLERANCE)
    if len(unpaired):
        raise ConfigError(
            f"terrain.measured_points_y: got {lateral[unpaired[0]]:g} without "
            f"{-lateral[unpaired[0]]:g}; symmetry expects the same points on both sides"
        )
    index = np.arange(len(x))[:, None] * len(lateral) + error.argmin(axis=1)
    return _map(index.ravel(), np.ones(index.size))
