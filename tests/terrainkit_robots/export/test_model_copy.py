import mujoco
import numpy as np

from terrainkit_robots.export.model_copy import copy_model
from terrainkit_robots.quiet_mujoco import quiet_mujoco


def test_copy_model_is_complete(onboarded, robot_file, tmp_path):
    """The copy of an MJCF with meshes loads from another folder, with the same masses."""
    source = onboarded(robot_file("a1/urdf/a1.urdf")).folder / "scene.xml"
    for name, data in copy_model(source).items():
        (tmp_path / name).write_bytes(data)
    with quiet_mujoco():
        before, copy = (
            mujoco.MjModel.from_xml_path(str(path)) for path in (source, tmp_path / "robot.xml")
        )
    assert (copy.nq, copy.nu, copy.nmesh) == (before.nq, before.nu, before.nmesh)
    assert copy.nmesh > 0
    np.testing.assert_allclose(copy.body_mass, before.body_mass)
    np.testing.assert_allclose(copy.geom_size, before.geom_size, atol=1e-6)
