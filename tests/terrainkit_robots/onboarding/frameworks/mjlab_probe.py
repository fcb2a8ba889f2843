"""Build the robot of mjlab_config.py and step it; runs in an environment with mjlab.

The second argument is `wheeled` if the calf joints have velocity targets.
"""

import sys

sys.path.insert(0, sys.argv[1])

import mjlab_config
import mujoco
import numpy as np

entity = mjlab_config.get_robot_cfg().build()
model = entity.spec.compile()
joints = [
    f"{leg}_{part}_joint" for leg in ("FL", "FR", "RL", "RR") for part in ("hip", "thigh", "calf")
]
assert list(entity.joint_names) == joints
assert [model.actuator(number).name for number in range(model.nu)] == joints


def by_part(calf, other):
    return [calf if "calf" in joint else other for joint in joints]


is_wheeled = sys.argv[2] == "wheeled"
np.testing.assert_allclose(
    model.actuator_gainprm[:, 0], by_part(0.75 if is_wheeled else 30.0, 20.0)
)
np.testing.assert_allclose(
    model.actuator_biasprm[:, 1], by_part(0.0 if is_wheeled else -30.0, -20.0)
)
np.testing.assert_allclose(model.actuator_biasprm[:, 2], by_part(-0.75, -0.5))
np.testing.assert_allclose(model.actuator_forcerange[:, 1], by_part(45.43, 23.7))
np.testing.assert_allclose(model.dof_armature[6:], by_part(0.04, 0.01))
assert model.nkey == 1
np.testing.assert_allclose(model.key_qpos[0], [0, 0, 0.3, 1, 0, 0, 0, *[0, 0.9, -1.8] * 4])
np.testing.assert_allclose(model.key_ctrl[0], [0, 0.9, -1.8] * 4)

if is_wheeled:
    assert mjlab_config.SPEED_SCALE == {".*_calf_joint": 5.0}
data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, 0)
mujoco.mj_step(model, data, 50)
assert is_wheeled or abs(data.qpos[7:] - model.key_qpos[0][7:]).max() < 0.5
assert np.isfinite(data.qpos).all()
