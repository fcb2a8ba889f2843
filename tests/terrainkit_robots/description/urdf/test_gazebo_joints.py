"""SDF joints in <gazebo> elements close the loops of a URDF."""

from pathlib import Path

import numpy as np
import pytest

from tests.small_robots import joint, link
from tests.terrainkit_robots.description.made_robots import read

# At zero, the end of the crank is at (0.3, 0, 0) and that of the rod, 0.1 m ahead, at (0.4, 0, 0).
LINKS = "".join(map(link, ("base", "crank", "rod", "plate")))
JOINTS = (joint("base", "crank", xyz="0.1 0 0") + joint("base", "rod", xyz="0.2 0 0")) + joint(
    "base", "plate", kind="fixed"
)
ENDS = "<parent>{}</parent><child>{}</child>"


def loops(inner, kind="revolute", ends=("crank", "rod"), place="<gazebo>"):
    """Return the loops that a joint in a <gazebo> becomes, and the messages of problems."""
    text = f'<joint name="pin" type="{kind}">{ENDS.format(*ends)}{inner}</joint>'
    model = read(f'<robot name="r">{LINKS}{JOINTS}{place}{text}</gazebo></robot>', Path("r.urdf"))
    assert {j.name for j in model.joints if j.coupled} == (
        {"crank_joint", "rod_joint"} if model.loops else set()
    )
    assert {problem.code for problem in model.problems} <= {"XML019"}
    return model.loops, [problem.message for problem in model.problems]


@pytest.mark.parametrize(
    ("pose", "crank", "rod"),
    [
        ("", (0.1, 0, 0), (0, 0, 0)),
        ("<pose>0.2 0 0 0 0 0</pose>", (0.3, 0, 0), (0.2, 0, 0)),
        ('<pose relative_to="crank">0.2 0 0 0 0 0</pose>', (0.2, 0, 0), (0.1, 0, 0)),
        ('<pose relative_to="plate">0.2 0 0.1 0 0 0</pose>', (0.1, 0, 0.1), (0, 0, 0.1)),
        ('<pose frame="rod_joint">0 0.1 0 0 0 0</pose>', (0.1, 0.1, 0), (0, 0.1, 0)),
    ],
)
def test_anchor_is_in_both_links(pose, crank, rod):
    for place in ("<gazebo>", '<gazebo reference="rod">'):
        ((loop,), told) = loops(pose, place=place)
        assert (loop.kind, loop.links, told) == ("connect", ("crank", "rod"), [])
        for origin, expected in zip(loop.origins, (crank, rod), strict=True):
            np.testing.assert_allclose(origin[:3, 3], expected, atol=1e-12)


def test_fixed_joint_keeps_the_orientation():
    ((loop,), _) = loops('<pose degrees="true">0 0 0 0 0 90</pose>', "fixed", ("m::crank", "rod"))
    assert (loop.kind, loop.links) == ("weld", ("crank", "rod"))
    for origin in loop.origins:
        np.testing.assert_allclose(origin[:3, 0], (0, 1, 0), atol=1e-12)


@pytest.mark.parametrize(
    ("kind", "ends", "inner", "reason"),
    [
        ("universal", ("crank", "rod"), "", "type: got universal; expected one of: revolute,"),
        ("revolute", ("world", "rod"), "", "link: got world; expected links of the robot: base,"),
        ("revolute", ("crank", ""), "", "link: got nothing; expected links of the robot: base,"),
        ("ball", ("base", "plate"), "", "links: got base, plate; expected links that a joint"),
        ("ball", ("crank", "rod"), "<pose>1 2 x</pose>", "pose: got '1 2 x'; expected six"),
        ("ball", ("crank", "rod"), '<pose frame="x">0 0 0 0 0 0</pose>', "link: got x; expected"),
    ],
)
def test_other_joints_are_reported(kind, ends, inner, reason):
    found, (told,) = loops(inner, kind, ends)
    assert found == ()
    assert told.startswith(f"<joint> in <gazebo> is not read: {reason}")
