"""Specs of robots, and stub modules of frameworks that reject unknown fields."""

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.frameworks import config_files
from terrainkit_robots.spec.robot_spec import Provenance, RobotSpec

LEGS = ("FL", "FR", "RL", "RR")
PARTS = ("hip", "thigh", "calf")


def quadruped(**changes):
    """Return the spec of a quadruped, with values by pattern."""
    leg = ".*_({})_joint".format
    given = {
        "name": "quad 4",
        "urdf": "robot.urdf",
        "mjcf": "robot.xml",
        "floating": True,
        "joint_order": tuple(f"{leg}_{part}_joint" for leg in LEGS for part in PARTS),
        "base": "base",
        "feet": tuple(f"{leg}_foot" for leg in LEGS),
        "shanks": tuple(f"{leg}_calf" for leg in LEGS),
        "thighs": tuple(f"{leg}_thigh" for leg in LEGS),
        "termination_contacts": ("base",),
        "penalized_contacts": tuple(f"{leg}_{part}" for leg in LEGS for part in PARTS[1:]),
        "default_pose": {leg("hip"): 0.0, leg("thigh"): 0.9, leg("calf"): -1.8},
        "stiffness": {leg("hip|thigh"): 20.0, leg("calf"): 30.0},
        "damping": {leg("hip|thigh"): 0.5, leg("calf"): 0.75},
        "effort": {leg("hip|thigh"): 23.7, leg("calf"): 45.43},
        "velocity": {leg("hip|thigh"): 30.1, leg("calf"): 15.7},
        "armature": {leg("hip|thigh"): 0.01, leg("calf"): 0.04},
        "action_scale": {leg("hip|thigh"): 0.25, leg("calf"): 0.2},
        "soft_limits": {leg("calf"): (-2.5, -1.0)},
        "reset_range": (0.6, 1.4),
        "base_height_target": 0.287,
        "spawn_height": 0.3,
        "provenance": {"stiffness": Provenance(origin="suggested", reason="effort at 0.5 rad")},
    }
    return RobotSpec(**(given | changes))


def wheeled(**changes):
    """Return the spec of a quadruped whose calf joints have no stiffness, like wheels."""
    rolling = {
        "stiffness": {".*_(hip|thigh)_joint": 20.0, ".*_calf_joint": 0.0},
        "action_scale": {".*_(hip|thigh)_joint": 0.25, ".*_calf_joint": 5.0},
        "provenance": {"action_scale": Provenance(origin="suggested", reason="a share")},
    }
    return quadruped(**(rolling | changes))


def wheels_of(spec):
    """Return the joints of a `wheeled` robot with velocity targets, and the others."""
    return (
        tuple(joint for joint in spec.joint_order if "calf" in joint),
        tuple(joint for joint in spec.joint_order if "calf" not in joint),
    )


def of(spec, **value):
    """Return a value for each joint of `quadruped`: calf for calf joints, else other."""
    calf, other = value["calf"], value["other"]
    return {joint: calf if "calf" in joint else other for joint in spec.joint_order}


def plain_robot(joints, **changes):
    """Return a spec without legs, with different values for all joints."""
    numbers = {
        name: {joint: 0.5 + place + shift / 8 for place, joint in enumerate(joints)}
        for shift, name in enumerate(("stiffness", "damping", "effort", "armature"))
    }
    given = {
        "name": "arm",
        "urdf": "robot.urdf",
        "mjcf": "robot.xml",
        "floating": False,
        "joint_order": tuple(joints),
        "base": "base",
        "default_pose": dict.fromkeys(joints, 0.1),
        "velocity": {},
        "action_scale": dict.fromkeys(joints, 0.25),
        "soft_limits": {},
        **numbers,
    }
    return RobotSpec(**(given | changes))


HOSTILE = (
    'a"; import os #',
    "b'''\n\"\"\"\nraise SystemExit(1)",
    "c\\",
    "d\u202e\u2028{x}",
    "\u5173\u8282",
    "class",
    "1st-joint.2",
    "e" * 90,
)
"""Names that try to inject code."""


def hostile_robot():
    """Return a spec in which all names and texts try to inject code."""
    name = "x\"\"\"\nimport os\n'''\\"
    spec = plain_robot(
        HOSTILE,
        name=name,
        urdf='{robot}".urdf',
        mjcf="it's\\\"robot.xml",
        base=HOSTILE[0],
        feet=(HOSTILE[1] + "_foot", HOSTILE[2] + "_foot"),
        floating=True,
        penalized_contacts=HOSTILE[3:],
        termination_contacts=(HOSTILE[0],),
        spawn_height=0.5,
        base_height_target=0.45,
    )
    reasons = {
        field: Provenance(origin="suggested", reason=f"{name}\nraise SystemExit(2)\r\x0cx = 1")
        for field in ("stiffness", "default_pose", "spawn_height", "armature", "action_scale")
    }
    return RobotSpec(**(vars(spec) | {"provenance": reasons}))


def in_usd(name):
    """Return the name that the USD importer makes of a name."""
    plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
    plain = re.sub(r"^[0-9]", "_", plain)
    return f"a{plain}" if plain.startswith("_") else plain


def config_text(framework, robot):
    """Return the configuration of a robot."""
    return next(iter(config_files(framework, robot).values()))


class Strict:
    """A namespace that rejects new attributes."""

    def __init__(self, **fields):
        vars(self).update(fields)

    def __setattr__(self, name, value):
        if name not in vars(self):
            raise AttributeError(f"no attribute {name}")
        vars(self)[name] = value


def refusing(title, *required, **defaults):
    """Return a class that accepts only these fields as keyword arguments."""

    def init(self, **given):
        unknown, missing = set(given) - {*required, *defaults}, set(required) - set(given)
        if unknown or missing:
            raise TypeError(f"{title}: unknown {unknown}, missing {missing}")
        vars(self).update(defaults | given)

    return type(title, (), {"__init__": init})


def recording(title, **nested):
    """Return a class that stores its keyword arguments.

    The real frameworks check the names of the fields (tests/frameworks, mjlab_probe.py).
    """

    def init(self, **given):
        vars(self).update(given)

    return type(title, (), {"__init__": init, **nested})


class Described:
    """A class of legged_gym's configuration whose subclasses can only set existing fields."""

    def __init_subclass__(cls):
        for name in vars(cls):
            if not name.startswith("__") and not hasattr(super(cls, cls), name):
                raise AttributeError(f"{cls.__qualname__} has no {name}")


def part(title, **fields):
    """Return a configuration class with these fields."""
    made = type(title, (), {})
    for name, value in fields.items():
        setattr(made, name, value)
    return type(title, (made, Described), {})


def module(name, **content):
    """Return a module with this content."""
    made = ModuleType(name)
    vars(made).update(content)
    return made


@pytest.fixture
def load(tmp_path, monkeypatch):
    """Return a function that executes a configuration with stub modules."""

    def run(framework, spec, stand_ins, **known):
        for name, stand_in in stand_ins.items():
            monkeypatch.setitem(sys.modules, name, stand_in)
        path = tmp_path / f"{framework}_config.py"
        path.write_text(config_text(framework, ConfigRobot(spec=spec, **known)), encoding="utf-8")
        located = importlib.util.spec_from_file_location("loaded_config", path)
        loaded = importlib.util.module_from_spec(located)
        located.loader.exec_module(loaded)
        return loaded

    return run


@pytest.fixture
def robots():
    """Return functions that make specs of robots."""
    return SimpleNamespace(
        quadruped=quadruped,
        wheeled=wheeled,
        wheels_of=wheels_of,
        plain=plain_robot,
        hostile=hostile_robot,
        of=of,
        HOSTILE=HOSTILE,
        in_usd=in_usd,
        bodies=("base", *(f"{leg}_{part}" for leg in LEGS for part in (*PARTS, "foot"))),
    )


@pytest.fixture
def stand_in():
    """Return functions that make stub modules."""
    return SimpleNamespace(
        module=module,
        refusing=refusing,
        recording=recording,
        part=part,
        Strict=Strict,
        Described=Described,
    )


@pytest.fixture(scope="session")
def bundled_xml():
    """Return the MJCF file of the bundled quadruped."""
    from terrainkit_robots.description import bundled

    return Path(bundled.__file__).parent / "quadruped" / "quadruped.xml"
