"""The scene: ground and robot as one MuJoCo model, with the sensors and motors of training.

What the robot's own file says of actuators and sensors does not count: its spec does. So an
onboarded robot, a bundled one and one written by hand are trained alike.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from terrainkit.errors import ConfigError, listing
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.rl.ground import Ground, touching
from terrainkit_robots.rl.robot import Robot
from terrainkit_robots.rl.task import Task

_CONTACT_FORCE = 2
"""What a contact sensor tells: its bit in `intprm[0]`, as MuJoCo's `mjtConDataField` counts."""

_MOTOR_DEFAULTS = ("gear", "ctrllimited", "ctrlrange", "actlimited", "actrange")
"""What a new motor would take over from the defaults in the robot's file."""

_ANY = 0x7FFFFFFF
"""Every bit of `conaffinity`: whatever the ground's `contype` is, it is touched."""

_NET_FORCE = 3
"""How it sums up several contacts, in `intprm[1]`: the net force, in the world's frame."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """A compiled scene, and where in it things are. f feet, p penalized and t termination bodies.

    qpos is the base's seven numbers, then the joints at `joint_qpos`; qvel alike. Sensor data is
    the blocks named below, in their order, three numbers for each body.
    """

    model: Any
    """The `mujoco.MjModel`."""

    joint_qpos: Any
    """Index in qpos of each joint, in the robot's order, shape (j,)."""

    joint_qvel: Any
    """Index in qvel of each joint, shape (j,)."""

    base: int
    """Body of the base."""

    geoms: Any
    """Geoms of the robot that touch, shape (g,)."""

    home: Any
    """qpos of the default pose with the base at height 0, shape (nq,)."""

    sole_depth: Any
    """How far below its sensor the lowest point of each foot is in the default pose [m], (f,)."""

    blocks: dict[str, slice]
    """Sensor data of: `foot_position`, `foot_velocity`, `foot_force`, `penalized_force`,
    `termination_force`. Forces are those of the robot on what it touches [N]."""


def build_scene(robot: Robot, ground: Ground, task: Task) -> Scene:
    """Return the scene of a task.

    Raises:
        ConfigError: if MuJoCo does not read the robot, or the spec names what it does not have.
    """
    with quiet_mujoco():
        whole, body = _attached(robot, ground, task)
        _fits(robot, whole, body)
        _collisions(robot, body, task)
        _joints(robot, body, task)
        _actuators(robot, whole, task)
        blocks = _sensors(robot, whole)
        try:
            model = whole.compile()
        except ValueError as error:
            raise ConfigError(f"{robot.mjcf}: {' '.join(str(error).split())}") from None
    return _scene(robot, model, blocks)


def _attached(robot: Robot, ground: Ground, task: Task) -> tuple[Any, Any]:
    """Return the scene, and the robot's base in it."""
    import mujoco

    try:
        own = mujoco.MjSpec.from_file(str(robot.mjcf))
    except ValueError as error:
        raise ConfigError(
            f"MuJoCo does not read {robot.mjcf}: {' '.join(str(error).split())}"
        ) from None
    for element in (*own.actuators, *own.sensors, *own.keys, *own.cameras, *own.lights):
        own.delete(element)
    below = ground.spec()
    for spec in (own, below):
        _options(spec, task)  # both, or MuJoCo warns of what they disagree on
    # The ground to the robot, so that it is the robot's names that stay as they are.
    for element in (*below.actuators, *below.sensors, *below.keys):
        below.delete(element)  # they would come before the robot's
    for geom in below.geoms:
        if geom.conaffinity:
            geom.contype |= 1  # a robot that does not touch itself touches what has a contype
    own.attach(below, frame=own.worldbody.add_frame(), prefix="ground/")
    base = own.body(robot.spec.base)
    if base is None:
        raise ConfigError(f"{robot.mjcf} has no body {robot.spec.base!r}, the base of its spec")
    return own, base


def _fits(robot: Robot, whole: Any, base: Any) -> None:
    """Refuse a spec that speaks of another robot."""
    import mujoco

    spec = robot.spec
    free = [j for j in base.joints if j.type == mujoco.mjtJoint.mjJNT_FREE]
    if len(free) != 1 or len(base.joints) != 1:
        raise ConfigError(f"{robot.mjcf}: {spec.base} is not free to move; wanted a freejoint")
    if whole.joints[0].name != free[0].name or whole.joints[0].parent.name != spec.base:
        raise ConfigError(f"{robot.mjcf}: something moves before {spec.base}; wanted it first")
    joints = [j.name for j in whole.joints if j.type != mujoco.mjtJoint.mjJNT_FREE]
    unknown = [name for name in spec.joint_order if name not in joints]
    if unknown:
        raise ConfigError(
            f"the spec of {spec.name} has the joint {unknown[0]!r}; "
            f"{robot.mjcf.name} has: {listing(joints)}"
        )
    bodies = [b.name for b in base.find_all("body")] + [base.name]
    for field in ("feet", "termination_contacts", "penalized_contacts"):
        for name in getattr(spec, field):
            if name not in bodies:
                raise ConfigError(
                    f"{field} of {spec.name} has {name!r}; the bodies of "
                    f"{robot.mjcf.name} are: {listing(bodies)}"
                )


def _collisions(robot: Robot, base: Any, task: Task) -> None:
    """Let the robot touch the ground, with what touches anything, and itself if wanted."""
    wanted = {*robot.spec.feet, *robot.spec.termination_contacts}
    for geom in base.find_all("geom"):
        if not geom.contype and not geom.conaffinity:
            continue
        if task.asset.collisions != "all" and geom.parent.name not in wanted:
            geom.contype = geom.conaffinity = 0
            continue
        geom.contype = int(task.asset.self_collisions)
        geom.conaffinity = _ANY
        geom.condim = 3
        # The robot's friction is what is randomized; without priority the larger of two counts.
        geom.priority = 1


def _joints(robot: Robot, base: Any, task: Task) -> None:
    armature = robot.spec.per_joint("armature")
    for joint in base.find_all("joint"):
        if joint.name in armature:
            joint.armature = armature[joint.name]
            joint.actfrclimited = False  # the spec's effort counts
            if not task.asset.joint_friction:
                joint.frictionloss = 0


def _actuators(robot: Robot, whole: Any, task: Task) -> None:
    """Add a motor for each joint, with its controller: the physics' own, evaluated every step."""
    import mujoco

    spec, control = robot.spec, task.control
    plain = mujoco.MjSpec().default.actuator
    stiffness, damping = spec.per_joint("stiffness"), spec.per_joint("damping")
    for name, effort in spec.per_joint("effort").items():
        kp, kd = stiffness[name], damping[name]
        if control.stiffness is not None and kp > 0:
            kp = control.stiffness
        if control.damping is not None:
            kd = control.damping
        motor = whole.add_actuator(
            name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, forcelimited=True
        )
        for what in _MOTOR_DEFAULTS:
            setattr(motor, what, getattr(plain, what))
        motor.forcerange = [-effort, effort]
        if control.control_type == "T":
            motor.set_to_motor()
        elif control.control_type == "V" or kp == 0:
            motor.set_to_velocity(kv=kd)
        else:
            motor.set_to_position(kp=kp, kv=kd)


def _sensors(robot: Robot, whole: Any) -> dict[str, slice]:
    """Add the sensors, and return where in sensordata the values of each kind are."""
    import mujoco

    kind, body, site = mujoco.mjtSensor, mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_SITE
    spec = robot.spec
    soles = [_sole(whole, name) for name in spec.feet]
    wanted = {
        "foot_position": (kind.mjSENS_FRAMEPOS, site, soles),
        "foot_velocity": (kind.mjSENS_FRAMELINVEL, site, soles),
        "foot_force": (kind.mjSENS_CONTACT, body, spec.feet),
        "penalized_force": (kind.mjSENS_CONTACT, body, spec.penalized_contacts),
        "termination_force": (kind.mjSENS_CONTACT, body, spec.termination_contacts),
    }
    blocks, start = {}, 0
    for block, (sensed, at, names) in wanted.items():
        for name in names:
            sensor = whole.add_sensor(name=f"{block}_{name}", type=sensed, objtype=at, objname=name)
            if sensed == kind.mjSENS_CONTACT:
                sensor.intprm[:3] = [_CONTACT_FORCE, _NET_FORCE, 1]
        blocks[block] = slice(start, start + 3 * len(names))
        start += 3 * len(names)
    return blocks


def _sole(whole: Any, foot: str) -> str:
    """Add a site at the middle of what a foot touches the ground with, and return its name."""
    shapes = [g for g in whole.body(foot).geoms if g.contype or g.conaffinity]
    where = np.mean([g.pos for g in shapes], axis=0) if shapes else np.zeros(3)
    whole.body(foot).add_site(name=_sole_name(foot), pos=where, group=4)
    return _sole_name(foot)


def _sole_name(foot: str) -> str:
    return f"sole of {foot}"


def _options(spec: Any, task: Task) -> None:
    """Set what was measured to pay, together a factor of two."""
    import mujoco

    spec.option = mujoco.MjSpec().option  # gravity, impratio, wind: the same for every robot
    option = spec.option
    option.timestep = task.sim.dt
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
    option.iterations = task.sim.iterations
    option.ls_iterations = task.sim.ls_iterations


def _scene(robot: Robot, model: Any, blocks: dict[str, slice]) -> Scene:
    names = robot.spec.joint_order
    joint_qpos = np.array([model.joint(name).qposadr[0] for name in names])
    home = model.qpos0.copy()
    home[:7] = (0, 0, 0, 1, 0, 0, 0)
    home[joint_qpos] = robot.default_pose
    base = model.body(robot.spec.base).id
    own = model.body_rootid[model.geom_bodyid] == model.body_rootid[base]
    return Scene(
        model=model,
        joint_qpos=joint_qpos,
        joint_qvel=np.array([model.joint(name).dofadr[0] for name in names]),
        base=base,
        geoms=np.flatnonzero(touching(model) & own),
        home=home,
        sole_depth=_sole_depth(robot, model, home),
        blocks=blocks,
    )


def _sole_depth(robot: Robot, model: Any, home: Any) -> Any:
    import mujoco

    data = mujoco.MjData(model)
    data.qpos[:] = home
    mujoco.mj_kinematics(model, data)
    depths = []
    for foot in robot.spec.feet:
        geoms = np.flatnonzero(touching(model) & (model.geom_bodyid == model.body(foot).id))
        at = data.site(_sole_name(foot)).xpos[2]
        depths.append(max((at - lowest_point(model, data, int(g)) for g in geoms), default=0.0))
    return np.array(depths, np.float32)


def lowest_point(model: Any, data: Any, geom: int) -> float:
    """Return the height of the lowest point of a geom in the world [m]."""
    import mujoco

    kind = mujoco.mjtGeom
    axes = data.geom_xmat[geom].reshape(3, 3)[2]  # how far up each axis of the geom points
    size, up = model.geom_size[geom], np.abs(axes)
    match model.geom_type[geom]:
        case kind.mjGEOM_SPHERE:
            reach = size[0]
        case kind.mjGEOM_CAPSULE:
            reach = size[0] + size[1] * up[2]
        case kind.mjGEOM_CYLINDER:
            reach = size[0] * np.hypot(up[0], up[1]) + size[1] * up[2]
        case kind.mjGEOM_ELLIPSOID:
            reach = np.linalg.norm(size * up)
        case kind.mjGEOM_MESH:
            mesh = model.mesh(int(model.geom_dataid[geom]))
            start, count = int(mesh.vertadr[0]), int(mesh.vertnum[0])
            reach = -(model.mesh_vert[start : start + count] @ axes).min()
        case _:
            reach = size @ up
    return float(data.geom_xpos[geom][2] - reach)
