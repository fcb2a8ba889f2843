"""Weld the joints of a simulation model."""

from collections.abc import Mapping
from itertools import chain

import numpy as np

from terrainkit_robots.simulation.sim_model import SimModel


def weld_joints(sim: SimModel, positions: Mapping[str, float]) -> SimModel:
    """Return a robot that is one rigid body, except for the free joint of its base.

    Args:
        sim: The robot. Use it within `quiet_mujoco`.
        positions: Positions of the joints [rad] or [m].
    """
    import mujoco

    spec, model = sim.spec.copy(), sim.model
    data = mujoco.MjData(model)
    data.qpos[:] = sim.qpos_at(positions)
    mujoco.mj_kinematics(model, data)
    sections = spec.actuators, spec.sensors, spec.equalities, spec.tendons, spec.keys
    for element in chain.from_iterable(sections):
        spec.delete(element)
    for body in spec.bodies:
        joints = [joint for joint in body.joints if joint.type != mujoco.mjtJoint.mjJNT_FREE]
        if joints:
            index = model.body(body.name).id
            parent = model.body_parentid[index]
            origin, turn = np.zeros(3), np.zeros(4)
            mujoco.mju_negPose(origin, turn, data.xpos[parent], data.xquat[parent])
            pos, quat = data.xpos[index], data.xquat[index]
            mujoco.mju_mulPose(body.pos, body.quat, origin, turn, pos, quat)
        for joint in joints:
            spec.delete(joint)
    return SimModel.from_mujoco(spec.compile(), spec=spec, base=sim.base)
