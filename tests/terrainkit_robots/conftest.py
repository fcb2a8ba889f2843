"""Fixtures for the tests of terrainkit_robots."""

import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import mujoco
import pytest

import terrainkit_robots
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled as bundled_robots
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.onboarding.frameworks.frameworks import framework_names
from terrainkit_robots.onboarding.onboard_options import OnboardOptions
from terrainkit_robots.onboarding.pipeline import onboard
from terrainkit_robots.onboarding.result import OnboardResult
from terrainkit_robots.simulation.standing import StandResult
from terrainkit_robots.spec.robot_arrays import SPEC_FILE, Robot
from terrainkit_robots.spec.robot_spec import RobotSpec

ROBOTS = Path(__file__).with_name("robots")
"""Folder of the robots of the tests."""


@pytest.fixture(scope="session")
def robot_file() -> Callable[[str], Path]:
    """Return the path of a robot file by its name, such as `quadruped.xml` or `tilted.urdf`."""

    def find(name: str) -> Path:
        own = ROBOTS / name
        return own if own.exists() else bundled_robots.urdf_path(own.stem).with_name(name)

    return find


@pytest.fixture(scope="session")
def quadruped() -> Robot:
    return Robot.load(bundled_robots.urdf_path("quadruped").parent)


@pytest.fixture
def quadruped_of_feet(quadruped, tmp_path) -> Robot:
    """Return the quadruped, in a folder of its own, with feet that alone collide."""
    mjspec = mujoco.MjSpec.from_file(str(quadruped.mjcf))
    for geom in mjspec.geoms:
        if geom.parent.name not in quadruped.spec.feet:
            geom.contype = geom.conaffinity = 0
    (tmp_path / quadruped.mjcf.name).write_text(mjspec.to_xml())
    (tmp_path / SPEC_FILE).write_text(quadruped.spec.to_toml())
    return Robot.load(tmp_path)


@pytest.fixture(scope="session")
def biped() -> Robot:
    return Robot.load(bundled_robots.urdf_path("biped").parent)


@pytest.fixture(scope="session")
def held_calves(quadruped: Robot, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a quadruped whose calf joints have no action."""
    folder = tmp_path_factory.mktemp("held") / "held_calves"
    shutil.copytree(quadruped.folder, folder, ignore=shutil.ignore_patterns("trained", "tasks"))
    scale = {".*_(hip|thigh)_joint": 0.25, ".*_calf_joint": 0.0}
    (folder / SPEC_FILE).write_text(replace(quadruped.spec, action_scale=scale).to_toml())
    return folder


@pytest.fixture(scope="session")
def onboarded(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Path], OnboardResult]:
    """Onboard a legged robot once per test run, with all framework configurations."""

    @cache
    def run(file: Path) -> OnboardResult:
        # LeggedGym-Ex has a go2 and a g1.
        name = "" if "bundled" in file.parts else f"my_{file.stem.lower()}"
        options = OnboardOptions(
            name=name, frameworks=framework_names(), unsafe_fixes=True, render_images=False
        )
        return onboard(file, tmp_path_factory.mktemp("onboarded") / "robot", options)

    return run


@pytest.fixture(scope="session")
def sliding_shanks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the URDF of a quadruped with prismatic knee joints."""
    text, count = re.subn(
        r'(<joint name="\w\w_calf_joint" type=)"revolute"(.*?)'
        r'<axis xyz="0 1 0"/>(\s*)<limit [^>]*/>',
        r'\1"prismatic"\2<axis xyz="0 0 1"/>\3'
        '<limit lower="-0.05" upper="0.1" effort="500" velocity="2"/>',
        bundled_robots.urdf_path("quadruped").read_text(),
        flags=re.DOTALL,
    )
    assert count == 4
    path = tmp_path_factory.mktemp("sliding") / "robot.urdf"
    path.write_text(text)
    return path


@pytest.fixture
def stood() -> StandResult:
    """Return the result of a passed standing test of a quadruped."""
    return StandResult(
        tilt=0.01,
        max_tilt=0.7,
        height=0.3,
        height_loss=0.02,
        drift=0.03,
        leg_length=0.4,
        other_contacts=(),
        lifted_feet=(),
        saturation=0.2,
        saturated_joint="knee",
        joint_error=0.05,
        diverged=False,
        seconds=5.0,
    )


BUNDLED = Path(terrainkit_robots.__file__).parent / "description/bundled"


@dataclass(frozen=True)
class Gain:
    """The attributes of a gain that derive_spec uses."""

    stiffness: float = 40.0
    damping: float = 1.0
    armature: float = 0.0
    reason: str = "for a test"
    declared: bool = False


@pytest.fixture
def bundled():
    """Return a function that loads a bundled robot with texts replaced."""

    def read(name, *replace, tmp_path=None, spec=None):
        path = BUNDLED / Path(name).stem / name
        if replace:
            text = path.read_text(encoding="utf-8")
            for old, new in replace:
                assert old in text
                text = text.replace(old, new)
            path = tmp_path / name
            path.write_text(text, encoding="utf-8")
        return Facts(load_robot(path), spec=spec)

    return read


@pytest.fixture
def robot(tmp_path):
    """Return a function that loads a robot from a text."""

    def read(text, spec=None):
        path = tmp_path / ("robot.xml" if "<mujoco" in text else "robot.urdf")
        path.write_text(text, encoding="utf-8")
        return Facts(load_robot(path), spec=spec)

    return read


@pytest.fixture
def gains():
    """Return a function that makes gains for each actuated joint of a robot."""

    def make(facts, **changed):
        return {joint.name: Gain(**changed) for joint in facts.actuated}

    return make


def values(**changed):
    """Return the fields of a small spec."""
    table = {"a": 1.0, "b": 2.0}
    names = ("default_pose", "stiffness", "damping", "effort", "velocity", "armature")
    return {
        "name": "robot",
        "urdf": "robot.urdf",
        "mjcf": "robot.xml",
        "floating": True,
        "joint_order": ("a", "b"),
        "base": "trunk",
        **dict.fromkeys((*names, "action_scale"), table),
        "soft_limits": {"a": (-1.0, 1.0)},
        **changed,
    }


@pytest.fixture
def spec():
    """Return a function that makes a small spec with changed values."""
    return lambda **changed: RobotSpec(**values(**changed))
