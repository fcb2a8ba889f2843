"""Tests of the configuration for Genesis, with stubs."""

from collections import defaultdict
from dataclasses import make_dataclass
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

FIELDS = ("pos", "fixed", "merge_fixed_links", "links_to_keep", "default_armature")
URDF = make_dataclass("URDF", ["file", *((name, Any, None) for name in FIELDS)])
GENESIS = {"genesis": {"morphs": SimpleNamespace(URDF=URDF)}}


class Robot:
    """Stub of a Genesis entity with reversed joint order, which records all calls."""

    def __init__(self, joints):
        self.places = {joint: 6 + place for place, joint in enumerate(reversed(joints))}
        self.calls = defaultdict(dict)

    def get_joint(self, name):
        return SimpleNamespace(dofs_idx_local=[self.places[name]])

    def __getattr__(self, method):
        return partial(self.record, method)

    def record(self, method, *arguments, **named):
        *values, places = (*arguments, *named.values())
        joints = {place: joint for joint, place in self.places.items()}
        for place, *each in zip(places, *values, strict=True):
            assert joints[place] not in self.calls[method]
            self.calls[method][joints[place]] = each[0] if len(each) == 1 else tuple(each)


@pytest.fixture
def build(load):
    """Return a function that builds a robot: its configuration, robot, morph and environments."""

    def run(spec, **known):
        loaded, robot, seen = load("genesis", spec, GENESIS, **known), Robot(spec.joint_order), {}

        def add_entity(morph):
            seen["morph"] = morph
            return robot

        scene = SimpleNamespace(
            add_entity=add_entity, build=lambda n_envs: seen.update(n_envs=n_envs)
        )
        assert loaded.build(scene, n_envs=8) is robot
        assert seen["n_envs"] == 8
        return SimpleNamespace(config=loaded, robot=robot, calls=robot.calls, morph=seen["morph"])

    return run


def test_genesis_config_of_quadruped(build, robots, tmp_path):
    spec = robots.quadruped()
    built = build(spec, bodies=robots.bodies)
    assert (built.morph.file, built.morph.pos) == (str(tmp_path / "robot.urdf"), (0.0, 0.0, 0.3))
    assert built.morph.fixed is False
    assert built.morph.default_armature is None
    assert set(spec.feet) <= set(built.morph.links_to_keep)
    force = {joint: (-f, f) for joint, f in robots.of(spec, calf=45.43, other=23.7).items()}
    assert built.calls == {
        "set_dofs_kp": robots.of(spec, calf=30.0, other=20.0),
        "set_dofs_kv": robots.of(spec, calf=0.75, other=0.5),
        "set_dofs_force_range": force,
        "set_dofs_armature": robots.of(spec, calf=0.04, other=0.01),
        "set_dofs_position": robots.pose_of(spec),
        "control_dofs_position": robots.pose_of(spec),
    }
    assert built.config.dofs(built.robot) == list(range(17, 5, -1))
    assert robots.of(spec, calf=0.2, other=0.25) == built.config.ACTION_SCALE
    assert tuple(built.config.FEET) == spec.feet


def test_genesis_config_of_wheels(build, robots):
    spec = robots.wheeled()
    built = build(spec)
    wheels, others = robots.wheels_of(spec)
    assert built.calls["control_dofs_velocity"] == dict.fromkeys(wheels, 0.0)
    assert set(built.calls["control_dofs_position"]) == set(others)
    assert set(built.calls["set_dofs_position"]) == set(spec.joint_order)
    assert built.calls["set_dofs_kp"] == robots.of(spec, calf=0.0, other=20.0)
    assert dict.fromkeys(others, 0.25) == built.config.ACTION_SCALE
    assert dict.fromkeys(wheels, 5.0) == built.config.SPEED_SCALE
    text = Path(built.config.__file__).read_text()
    assert "[rad/s or m/s]; suggested: a share\nSPEED_SCALE = {" in text


def test_genesis_config_of_other_robots(build, robots):
    calls = build(robots.plain(("left", "right"), stiffness={".*": 0.0})).calls
    assert calls["control_dofs_velocity"] == {"left": 0.0, "right": 0.0}
    assert "control_dofs_position" not in calls
    calls = build(robots.plain(("a", "b"), effort={"b": 3.0}, armature={})).calls
    assert calls["set_dofs_force_range"] == {"b": (-3.0, 3.0)}
    assert "set_dofs_armature" not in calls
    assert build(robots.plain(())).calls == {}
    hostile = robots.hostile()
    built = build(hostile)
    assert built.calls["set_dofs_kp"] == hostile.stiffness
    assert built.morph.file.endswith(hostile.urdf)
