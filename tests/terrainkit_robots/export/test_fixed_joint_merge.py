from dataclasses import replace

import mujoco
import numpy as np
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.export.canonical import to_canonical
from terrainkit_robots.export.fixed_joint_merge import merge_fixed_joints
from terrainkit_robots.export.mjcf import Extras, mjcf_text
from terrainkit_robots.quiet_mujoco import quiet_mujoco


@pytest.fixture
def model():
    return to_canonical(Facts(load_robot(bundled.urdf_path("quadruped")))).model


def test_fixed_links_are_merged(model):
    single = merge_fixed_joints(model, keep=["FL_foot"])
    moving = [joint.child for joint in model.joints if joint.moves]
    assert {link.name for link in single.model.links} == {"base", "FL_foot", *moving}
    assert [joint.name for joint in single.model.joints if not joint.moves] == ["FL_foot_joint"]
    body, pose = single.frames["FR_foot"]
    assert (body, pose[:3, 3].tolist()) == ("FR_calf", [0, 0, -0.213])
    # Two shapes of the calf and one of the foot, which is lower.
    calf = next(link for link in single.model.links if link.name == "FR_calf")
    assert [round(float(shape.origin[2, 3]), 3) for shape in calf.collisions] == [-0.1, -0.213]
    drawn = {link.name: len(link.visuals) for link in model.links}
    assert len(calf.visuals) == drawn["FR_calf"] + drawn["FR_foot"]


def test_merged_robot_has_same_motion(model):
    whole, single = map(compiled, (model, merge_fixed_joints(model).model))
    assert single.nbody < whole.nbody
    for qpos in np.random.default_rng(0).uniform(-1, 1, (2, whole.nq)):
        qpos[3:7] /= np.linalg.norm(qpos[3:7])
        one, other = (mass_matrix(made, qpos) for made in (whole, single))
        np.testing.assert_allclose(one, other, atol=1e-8)


def compiled(model):
    with quiet_mujoco():
        return mujoco.MjModel.from_xml_string(mjcf_text(model, Extras()))


def mass_matrix(made, qpos):
    data = mujoco.MjData(made)
    data.qpos[:] = qpos
    mujoco.mj_fwdPosition(made, data)
    rows = np.zeros((made.nv, made.nv))
    for row, unit in zip(rows, np.eye(made.nv), strict=True):
        mujoco.mj_mulM(made, data, row, unit)
    return rows


def test_excluded_pairs_of_bodies(model):
    pairs = frozenset({frozenset(("FL_foot", "FR_foot")), frozenset(("FL_foot", "FL_calf"))})
    single = merge_fixed_joints(replace(model, excluded=pairs))
    assert single.model.excluded == {frozenset(("FL_calf", "FR_calf"))}
