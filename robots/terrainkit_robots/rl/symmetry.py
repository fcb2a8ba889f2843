"""The symmetry: what a mirror that swaps left and right makes of observations and actions.

The mirror is the plane y = 0 of the base. It turns the y of a vector around; of what turns, such as
an angular velocity, it turns x and z around. Joints and feet change places with their twins. So an
image is a signed permutation, and the image of an image is what it was.

Mittal et al., Symmetry Considerations for Learning Task Symmetric Robot Policies, 2024, tell how a
policy learns from images, which rsl-rl does.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from tensordict import TensorDict

from terrainkit.errors import ConfigError, listing
from terrainkit_robots.rl.robot import Robot

if TYPE_CHECKING:
    from terrainkit_robots.rl.env import LeggedEnv

FloatArray = NDArray[np.float32]

_SAME = 1e-3
"""Twins may differ so much: in default pose [rad], in points of the scan [m], and in action scale,
gains and effort, as a part of them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Image:
    """What becomes of w numbers: number k of the image is `sign[k]` times number `index[k]`."""

    index: NDArray[np.int64]
    """Where each number comes from, shape (w,)."""

    sign: FloatArray
    """+1 or -1 for each, shape (w,)."""

    def of(self, values: FloatArray) -> FloatArray:
        """Return the image of values, shape (n, w)."""
        return values[:, self.index] * self.sign


@dataclass(frozen=True, kw_only=True, eq=False)
class Mirror:
    """What a mirror makes of what a policy sees and does."""

    groups: dict[str, Image]
    """Of each group of observations."""

    actions: Image
    """Of actions."""


def mirror_of(env: "LeggedEnv") -> Mirror:
    """Return the mirror of an environment.

    Raises:
        ConfigError: if left and right of the robot or of its height scan differ.
    """
    joints = _joints(env.robot)
    _same_control(env, joints)
    terrain = env.cfg.terrain
    blocks = {
        "vector": _image([0, 1, 2], [1, -1, 1]),
        "turn": _image([0, 1, 2], [-1, 1, -1]),
        "command": _image([0, 1, 2], [1, -1, -1]),
        "joints": joints,
    }
    groups = {}
    for name, group in env.groups.items():
        images = []
        for each in group:
            width = each.read(env.state).shape[1]
            if each.image == "number":
                image = _image(range(width), np.ones(width))
            elif each.image == "scan":
                image = _scan(terrain.measured_points_x, terrain.measured_points_y)
            elif each.image == "feet":
                image = _feet(env)
            else:
                image = blocks[each.image]
            if len(image.index) != width:
                raise ConfigError(
                    f"the observation {each.name} has {width} numbers; "
                    f"its image, {each.image!r}, has {len(image.index)}"
                )
            images.append(image)
        groups[name] = _joined(images)
    return Mirror(groups=groups, actions=joints)


def mirrored(
    env: "LeggedEnv", obs: TensorDict | None, actions: torch.Tensor | None
) -> tuple[TensorDict | None, torch.Tensor | None]:
    """Return observations and actions followed by their images: twice as many of both.

    It is what rsl-rl's `data_augmentation_func` has to be.

    Args:
        env: The environment that they come from.
        obs: Observations of n robots, or None.
        actions: Actions of n robots, shape (n, j), or None.
    """
    known = _known.get(env)
    if known is None:
        mirror = mirror_of(env)
        known = {name: _tensors(image, env.device) for name, image in mirror.groups.items()}
        known[_ACTIONS] = _tensors(mirror.actions, env.device)
        _known[env] = known
    if obs is not None:
        for name in obs.keys() - known.keys():
            there = listing(env.groups)
            raise ConfigError(f"observations have the group {name!r}; there are: {there}")
        obs = TensorDict(
            {name: _followed(values, *known[name]) for name, values in obs.items()},
            batch_size=[2 * obs.batch_size[0]],
            device=obs.device,
        )
    if actions is not None:
        actions = _followed(actions, *known[_ACTIONS])
    return obs, actions


_ACTIONS = "its actions"
"""Where the image of actions is kept among those of groups."""

_known: "WeakKeyDictionary[LeggedEnv, dict[str, tuple[torch.Tensor, torch.Tensor]]]" = (
    WeakKeyDictionary()
)
"""Images of groups and actions of each environment: index and sign. They are needed with every
mini-batch."""


def _followed(values: torch.Tensor, index: torch.Tensor, sign: torch.Tensor) -> torch.Tensor:
    """Return values followed by their images, shape (2 n, w)."""
    return torch.cat([values, values.index_select(1, index) * sign])


def _tensors(image: Image, device: str) -> tuple[torch.Tensor, torch.Tensor]:
    return torch.from_numpy(image.index).to(device), torch.from_numpy(image.sign).to(device)


def _image(index: Sequence[int] | NDArray[np.int64], sign: ArrayLike) -> Image:
    return Image(index=np.array(index, np.int64), sign=np.array(sign, np.float32))


def _joined(images: Sequence[Image]) -> Image:
    """Return the image of several blocks, one after the other."""
    starts = np.cumsum([0, *(len(image.index) for image in images)])
    index = [image.index + start for image, start in zip(images, starts[:-1], strict=True)]
    return _image(np.concatenate(index), np.concatenate([image.sign for image in images]))


def _joints(robot: Robot) -> Image:
    """Return the image of one number for each joint."""
    spec = robot.spec
    alone = [name for name in spec.joint_order if name not in spec.mirror]
    if alone:
        raise ConfigError(
            f"symmetry wants a twin for each joint; mirror of {spec.name} has none "
            f"for: {listing(alone)}"
        )
    place = {name: k for k, name in enumerate(spec.joint_order)}
    twins = [spec.mirror[name] for name in spec.joint_order]
    for name, twin in zip(spec.joint_order, twins, strict=True):
        back = spec.mirror.get(twin.joint)
        if twin.joint not in place or back is None or (back.joint, back.sign) != (name, twin.sign):
            raise ConfigError(
                f"mirror of {spec.name}: {name} has the twin {twin.joint!r}, which is not a "
                f"joint with the twin {name} and the sign {twin.sign}"
            )
    return _image([place[twin.joint] for twin in twins], [twin.sign for twin in twins])


def _same_control(env: "LeggedEnv", joints: Image) -> None:
    """Refuse a robot whose actions mean something else to the left than to the right."""
    names, pose, model = env.robot.spec.joint_order, env.robot.default_pose, env.scene.model
    tables = [("default_pose", pose, pose[joints.index] * joints.sign, np.full(len(pose), _SAME))]
    for table, values in (
        ("action_scale", env.control.scale),
        ("stiffness", -model.actuator_biasprm[:, 1]),
        ("damping", -model.actuator_biasprm[:, 2]),
        ("effort", model.actuator_forcerange[:, 1]),
    ):
        tables.append((table, values, values[joints.index], _SAME * np.abs(values)))
    for table, own, of_twin, most in tables:
        off = np.flatnonzero(np.abs(own - of_twin) > most)
        if len(off):
            k = int(off[0])
            raise ConfigError(
                f"symmetry wants the same {table} to the left and to the right; "
                f"{names[k]} has {own[k]:.6g}, the image of its twin "
                f"{names[joints.index[k]]} {of_twin[k]:.6g}"
            )


def _feet(env: "LeggedEnv") -> Image:
    """Return the image of one vector for each foot."""
    twins = 3 * np.array(_twins_of_feet(env))
    index = (twins[:, None] + np.arange(3)).ravel()
    return _image(index, np.tile([1, -1, 1], len(twins)))


def _twins_of_feet(env: "LeggedEnv") -> list[int]:
    """Return the twin of each foot: the one that the twins of its joints carry."""
    spec = env.robot.spec
    carried = [_carrying(env, foot) for foot in spec.feet]
    twins = []
    for foot, joints in zip(spec.feet, carried, strict=True):
        image = {spec.mirror[name].joint for name in joints}
        found = [k for k, other in enumerate(carried) if other == image]
        if len(found) != 1:
            raise ConfigError(
                f"the foot {foot} of {spec.name} has {len(found)} images in a mirror that swaps "
                f"left and right; wanted 1 of: {listing(spec.feet)}"
            )
        twins.append(found[0])
    return twins


def _carrying(env: "LeggedEnv", foot: str) -> set[str]:
    """Return the actuated joints between the base and a foot."""
    model, actuated = env.scene.model, set(env.robot.spec.joint_order)
    found, body = set(), model.body(foot).id
    while body not in (0, env.scene.base):
        start = model.body_jntadr[body]
        here = range(start, start + model.body_jntnum[body])
        found |= {model.joint(k).name for k in here} & actuated
        body = model.body_parentid[body]
    return found


def _scan(x: Sequence[float], y: Sequence[float]) -> Image:
    """Return the image of the height scan, in which y runs fastest."""
    across = np.array(y)
    off = np.abs(across[:, None] + across)
    twins = off.argmin(axis=1)
    odd = np.flatnonzero(off.min(axis=1) > _SAME)
    if len(odd):
        raise ConfigError(
            f"symmetry wants terrain.measured_points_y the same to both sides; "
            f"it has {across[odd[0]]:g} without {-across[odd[0]]:g}"
        )
    index = np.arange(len(x))[:, None] * len(across) + twins
    return _image(index.ravel(), np.ones(index.size))
