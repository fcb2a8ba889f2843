import ast
import subprocess
import sys
from dataclasses import replace

import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.onboarding import frameworks as package
from terrainkit_robots.onboarding.frameworks import frameworks
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.frameworks import (
    check_framework,
    config_files,
    framework_names,
    robot_config_files,
)
from tests.robots import QUADRUPED

LEGGED = ("legged_gym", "leggedgym_ex")


def config_text(framework, robot):
    """Return the configuration of a robot."""
    return next(iter(config_files(framework, robot).values()))


def test_framework_names_include_added_module(tmp_path, monkeypatch, robots):
    (tmp_path / "brand_new.py").write_text(
        "LEGGED_ONLY = False\ndef config_text(robot):\n    return f'# {robot.title}'\n"
    )
    (tmp_path / "not_a_framework.py").write_text("def config_text(robot):\n    return ''\n")
    monkeypatch.setattr(package, "__path__", [*package.__path__, str(tmp_path)])
    frameworks.framework_names.cache_clear()
    try:
        assert set(framework_names()) - {"brand_new"} == {*LEGGED, "isaaclab", "mjlab", "genesis"}
        assert config_text("brand_new", ConfigRobot(spec=robots.quadruped())) == "# quad 4"
        with pytest.raises(ConfigError, match="other frameworks: brand_new, genesis"):
            config_text("legged_gym", ConfigRobot(spec=robots.plain(())))
    finally:
        frameworks.framework_names.cache_clear()


def test_framework_names_are_sorted(robots):
    assert framework_names() == ("genesis", "isaaclab", "legged_gym", "leggedgym_ex", "mjlab")
    assert set(config_files("mjlab", ConfigRobot(spec=robots.quadruped()))) == {"mjlab_config.py"}
    with pytest.raises(ConfigError, match="got 'gazebo'; expected: genesis, isaaclab, "):
        config_text("gazebo", None)
    with pytest.raises(ConfigError, match="framework: got"):
        check_framework("../../evil")


@pytest.mark.parametrize("framework", LEGGED)
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"feet": ()}, "requires a legged robot; other frameworks: genesis, isaaclab, mjlab$"),
        ({"joint_order": ()}, "has no legs"),
        ({"floating": False}, "the base of quad 4 is fixed"),
        ({"spawn_height": None}, "has no spawn_height or base_height_target"),
        ({"stiffness": {".*_hip_joint": 1.0}}, "matched by no key of stiffness"),
        ({"feet": ("FL_paw", "FR_paw")}, "got unknown bodies 'FL_paw', 'FR_paw'; expected 'base'"),
        ({"feet": ("FL_hip", "RR_calf")}, "no substring is in all of 'FL_hip', 'RR_calf'"),
    ],
)
def test_config_text_rejects_robot_in_one_line(robots, framework, changes, message):
    with pytest.raises(ConfigError, match=message) as caught:
        config_text(framework, ConfigRobot(spec=robots.quadruped(**changes), bodies=robots.bodies))
    assert "\n" not in str(caught.value)


def test_isaaclab_rejects_robot_without_joints(robots):
    with pytest.raises(ConfigError, match="no joints"):
        config_text("isaaclab", ConfigRobot(spec=robots.plain(())))


@pytest.mark.parametrize("framework", framework_names())
def test_config_text_prevents_code_injection(robots, framework):
    """A robot with hostile names yields the same statements as a harmless one."""
    hostile = config_text(framework, ConfigRobot(spec=robots.hostile()))
    plain = robots.plain(
        tuple(f"joint_{number}" for number in range(len(robots.HOSTILE))),
        floating=True,
        feet=("l_foot", "r_foot"),
        penalized_contacts=("p", "q"),
        termination_contacts=("t",),
        spawn_height=0.5,
        base_height_target=0.45,
    )
    harmless = config_text(framework, ConfigRobot(spec=plain))
    assert _shape(hostile) == _shape(harmless)


def _shape(text):
    kept = (ast.stmt, ast.alias, ast.Attribute, ast.arg, ast.keyword, ast.Call)
    nodes = [node for node in ast.walk(ast.parse(text)) if isinstance(node, kept)]
    return [
        (type(node), getattr(node, "attr", None) or getattr(node, "arg", None)) for node in nodes
    ]


@pytest.mark.parametrize("framework", framework_names())
def test_config_text_is_formatted_and_deterministic(robots, framework, tmp_path):
    long = {"name": "a very long name " * 8, "urdf": "u" * 70 + ".urdf", "mjcf": "m" * 70 + ".xml"}
    one_joint = robots.plain(
        ("j" * 84,),
        floating=True,
        feet=("f" * 80 + "_foot",),
        base="b" * 66,
        spawn_height=1.0,
        base_height_target=1.0,
    )
    specs = {
        "plain": robots.quadruped(),
        "wheeled": robots.wheeled(),
        "long": robots.quadruped(**long),
        "hostile": robots.hostile(),
        "one": one_joint,
    }
    if framework not in LEGGED:
        specs["arm"] = robots.plain(("joint1", "joint10"))
    if framework in ("mjlab", "genesis"):
        specs["none"] = robots.plain(())
    for name, spec in specs.items():
        text = config_text(framework, ConfigRobot(spec=spec))
        assert text == config_text(framework, ConfigRobot(spec=spec))
        assert text.isascii() or name == "hostile"
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
    ruff = [sys.executable, "-m", "ruff"]
    for words in (["format", "--diff"], ["check"]):
        done = subprocess.run(
            [*ruff, *words, "--isolated", "--no-cache", tmp_path], capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout + done.stderr


def test_config_text_soft_limit_factor(robots):
    ranges = {f"{leg}_calf_joint": (-2.75, -0.75) for leg in ("FL", "FR", "RL", "RR")}
    spec = robots.quadruped()
    text = config_text("mjlab", ConfigRobot(spec=spec, limits=ranges))
    assert "soft_joint_pos_limit_factor=0.75," in text
    text = config_text("mjlab", ConfigRobot(spec=spec))
    assert "soft_joint_pos_limit_factor=0.9," in text


@pytest.mark.parametrize("framework", LEGGED)
def test_legged_frameworks_reject_unactuated_joints(robots, framework):
    spec = robots.quadruped()
    with pytest.raises(ConfigError, match=f"tail_joint of .* have no actuator, but {framework}"):
        config_text(framework, ConfigRobot(spec=spec, passive_joints=["tail_joint"]))
    fewer = replace(spec, joint_order=spec.joint_order[:-1])
    with pytest.raises(ConfigError, match=f"{spec.joint_order[-1]} of .* have no actuator"):
        robot_config_files(framework, Facts(load_robot(QUADRUPED)), fewer)


def test_robot_config_files_uses_bodies_and_limits(robots):
    """The range of the calf joints is 1.88 rad; the soft limits of the spec span 1.5 rad: 0.796."""
    facts, spec = Facts(load_robot(QUADRUPED)), robots.quadruped()
    files = robot_config_files("legged_gym", facts, spec)
    assert "soft_dof_pos_limit = 0.8\n" in files["legged_gym_config.py"]
    ranges = {joint.name: joint.range for joint in facts.model.joints if joint.moves}
    known = ConfigRobot(spec=spec, bodies=robots.bodies, limits=ranges)
    assert files == config_files("legged_gym", known)


@pytest.mark.parametrize("framework", LEGGED)
def test_legged_configs_parse_with_python_3_8(robots, framework):
    ast.parse(config_text(framework, ConfigRobot(spec=robots.hostile())), feature_version=(3, 8))
