import pytest

from terrainkit_robots.export.canonical import has_floating_base
from tests.small_robots import chain, facts, joint, link, mjcf

LEGS = "".join(
    f'<body name="{n}" pos="{x} {y} 0"><joint name="{n}0" axis="{{roll}}"/>'
    f'<geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02"/><body name="{n}_" pos="0 0 -0.3">'
    f'<joint name="{n}1" axis="0 1 0"/><geom size="0.02" pos="0 0 -0.3"/></body></body>'
    for n, x, y in (("a", 0.2, 0.1), ("b", 0.2, -0.1), ("c", -0.2, 0.1), ("d", -0.2, -0.1))
)
SLIDES = {n: f'<joint name="{n}" type="slide" axis="{a}"/>' for n, a in
          (("x", "1 0 0"), ("y", "0 1 0"), ("z", "0 0 1"), ("xy", "1 1 0"))}  # fmt: skip
HINGES = {n: f'<joint name="{n}" axis="{a}"/>' for n, a in
          (("roll", "1 0 0"), ("pitch", "0 1 0"), ("yaw", "0 0 1"))}  # fmt: skip
JOINTS = SLIDES | HINGES | {"ball": '<joint name="ball" type="ball"/>'}
LEG_NAMES = tuple(f"{n}{k}" for n in "abcd" for k in (0, 1))


def robot(base, legs=LEGS, roll="1 0 0", motors=LEG_NAMES):
    joints = "".join(JOINTS[name] for name in base.split())
    body = f'<body name="trunk">{joints}<geom type="box" size="0.3 0.1 0.05"/>{legs}</body>'
    rest = "".join(f'<motor joint="{name}"/>' for name in motors)
    return mjcf(body.replace("{roll}", roll), f"<actuator>{rest}</actuator>")


@pytest.mark.parametrize(
    ("base", "is_floating"),
    [
        ("x y z roll pitch yaw", True),
        ("z y x yaw pitch roll", True),
        ("x y z ball", True),
        ("x z pitch", True),
        ("y z roll", True),
        ("x y yaw", False),  # it drives
        ("x z roll", False),
        ("z", False),
        ("x y xy roll pitch yaw", False),
    ],
)
def test_base_of_a_robot_on_legs(base, is_floating):
    found = robot(base)
    assert [each.name for each in found.base_joints] == (base.split() if is_floating else [])
    if is_floating:
        assert has_floating_base(found)
        assert found.bodies[0].name == "trunk"
        assert found.tree.order[0] == "trunk"
        assert tuple(each.name for each in found.joints) == LEG_NAMES
        assert [len(leg.joints) for leg in found.legs] == [2] * 4


def test_planar_model_keeps_its_base():
    # All joints turn about y: nothing would keep it from falling sideways.
    assert robot("x z pitch", roll="0 1 0").base_joints == ()
    assert len(robot("x y z ball", roll="0 1 0").base_joints) == 4


def test_base_with_a_motor_is_no_floating_base():
    base = "x y z roll pitch yaw"
    assert robot(base, motors=(*LEG_NAMES, "z")).base_joints == ()


def test_base_without_legs_is_floating_if_other_joints_have_motors():
    arm = '<body name="a"><joint name="a0"/><geom size="0.1"/></body>'
    assert len(robot("x y z roll pitch yaw", arm, motors=("a0",)).base_joints) == 6
    assert robot("x y z roll pitch yaw", arm, motors=()).base_joints == ()
    assert robot("x z pitch", arm, motors=("a0",)).base_joints == ()


@pytest.mark.parametrize(("mass", "count"), [(None, 6), (0.05, 6), (0.2, 0)])
def test_links_of_the_base_of_a_urdf_weigh_at_most_a_hundredth(mass, count):
    axes = ("1 0 0", "0 1 0", "0 0 1")
    parts = [link("world", mass=None)]
    for k, axis in enumerate((*axes, *axes)):
        parent, child = ("world" if k == 0 else f"v{k}"), ("trunk" if k == 5 else f"v{k + 1}")
        kind = "prismatic" if k < 3 else "continuous"
        parts += [joint(parent, child, axis=axis, kind=kind)]
        parts += [] if k == 5 else [link(child, mass=mass if k == 2 else None)]
    # The legs have 8 kg.
    places = ("0.2 0.1 0", "0.2 -0.1 0", "-0.2 0.1 0", "-0.2 -0.1 0")
    legs = [chain(n, place, (0.3, 0.3)) for n, place in zip("abcd", places, strict=True)]
    found = facts(*parts, link("trunk", mass=2), *legs)
    assert len(found.base_joints) == count
    if count:
        assert found.bodies[0].name == "trunk"
        assert len(found.legs) == 4
