"""Standing: the robot at its pose under position control, and what comes of it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.simulation.pd_gains import Gain
from terrainkit_robots.simulation.rollout import Trial
from terrainkit_robots.simulation.sim_model import Plant, positions_in
from terrainkit_robots.transforms import invert_poses

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

_LOOKS = 4
"""The robot is looked at every so many steps: 20 ms."""

_END = 0.1
"""What touches in the last tenth of a second still touches at the end [s]."""

_FOOT_SHARE = 0.3
"""Share of a leg's length around its tip that is still foot, where that is a part of the shank."""


@dataclass(frozen=True, kw_only=True)
class Foothold:
    """Where a body may touch the ground."""

    body: str
    """A body of the simulated robot."""

    tip: tuple[float, float, float]
    """Middle of where it touches in the standing pose, in the body's frame [m]."""

    reach: float
    """Distance from there within which it is the foot that touches [m]; infinite for a body that
    is nothing but a foot."""

    foot: str
    """The link that is the foot of this leg; one leg may have several footholds."""

    leg_length: float
    """Length of the leg [m]."""


@dataclass(frozen=True, kw_only=True)
class Standing:
    """How a robot stood."""

    tilt: float
    """Angle between its up at the start and at the end [rad]."""

    largest_tilt: float
    """Largest such angle on the way [rad]."""

    height: float
    """Height of the base's origin at the end [m]."""

    sink: float
    """How much less that is than at the start [m]."""

    drift: float
    """How far the base's origin moved over the ground [m]."""

    leg_length: float
    """Length of its shortest leg [m]; infinite without footholds."""

    touching: tuple[str, ...]
    """Bodies other than feet that touched the ground, in the order of the robot's bodies."""

    lifted: tuple[str, ...]
    """Feet that did not touch the ground at the end, in the order of the legs."""

    saturation: float
    """Largest torque over effort in the second half, in 0..1; 0 if no effort is limited."""

    saturated: str
    """The joint that had it; empty if no effort is limited."""

    joint_error: float
    """Largest distance of a joint from its target at the end [rad] or [m]."""

    blew_up: bool
    """Whether a position, speed or acceleration stopped being a number, or was huge."""

    seconds: float
    """How long it was simulated: less than asked for if it blew up [s]."""


def footholds(facts: "Facts") -> tuple[Foothold, ...]:
    """Return where a robot with legs may touch the ground.

    A link that is the foot may anywhere. A shank may with its tip, where the foot is a part of it,
    but not with its knee.
    """
    if facts.stance is None:
        return ()
    found = []
    poses = body_poses(facts.bodies, facts.positions)
    for leg, contact in zip(facts.legs, facts.stance.contacts, strict=True):
        body = facts.bodies[leg.limb.chain[-1]]
        whole = "knee" in leg.roles[:-1]  # past an ankle there is nothing but foot
        place = invert_poses(poses[body.index]) @ [*contact, 1.0]
        for link, local in zip(body.links, body.poses, strict=True):
            only = whole or (link.name == leg.foot and link is not body.top)
            x, y, z = (invert_poses(local) @ place)[:3].tolist()
            reach = math.inf if only else _FOOT_SHARE * leg.length
            found.append(
                Foothold(
                    body=link.name,
                    tip=(x, y, z),
                    reach=reach,
                    foot=leg.foot,
                    leg_length=leg.length,
                )
            )
    return tuple(found)


def stand_still(
    plant: Plant,
    gains: Mapping[str, Gain],
    *,
    positions: Mapping[str, float],
    feet: Sequence[Foothold] = (),
    seconds: float = 2.0,
    self_collision: bool = True,
    joints_locked: bool = False,
) -> Standing:
    """Let a robot stand, its motors holding its joints.

    Args:
        plant: The robot.
        gains: Gain of each actuated joint.
        positions: Position of each joint at the start, and the target of its motor [rad] or [m].
        feet: Where it may touch the ground; unless told, nowhere.
        seconds: How long to simulate [s].
        self_collision: Whether the robot can touch itself.
        joints_locked: Whether the joints cannot move at all.

    Raises:
        CannotCheckError: if it is bolted down, or simulating it would take too long.
    """
    if not plant.floating:
        raise CannotCheckError("it does not stand: its base is fixed to the world")
    with quiet_mujoco():
        trial = Trial(plant, {} if joints_locked else gains, self_collision=self_collision)
        if joints_locked:
            trial.lock()
        qpos = positions_in(plant, positions)
        trial.put(qpos, above=0.0)
        watch = _Watch(trial, positions, feet, seconds)
        for step in trial.steps(seconds):
            watch.look(step)
        return watch.result()


@dataclass(eq=False)
class _Watch:
    """What is seen of a robot while it stands."""

    trial: Trial
    positions: Mapping[str, float]
    feet: Sequence[Foothold]
    seconds: float
    largest_tilt: float = 0.0
    touched: set[int] = field(default_factory=set)
    standing_on: set[str] = field(default_factory=set)
    steps: int = 0

    def __post_init__(self) -> None:
        trial = self.trial
        plant, model = trial.plant, trial.model
        self.start = trial.data.qpos[:3].copy()
        self.up = _up(trial.data.qpos[3:7])
        targets = dict(zip(plant.joints, trial.data.qpos[7:], strict=True)) | dict(self.positions)
        trial.data.ctrl[:] = [targets[name] for name in plant.drives]
        self.targets = np.array([targets[name] for name in plant.joints])
        ranges = model.actuator_forcerange[:, 1]
        limited = (model.actuator_forcelimited != 0) & (ranges > 0)
        self.efforts = np.where(limited, ranges, np.inf)
        self.shares = np.zeros(model.nu)
        self.holds = {
            model.body(foot.body).id: foot for foot in self.feet if _has(model, foot.body)
        }

    def look(self, step: int) -> None:
        """See how it stands after a step."""
        self.steps = step + 1
        if step % _LOOKS:
            return
        data, time = self.trial.data, step * float(self.trial.model.opt.timestep)
        self.largest_tilt = max(self.largest_tilt, self._tilt())
        if 2 * time >= self.seconds:
            shares = np.abs(data.actuator_force) / self.efforts
            np.maximum(self.shares, shares, out=self.shares)
        self._touch(ending=time >= self.seconds - _END)

    def _tilt(self) -> float:
        return math.acos(np.clip(self.up @ _up(self.trial.data.qpos[3:7]), -1.0, 1.0))

    def _touch(self, *, ending: bool) -> None:
        """Note which bodies touch the floor with anything but a foot, and which feet in the end."""
        model, data = self.trial.model, self.trial.data
        pairs = model.geom_bodyid[data.contact.geom]
        for contact in np.flatnonzero((pairs == 0).any(axis=1)):
            body = int(pairs[contact].max())
            foot = self.holds.get(body)
            if foot is None or not self._within(foot, body, data.contact.pos[contact]):
                self.touched.add(body)
            elif ending:
                self.standing_on.add(foot.foot)

    def _within(self, foot: Foothold, body: int, place: Any) -> bool:
        """Return whether a place on a body is a part of its foot."""
        if math.isinf(foot.reach):
            return True
        data = self.trial.data
        tip = data.xpos[body] + data.xmat[body].reshape(3, 3) @ foot.tip
        return bool(np.linalg.norm(place - tip) <= foot.reach)

    def result(self) -> Standing:
        """Return what was seen."""
        trial, data = self.trial, self.trial.data
        error = np.abs(data.qpos[7:] - self.targets)
        moved = data.qpos[:3] - self.start
        most = int(np.argmax(self.shares)) if len(self.shares) else 0
        share = float(self.shares[most]) if len(self.shares) else 0.0
        feet = dict.fromkeys(hold.foot for hold in self.holds.values())
        return Standing(
            tilt=self._tilt(),
            largest_tilt=max(self.largest_tilt, self._tilt()),
            height=float(data.qpos[2]),
            sink=-float(moved[2]),
            drift=float(np.hypot(moved[0], moved[1])),
            leg_length=min((foot.leg_length for foot in self.feet), default=math.inf),
            touching=tuple(trial.model.body(body).name for body in sorted(self.touched)),
            lifted=tuple(foot for foot in feet if foot not in self.standing_on),
            saturation=share,
            saturated=trial.plant.drives[most] if share > 0 else "",
            joint_error=float(error.max(initial=0.0)),
            blew_up=trial.blew_up,
            seconds=self.steps * float(trial.model.opt.timestep),
        )


def _up(quaternion: Any) -> Any:
    """Return the world's z axis of a frame with this orientation, shape (3,)."""
    w, x, y, z = quaternion
    return np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])


def _has(model: Any, body: str) -> bool:
    import mujoco

    return int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body)) >= 0
