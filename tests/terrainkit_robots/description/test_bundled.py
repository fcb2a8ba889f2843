import xml.etree.ElementTree as ElementTree

import mujoco
import numpy as np
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.check import lint_selected
from terrainkit_robots.lint.settings import Settings
from terrainkit_robots.spec.robot_spec import RobotSpec
from terrainkit_robots.transforms import quat_to_matrix

every_robot = pytest.mark.parametrize("name", bundled.robot_names())
every_format = pytest.mark.parametrize("suffix", [".urdf", ".xml"])

HINGE = mujoco.mjtJoint.mjJNT_HINGE


def path_of(name, suffix):
    return bundled.urdf_path(name).with_suffix(suffix)


def compiled(name, suffix=".xml"):
    return mujoco.MjModel.from_xml_path(str(path_of(name, suffix)))


def urdf(name):
    return ElementTree.parse(path_of(name, ".urdf")).getroot()


def load_spec(name):
    return RobotSpec.load(bundled.urdf_path(name).with_name("robot.toml"))


def hinges(model):
    return [model.joint(i).name for i in range(model.njnt) if model.jnt_type[i] == HINGE]


def bodies(model):
    """Return mass, center and inertia in the axes of the body, by name."""
    found = {}
    for k in range(1, model.nbody):
        axes = quat_to_matrix(model.body_iquat[k])
        inertia = axes @ np.diag(model.body_inertia[k]) @ axes.T
        found[model.body(k).name] = [model.body_mass[k], *model.body_ipos[k], *inertia.ravel()]
    return found


def shapes(model):
    """Return body, whether it collides, type, size and pose of each shape, in order."""
    whole = [model.geom_bodyid, model.geom_contype != 0, model.geom_type]
    geoms = np.column_stack([*whole, model.geom_size, model.geom_pos, model.geom_quat])
    return np.array(sorted(geoms.tolist()))


def at(model, positions):
    """Return the data of a model with its base at the origin and its joints at `positions`."""
    data = mujoco.MjData(model)
    if model.nq > len(positions):
        data.qpos[:7] = [0, 0, 0, 1, 0, 0, 0]
    for joint, position in positions.items():
        data.joint(joint).qpos = position
    mujoco.mj_forward(model, data)
    return data


def random_poses(model):
    rng = np.random.default_rng(0)
    for _ in range(5):
        yield {joint: rng.uniform(*model.joint(joint).range) for joint in hinges(model)}


@every_robot
def test_find_by_name(name):
    assert bundled.urdf_path(name).is_file()
    assert urdf(name).get("name") == name


@pytest.mark.parametrize("name", ["", "quadruped.urdf", "../quadruped", "hexapod"])
def test_find_unknown_name(name):
    assert bundled.urdf_path(name) is None


@every_robot
def test_formats_have_same_bodies_shapes_and_kinematics(name):
    one, other = compiled(name, ".urdf"), compiled(name, ".xml")
    names = [link.get("name") for link in urdf(name).iter("link")]
    assert list(bodies(one)) == list(bodies(other)) == names
    np.testing.assert_allclose([*bodies(one).values()], [*bodies(other).values()], atol=1e-12)
    np.testing.assert_allclose(shapes(one), shapes(other), atol=1e-12)
    assert hinges(one) == hinges(other)
    for positions in random_poses(other):
        first, second = at(one, positions), at(other, positions)
        np.testing.assert_allclose(first.xpos, second.xpos, atol=1e-9)
        np.testing.assert_allclose(first.xmat, second.xmat, atol=1e-9)


@every_robot
def test_formats_have_same_joint_properties(name):
    model = compiled(name)
    motors = [model.actuator(i) for i in range(model.nu)]
    assert [f"{motor.name}_joint" for motor in motors] == hinges(model)
    for motor in motors:
        joint = model.joint(motor.trnid[0])
        written = urdf(name).find(f"joint[@name='{joint.name}']")
        limit, dynamics = numbers(written.find("limit")), numbers(written.find("dynamics"))
        assert tuple(joint.range) == (limit["lower"], limit["upper"])
        assert tuple(motor.ctrlrange) == (-limit["effort"], limit["effort"])
        assert dynamics == {"damping": joint.damping[0], "friction": joint.frictionloss[0]}
        assert joint.armature[0] > 0


def numbers(element):
    return {key: float(value) for key, value in element.items()}


@pytest.mark.parametrize(
    ("robot", "link", "mass", "joint", "limit"),
    [
        # The calf has the power of the thigh.
        ("quadruped", "FL_thigh", 1.152, "FL_thigh_joint", (-1.5708, 3.4907, 23.7, 30.1)),
        ("quadruped", "FL_calf", 0.154, "FL_calf_joint", (-2.7227, -0.83776, 45.43, 15.7)),
        ("biped", "left_knee_link", 1.932, "left_knee_joint", (-0.087267, 2.8798, 139, 20)),
    ],
)
def test_values_of_published_robots(robot, link, mass, joint, limit):
    """The quadruped is Unitree's Go2, and the biped the legs of its G1."""
    root = urdf(robot)
    assert numbers(root.find(f"link[@name='{link}']/inertial/mass")) == {"value": mass}
    found = numbers(root.find(f"joint[@name='{joint}']/limit"))
    assert tuple(found[key] for key in ("lower", "upper", "effort", "velocity")) == limit


@every_robot
@every_format
@pytest.mark.parametrize("has_spec", [False, True])
def test_check_robot_has_no_findings(name, suffix, has_spec):
    robot = Facts(load_robot(path_of(name, suffix)), spec=load_spec(name) if has_spec else None)
    loud = [f for f in lint_selected(robot, Settings()).findings if f.severity != "note"]
    assert not loud, "\n".join(f"{f.code} {f.subject}: {f.message}" for f in loud)


@every_robot
def test_spec_file_is_normalized(name):
    spec = load_spec(name)
    assert bundled.urdf_path(name).with_name("robot.toml").read_text() == spec.to_toml()
    assert list(spec.joint_order) == hinges(compiled(name))
