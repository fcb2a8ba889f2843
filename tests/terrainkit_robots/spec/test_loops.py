"""A spec adds loops to a URDF, and says which joints have motors."""

import re
from dataclasses import replace

import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.spec.loops import LoopSpec, closed_loops, load_spec, with_loop_spec
from terrainkit_robots.spec.robot_spec import ClosedLoop
from tests.small_robots import facts, joint, link, mjcf

LINKS = "".join(map(link, ("base", "crank", "rod", "tip")))


def robot(axis="0 1 0", limits=(-1, 1)):
    """Return a trunk with two arms, 0.1 m apart; the rod is 0.02 m to the left of the crank."""
    return facts(
        LINKS,
        joint("base", "crank", limits=(-1, 1)),
        joint("base", "rod", xyz="0.1 0.02 0", axis=axis, limits=limits),
        joint("rod", "tip", kind="fixed"),
    ).model


def loops(order=(), links=("crank", "tip"), **values):
    loop = ClosedLoop(links=links, anchor=(0.0, 0.0, -0.2), **values)
    return LoopSpec(loops=(loop,), joint_order=order)


@pytest.mark.parametrize(
    ("axis", "other_anchor", "expected"),
    [
        ("0 1 0", None, (-0.1, -0.02, -0.2)),  # where the anchor is at zero
        ("0 1 0", (0.1, 0.5, -0.3), (0.1, -0.02, -0.3)),  # a pin has any length
        ("1 0 0", (0.1, 0.5, -0.3), (0.1, 0.5, -0.3)),  # not a planar linkage
    ],
)
def test_other_anchor(axis, other_anchor, expected):
    (loop,) = with_loop_spec(robot(axis), loops(other_anchor=other_anchor)).loops
    np.testing.assert_allclose(loop.origins[0][:3, 3], (0, 0, -0.2))
    np.testing.assert_allclose(loop.origins[1][:3, 3], expected, atol=1e-12)


def test_motors_are_those_of_the_order_or_have_an_effort():
    open_robot = robot(limits=())
    for order, motors in ((("rod_joint",), ["rod_joint"]), ((), ["crank_joint"])):
        model = with_loop_spec(open_robot, loops(order))
        assert [j.name for j in Facts(model).actuated] == motors
        assert set(Facts(model).passive_joints.values()) <= {
            "it moves with a closed loop or a tendon"
        }


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (loops(links=("crank", "tipp")), "loop 1: link: got tipp; did you mean 'tip'?"),
        (
            loops(links=("rod", "tip")),
            "loop 1: links: got rod, tip; expected links that a",
        ),
        (loops(("arm",)), "joint_order: got arm; expected joints of: crank_joint, rod_joint"),
    ],
)
def test_loops_of_another_robot(given, message):
    with pytest.raises(ConfigError, match=re.escape(message)):
        with_loop_spec(robot(), given)


def test_mjcf_keeps_its_loops():
    text = '<body name="a"><joint/><geom size="1"/></body>'
    with pytest.raises(ConfigError, match="expected <equality> in that file"):
        with_loop_spec(mjcf(text).model, loops())
    own = replace(mjcf(text).model, loops=with_loop_spec(robot(), loops()).loops)
    assert with_loop_spec(own, loops(links=("x", "y"))) is own


def test_file_of_loops_only(tmp_path, spec):
    file = tmp_path / "loops.toml"
    file.write_text('[[loops]]\nlinks = ["crank", "tip"]\nanchor = [0, 0, -0.2]\n')
    assert load_spec(file) == (None, loops())
    own = spec(loops=closed_loops(with_loop_spec(robot(), loops())))
    file.write_text(own.to_toml())
    loaded, found = load_spec(file)
    assert loaded == own
    assert found.loops == (replace(loops().loops[0], other_anchor=(-0.1, -0.02, -0.2)),)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('links = ["a", "a"]\nanchor = [0, 0, 0]', "loops[0].links: got ['a', 'a']; expected 2"),
        ('links = ["a", "b"]\nanchor = [0, 0]', "loops[0].anchor: got [0, 0]; expected 3 values"),
        ('links = ["a", "b"]\nanchor = [0, nan, 0]', "loops[0].anchor: got [0, nan, 0]"),
    ],
)
def test_invalid_loop_is_named(tmp_path, text, message):
    (tmp_path / "loops.toml").write_text(f"[[loops]]\n{text}\n")
    with pytest.raises(ConfigError, match=re.escape(f"loops.toml: {message}")):
        load_spec(tmp_path / "loops.toml")
