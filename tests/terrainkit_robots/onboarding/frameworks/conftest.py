"""Specs of robots, and stub modules of frameworks that reject unknown fields."""

import importlib.machinery
import importlib.util
import re
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.frameworks import config_files
from terrainkit_robots.spec.robot_spec import Provenance, RobotSpec
from tests.robots import QUADRUPED

LEGS = ("FL", "FR", "RL", "RR")
PARTS = ("hip", "thigh", "calf")
QUADRUPED_SPEC = RobotSpec.load(Path(__file__).with_name("quadruped.toml"))


def quadruped(**changes):
    """Return the spec of a quadruped, with values by pattern."""
    return replace(QUADRUPED_SPEC, **changes)


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


def of(spec, *, calf, other):
    """Return a value for each joint of `quadruped`."""
    return {joint: calf if "calf" in joint else other for joint in spec.joint_order}


def pose_of(spec):
    """Return the default pose of `quadruped`."""
    return {
        joint: -1.8 if "calf" in joint else 0.9 if "thigh" in joint else 0.0
        for joint in spec.joint_order
    }


def resolved(value, names):
    """Return values by name; each pattern must match, and each name at most one pattern."""
    if not isinstance(value, dict):
        return dict.fromkeys(names, value)
    found = {name: [p for p in value if re.fullmatch(p, name)] for name in names}
    assert {p for patterns in found.values() for p in patterns} == set(value)
    assert all(len(patterns) <= 1 for patterns in found.values())
    return {name: value[patterns[0]] for name, patterns in found.items() if patterns}


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
    return replace(spec, provenance=reasons)


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


class Recorder(type):
    """The type of classes that have nested recorders of any name."""

    def __getattr__(cls, name):
        if name.startswith("__"):
            raise AttributeError(name)
        setattr(cls, name, recorder(name))
        return vars(cls)[name]


def recorder(title):
    """Return a class that stores its keyword arguments.

    The real frameworks check the names of the fields (tests/frameworks, mjlab_probe.py).
    """
    return Recorder(title, (), {"__init__": lambda self, **given: vars(self).update(given)})


class Stub(ModuleType):
    """A module of a framework: content that is given, and recording classes of other names."""

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return sys.modules.get(f"{self.__name__}.{name}") or recorder(name)


class Stubs:
    """Importer of all modules of frameworks; those whose content is None are missing."""

    def __init__(self, content):
        self.content = content
        self.roots = {name.partition(".")[0] for name in content}

    def find_spec(self, name, *_):
        if name.partition(".")[0] not in self.roots or self.content.get(name, {}) is None:
            return None
        return importlib.machinery.ModuleSpec(name, self, is_package=True)

    def create_module(self, spec):
        made = Stub(spec.name)
        vars(made).update(self.content.get(spec.name, {}))
        return made

    def exec_module(self, module):
        """Do nothing: the module has its content."""


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


@pytest.fixture
def load(tmp_path, monkeypatch):
    """Return a function that executes a configuration with stubs of the modules of frameworks."""
    used = []

    def forget(stubs):
        for name in [each for each in sys.modules if each.partition(".")[0] in stubs.roots]:
            del sys.modules[name]

    def run(framework, spec, content, **known):
        path = tmp_path / f"{framework}_config.py"
        path.write_text(config_text(framework, ConfigRobot(spec=spec, **known)), encoding="utf-8")
        used.append(Stubs(content))
        forget(used[-1])
        monkeypatch.setattr(sys, "meta_path", [used[-1], *sys.meta_path])
        located = importlib.util.spec_from_file_location("loaded_config", path)
        loaded = importlib.util.module_from_spec(located)
        located.loader.exec_module(loaded)
        return loaded

    yield run
    for stubs in used:
        forget(stubs)


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
        pose_of=pose_of,
        resolved=resolved,
        HOSTILE=HOSTILE,
        in_usd=in_usd,
        bodies=("base", *(f"{leg}_{part}" for leg in LEGS for part in (*PARTS, "foot"))),
    )


@pytest.fixture
def stand_in():
    """Return what makes classes of frameworks."""
    return SimpleNamespace(recorder=recorder, part=part, Strict=Strict)


@pytest.fixture(scope="session")
def bundled_xml():
    """Return the MJCF file of the bundled quadruped."""
    return QUADRUPED.with_suffix(".xml")
