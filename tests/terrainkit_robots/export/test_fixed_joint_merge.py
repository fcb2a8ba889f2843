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
def facts():
    return Facts(to_canonical(Facts(load_robot(bundled.urdf_path("quadruped")))).model)


def test_fixed_links_are_merged(facts):
    single = merge_fixed_joints(facts.model, keep=["FL_foot"])
    names = [link.name for link in single.model.links]
    assert "FL_foot" in names
    assert "FR_foot" not in names
    assert len(names) == len(facts.bodies) + 1
    body, pose = single.frames["FR_foot"]
    assert body == "FR_calf"
    np.testing.assert_allclose(pose[:3, 3], [0, 0, -0.213])
    # Two shapes of the calf and one of the foot, which is lower.
    calf = next(link for link in single.model.links if link.name == "FR_calf")
    assert [round(float(shape.origin[2, 3]), 3) for shape in calf.collisions] == [-0.1, -0.213]


def test_merged_robot_has_same_motion(facts):
    whole, single = (
        compiled(model) for model in (facts.model, merge_fixed_joints(facts.model).model)
    )
    assert single.nbody < whole.nbody
    for qpos in np.random.default_rng(0).uniform(-1, 1, (5, whole.nq)):
        qpos[3:7] /= np.linalg.norm(qpos[3:7])
        one, other = (mass_matrix(model, qpos) for model in (whole, single))
        np.testing.assert_allclose(one, other, atol=1e-8)


def compiled(model):
    with quiet_mujoco():
        return mujoco.MjModel.from_xml_string(mjcf_text(model, Extras()))


def mass_matrix(model, qpos):
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_fwdPosition(model, data)
    rows = np.zeros((model.nv, model.nv))
    for row, unit in zip(rows, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, row, unit)
    return rows


def test_excluded_pairs_of_bodies(facts):
    from dataclasses import replace

    pairs = frozenset({frozenset(("FL_foot", "FR_foot")), frozenset(("FL_foot", "FL_calf"))})
    single = merge_fixed_joints(replace(facts.model, excluded=pairs))
    assert single.model.excluded == {frozenset(("FL_calf", "FR_calf"))}
