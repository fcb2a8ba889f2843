"""The MuJoCo model of terrain and robot, with the motors and sensors of training.

Actuators and sensors of the robot's own file are ignored: its spec defines them. So onboarded,
bundled and hand-written robots are trained alike.
"""

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, listing, one_line
from terrainkit.integrations.near_geoms import collides
from terrainkit_robots.analysis.bodies.contact import MAX_SOLE_DEPTH
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.rendering.appearance import set_appearance
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.terrain import Ground
from terrainkit_robots.simulation.geoms import lowest_point, only_visual
from terrainkit_robots.spec.robot_arrays import Robot
from terrainkit_robots.transforms import FloatArray

CONTACT_FORCE_BIT, NET_FORCE = 2, 3
"""`intprm[0]` and `intprm[1]` of a contact sensor: report the force, summed over all contacts."""

SOLE = "sole of "
"""Prefix of the sites at the feet."""

MAX_SPEED = 10.0
"""Speed that a robot does not exceed within a policy step [m/s]."""

MIN_CENTER_OFFSET = 0.05
"""Offset of the base's frame from the middle of the feet that is corrected, in leg lengths."""

GROUND_BIT, ROBOT_BIT, ALL_BITS = 1, 2, 0x7FFFFFFF
"""The `contype` of terrain and robots, and a `conaffinity` that matches every `contype`."""


class Scene:
    """A compiled model, and indices into it. In qpos and qvel, the base comes first.

    The sensors are `foot_position`, `foot_velocity`, `foot_force`, `penalized_force` and
    `termination_force`, with three numbers per body. Forces act on what the robot touches [N].
    """

    def __init__(
        self, robot: Robot, terrain: Ground, task: Task, *, all_geoms: bool = False
    ) -> None:
        """Build the scene of a task.

        Args:
            robot: The robot.
            terrain: The terrain under it.
            task: The task.
            all_geoms: Whether the model has all geoms of the terrain, to draw it; otherwise, only
                those near a robot may be in it, since steps are then faster.

        Raises:
            ConfigError: If MuJoCo rejects the robot, or its spec differs from its model.
        """
        with quiet_mujoco():
            mjspec, home = _attach(robot, terrain, task)
            _set_joints_and_collisions(robot, _checked_base(robot, mjspec), task)
            _add_actuators(robot, mjspec, task)
            self.sensors = _add_sensors(robot, mjspec)  # range of each kind in sensordata
            set_appearance(mjspec)  # for videos and the viewer
            try:
                self.model: Any = mjspec.compile()
            except ValueError as error:
                raise ConfigError(f"{robot.mjcf}: {one_line(str(error))}") from None
            if task.asset.visual_collisions:
                _add_boxes(mjspec.body(robot.spec.base), self.model)
                self.model = mjspec.compile()
            self.near_geoms = None  # of the terrain, if the model has not all of them
            if not terrain.is_plane and not all_geoms:
                move = MAX_SPEED * task.dt
                self.near_geoms = terrain.near_geoms(mjspec, robot.spec.base, move)
                if self.near_geoms:
                    self.model = mjspec.compile()
        model = self.model
        joints = [model.joint(name).id for name in robot.spec.joint_order]
        self.joint_qpos = model.jnt_qposadr[joints]  # indices of the joints, in the robot's order
        self.joint_qvel = model.jnt_dofadr[joints]
        slide = mujoco.mjtJoint.mjJNT_SLIDE
        self.joint_units = tuple("m" if model.jnt_type[k] == slide else "rad" for k in joints)
        self.default_qpos = model.qpos0.copy()  # the default pose with the base at height 0
        if len(home) == model.nq:  # passive joints, at which closed loops are closed
            self.default_qpos[:] = home
        self.default_qpos[:7] = (0, 0, 0, 1, 0, 0, 0)
        self.default_qpos[self.joint_qpos] = robot.default_pose
        self.base: int = model.body(robot.spec.base).id
        of_robot = model.body_rootid[model.geom_bodyid] == model.body_rootid[self.base]
        self.geoms = np.flatnonzero(collides(model) & of_robot)  # the robot's colliding geoms
        data = mujoco.MjData(model)
        data.qpos[:] = self.default_qpos
        mujoco.mj_kinematics(model, data)
        # At `default_qpos`, the position of each foot's site, and the distance from it down to the
        # lowest point of the foot [m], shapes (f, 3) and (f,).
        foot_pos, self.sole_depth = _place_soles(robot, model, data)
        # Point of the base whose position and velocity are the robot's, in its frame [m]. Some
        # files have the frame beside the plane of symmetry, such as at the left hip.
        offset = float(foot_pos[:, 1].mean())
        is_beside = abs(offset) > MIN_CENTER_OFFSET * robot.leg_length
        self.center = np.array([0, offset if is_beside else 0, 0], np.float32)
        self.foot_pos = foot_pos - self.center
        self.hip_joints = _hip_joints(robot, model, data)


def _attach(robot: Robot, terrain: Ground, task: Task) -> tuple[Any, Any]:
    """Return the MjSpec of robot and terrain, and the positions of the first keyframe, if any."""
    try:
        mjspec = mujoco.MjSpec.from_file(str(robot.mjcf))
    except ValueError as error:
        raise ConfigError(f"MuJoCo cannot read {robot.mjcf}: {one_line(str(error))}") from None
    ground_mjspec = terrain.spec()
    home = np.array(mjspec.keys[0].qpos if mjspec.keys else [])
    for element in (*mjspec.actuators, *mjspec.sensors, *mjspec.keys, *mjspec.cameras):
        mjspec.delete(element)
    for model_spec in (mjspec, ground_mjspec):  # options of both, or MuJoCo warns about differences
        model_spec.option = mujoco.MjSpec().option  # gravity, wind: the same for every robot
        model_spec.option.timestep = task.sim.dt
        # Implicit in forces that depend on the velocity, such as the damping of the motors.
        model_spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        # Faster than elliptic cones; see `Asset` for what else halves the time of a step.
        model_spec.option.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
        model_spec.option.iterations = task.sim.iterations
        model_spec.option.ls_iterations = task.sim.ls_iterations
    # The terrain is attached to the robot, so the robot's names keep their form.
    mjspec.attach(ground_mjspec, frame=mjspec.worldbody.add_frame(), prefix="ground/")
    return mjspec, home


def _checked_base(robot: Robot, mjspec: Any) -> Any:
    """Return the robot's base after checking that the spec matches the model."""
    spec, file, free = robot.spec, robot.mjcf, mujoco.mjtJoint.mjJNT_FREE
    base = mjspec.body(spec.base)
    if base is None:
        raise ConfigError(f"{file} has no body {spec.base!r}, the base of its spec")
    if [joint.type for joint in base.joints] != [free]:
        raise ConfigError(f"{file}: {spec.base} has no freejoint of its own; expected one")
    if mjspec.joints[0].parent.name != spec.base:
        raise ConfigError(f"{file}: a joint precedes {spec.base}; expected the base first")
    joints = [joint.name for joint in mjspec.joints if joint.type != free]
    bodies = [body.name for body in base.find_all("body")] + [base.name]
    fields = dict.fromkeys(("feet", "termination_contacts", "penalized_contacts"), bodies)
    for field, known in {"joint_order": joints, **fields}.items():
        if unknown := [name for name in getattr(spec, field) if name not in known]:
            got = f"{field} of {spec.name}: got {unknown[0]!r}"
            raise ConfigError(f"{got}; {file.name} has: {listing(known)}")
    return base


def _set_joints_and_collisions(robot: Robot, base: Any, task: Task) -> None:
    """Set armature and friction of the joints, and what the geoms collide with."""
    armature = robot.spec.per_joint("armature")
    for joint in base.find_all("joint"):
        if joint.name in armature:
            joint.armature = armature[joint.name]
            joint.actfrclimited = False  # the spec's effort is the limit
            if not task.asset.joint_friction:
                joint.frictionloss = 0
    for geom in base.find_all("geom"):
        if not geom.contype and not geom.conaffinity:
            continue
        geom.contype = ROBOT_BIT if task.asset.self_collisions else 0
        geom.conaffinity = ALL_BITS
        geom.condim = 3
        geom.priority = 1  # the robot's friction counts, not the larger of two


def _add_boxes(base: Any, model: Any) -> None:
    """Add boxes around the visual geoms of bodies that do not collide, which touch the ground.

    Boxes, since flat meshes have no convex hull.
    """
    is_visual = only_visual(model)
    # Listed before, since a new geom changes the numbers of the others.
    geoms = [(geom.parent, geom.id) for geom in base.find_all("geom") if is_visual[geom.id]]
    for body, index in geoms:
        center, size = np.split(model.geom_aabb[index], 2)
        quat, position = model.geom_quat[index], np.zeros(3)
        mujoco.mju_rotVecQuat(position, center, quat)
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=position + model.geom_pos[index],
            quat=quat,
            size=np.maximum(size, 1e-3),
            mass=0,
            contype=0,
            conaffinity=GROUND_BIT,
            condim=3,
            priority=1,
            group=3,
        )


def _add_actuators(robot: Robot, mjspec: Any, task: Task) -> None:
    """Add a motor for each joint; MuJoCo evaluates its controller in every physics step."""
    spec, control = robot.spec, task.control
    default, joint = mujoco.MjSpec().default.actuator, mujoco.mjtTrn.mjTRN_JOINT
    stiffness, damping = spec.per_joint("stiffness"), spec.per_joint("damping")
    for name, effort in spec.per_joint("effort").items():
        kp, kd = stiffness[name], damping[name] if control.damping is None else control.damping
        if control.stiffness is not None and kp > 0:
            kp = control.stiffness
        motor = mjspec.add_actuator(name=name, target=name, trntype=joint, forcelimited=True)
        # A new motor inherits from the defaults in the robot's file.
        for attribute in ("gear", "ctrllimited", "ctrlrange", "actlimited", "actrange", "interp"):
            setattr(motor, attribute, getattr(default, attribute))
        # Each simulation has its own delay; this is the longest.
        motor.nsample, motor.delay = task.max_delay_steps, task.max_delay_steps * task.sim.dt
        motor.forcerange = [-effort, effort]
        if control.control_type == "T":
            motor.set_to_motor()
        elif control.control_type == "V" or kp == 0:
            motor.set_to_velocity(kv=kd)
        else:
            motor.set_to_position(kp=kp, kv=kd)


def _add_sensors(robot: Robot, mjspec: Any) -> dict[str, slice]:
    """Add the sensors, and return the range of each kind in sensordata."""
    spec, soles = robot.spec, [SOLE + foot for foot in robot.spec.feet]
    for foot in spec.feet:
        mjspec.body(foot).add_site(name=SOLE + foot, group=4)
    sensor, body, site = mujoco.mjtSensor, mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_SITE
    kinds = {
        "foot_position": (sensor.mjSENS_FRAMEPOS, site, soles),
        "foot_velocity": (sensor.mjSENS_FRAMELINVEL, site, soles),
        "foot_force": (sensor.mjSENS_CONTACT, body, spec.feet),
        "penalized_force": (sensor.mjSENS_CONTACT, body, spec.penalized_contacts),
        "termination_force": (sensor.mjSENS_CONTACT, body, spec.termination_contacts),
    }
    ranges = {}
    start = 0
    for kind, (type_, objtype, names) in kinds.items():
        for name in names:
            made = mjspec.add_sensor(type=type_, objtype=objtype, objname=name)
            if type_ == sensor.mjSENS_CONTACT:
                made.intprm[:3] = [CONTACT_FORCE_BIT, NET_FORCE, 1]
        ranges[kind] = slice(start, start := start + 3 * len(names))
    return ranges


def _place_soles(robot: Robot, model: Any, data: Any) -> tuple[FloatArray, FloatArray]:
    """Move the site of each foot to the center of the geoms that touch the ground.

    A file does not show where they are: frames of meshes may be far from them, and compiled models
    have their centers.

    Returns:
        The `foot_pos`, of the frame of the base, and the `sole_depth` of a scene.
    """
    positions, depths = [], []
    for foot in robot.spec.feet:
        body, site = model.body(foot).id, model.site(SOLE + foot).id
        geoms = np.flatnonzero(collides(model) & (model.geom_bodyid == body))
        position, depth = data.xpos[body], 0.0
        if len(geoms):
            lowest = np.array([lowest_point(model, data, int(geom)) for geom in geoms])
            position = data.geom_xpos[geoms[lowest <= lowest.min() + MAX_SOLE_DEPTH]].mean(axis=0)
            depth = position[2] - lowest.min()
        model.site_pos[site] = data.xmat[body].reshape(3, 3).T @ (position - data.xpos[body])
        model.site_sameframe[site] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        positions.append(position)
        depths.append(depth)
    return np.array(positions, np.float32), np.array(depths, np.float32)


def _hip_joints(robot: Robot, model: Any, data: Any) -> NDArray[np.int64]:
    """Return the indices of the hip joints that turn about another axis than the pitch axis.

    They are those of one leg, above its knee; a robot whose spec has no thighs has none.
    """
    legs = np.zeros(model.nbody, np.int64)  # number of the thighs at or below each body
    for thigh in robot.spec.thighs:
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, thigh)
        while body > 0:
            legs[body] += 1
            body = model.body_parentid[body]
    joints = [model.joint(name).id for name in robot.spec.joint_order]
    is_pitch = np.abs(data.xaxis[joints, 1]) > np.sqrt(0.5)
    return np.flatnonzero((legs[model.jnt_bodyid[joints]] == 1) & ~is_pitch)


def drawn_model(scene: Scene, robot: Robot, terrain: Ground, task: Task) -> Any:
    """Return the model of a scene with all geoms of its terrain, for pictures."""
    if scene.near_geoms is None:
        return scene.model
    return Scene(robot, terrain, task, all_geoms=True).model
