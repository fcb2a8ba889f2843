import pytest

from terrainkit_robots.description import bundled
from terrainkit_robots.onboarding.derive_spec.named_bodies import (
    feet,
    penalized_contacts,
    shanks,
    termination_contacts,
    thighs,
)
from tests.robots import QUADRUPED
from tests.small_robots import ball, facts, joint, link

SHAPE = ball(0.1)


def biped(*bodies, shape=SHAPE):
    """Return the bundled biped with more bodies: name, parent and position."""
    more = "".join(
        link(name, shape) + joint(parent, name, xyz, kind="continuous")
        for name, parent, xyz in bodies
    )
    return facts(bundled.urdf_path("biped").read_text().replace("</robot>", f"{more}</robot>"))


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
    robot = facts(QUADRUPED.read_text())
    legs = ("FL", "FR", "RL", "RR")
    assert feet(robot) == tuple(f"{leg}_foot" for leg in legs)
    assert thighs(robot) == tuple(f"{leg}_thigh" for leg in legs)
    assert shanks(robot) == tuple(f"{leg}_calf" for leg in legs)
    assert penalized_contacts(robot) == thighs(robot) + shanks(robot)
    assert termination_contacts(robot) == ("base",)
