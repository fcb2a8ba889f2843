import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.onboarding.derive_spec.named_bodies import (
    feet,
    penalized_contacts,
    shanks,
    termination_contacts,
    thighs,
)

BODY = """<link name="{name}"><inertial><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>{shape}</link>
<joint name="{name}_joint" type="continuous"><parent link="{parent}"/><child link="{name}"/>
<origin xyz="{xyz}"/><axis xyz="0 0 1"/></joint>"""
SHAPE = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'


def biped(*bodies, shape=SHAPE):
    """Return the bundled biped with more bodies: name, parent and position."""
    file = bundled.urdf_path("biped")
    more = "".join(
        BODY.format(name=name, parent=parent, xyz=xyz, shape=shape) for name, parent, xyz in bodies
    )
    text = file.read_text().replace("</robot>", f"{more}</robot>")
    return Facts(load_robot(file, contents={file: text.encode()}))


ARMS = (("left_arm", "upper", "0 0.2 0"), ("right_arm", "upper", "0 -0.2 0"))


@pytest.mark.parametrize(
    ("bodies", "upper"),
    [
        ((("upper", "pelvis", "0 0 0.3"), *ARMS), ["upper"]),  # a torso has limbs on both sides
        ((("upper", "pelvis", "0 0 0.3"), *ARMS[:1]), []),
        ((("upper", "pelvis", "0 0 0.3"),), []),
        ((("neckHead", "pelvis", "0 0 0.3"),), ["neckHead"]),
        ((("forehead", "pelvis", "0 0 0.3"),), []),  # another word
    ],
)
def test_torsos_and_heads_of_bipeds_end_episodes(bodies, upper):
    base, *others = termination_contacts(biped(*bodies))
    assert (base, others) == (biped().bodies[0].name, upper)


def test_bodies_without_collision_shapes_do_not_end_episodes():
    robot = biped(("head", "pelvis", "0 0 0.3"), shape="")
    assert len(termination_contacts(robot)) == 1


def test_bodies_of_the_quadruped_are_named():
    file = bundled.urdf_path("quadruped")
    robot = Facts(load_robot(file))
    legs = ("FL", "FR", "RL", "RR")
    assert feet(robot) == tuple(f"{leg}_foot" for leg in legs)
    assert thighs(robot) == tuple(f"{leg}_thigh" for leg in legs)
    assert shanks(robot) == tuple(f"{leg}_calf" for leg in legs)
    assert penalized_contacts(robot) == thighs(robot) + shanks(robot)
    assert termination_contacts(robot) == ("base",)
