"""Run the code and the commands of the README, and of the pages on check-robot and onboard."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

import terrainkit as tk
from terrainkit_cli.main import main
from tests.robots import QUADRUPED

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()
CHECK_ROBOT = (ROOT / "docs/check_robot.md").read_text()
ONBOARDING = (ROOT / "docs/onboarding.md").read_text()


def blocks(text, language):
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def commands(text):
    lines = (shlex.split(line, comments=True) for line in text.splitlines())
    return [words[1:] for words in lines if words[:1] == ["terrainkit"]]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_readme_is_short_and_has_two_setup_commands_and_links_that_exist():
    (part,) = re.findall(r"<!-- set-up -->(.*?)<!-- /set-up -->", README, re.DOTALL)
    assert blocks(part, "sh") == [
        "pip install . && terrainkit generate --rows 10 --cols 10 -o map.npz\n",
        'pip install -e ".[dev]" && python -m pytest\n',
    ]
    assert len(README.splitlines()) <= 150
    links = re.findall(r"\]\((?!http)([^)#]+)", README)
    assert [each for each in links if not (ROOT / each).exists()] == []


@pytest.mark.usefixtures("healthy_robots")
def test_readme_python_runs():
    terrain, robots = blocks(README, "python")
    names = {}
    exec(terrain, names)
    assert names["m"].config.rows == 6
    assert len(names["start"].levels) == len(names["levels"]) == 4096
    assert Path("map.xml").exists()
    exec(robots, {})
    assert Path("my_robot/robot.toml").exists()


def test_perception_page_python_runs():
    names = {}
    exec("".join(blocks((ROOT / "docs/perception.md").read_text(), "python")), names)
    assert names["heights"].shape == names["ceilings"].shape == (40, 187)
    assert names["depth"].shape == (40, 36, 64)
    assert names["occupied"].shape == (40, 17, 11, 11)
    assert 0.04 < np.isnan(names["measured"]).mean() < 0.3


@pytest.mark.usefixtures("healthy_robots")
def test_readme_commands_run():
    config = tk.MapConfig(rows=4, cols=10, patch_size=(8.0, 6.0), border=1.0)
    tk.generate(config).save("map.npz")
    terrain, robots = blocks(README.partition("## Generate terrain")[2], "sh")[:2]
    for words in [*commands(terrain), *commands(robots)]:
        expected = 1 if words[0] == "feasibility" else 0  # some patches are too hard
        assert main(words) == expected, words


@pytest.fixture
def my_robot():
    """Write the robot of the example: two numbers exchanged, and a 2 instead of a 1."""
    text = QUADRUPED.read_text()
    limits = 'lower="-2.7227" upper="-0.83776"', 'lower="-0.83776" upper="-2.7227"'
    for old, new in (limits, ('axis xyz="0 1 0"', 'axis xyz="0 2 0"')):
        assert old in text
        text = text.replace(old, new, 1)
    Path("my_robot.urdf").write_text(text)
    Path("my_robot.xacro").write_text(QUADRUPED.read_text())
    return text


@pytest.mark.usefixtures("my_robot")
def test_check_robot_page_commands_run():
    lines = [words for words in commands(blocks(CHECK_ROBOT, "sh")[0]) if words[0] != "view"]
    words = [["my_robot.urdf" if "*" in word else word for word in line] for line in lines]
    assert [main(each) for each in words] == [0, 1, 0, 1, 0]
    assert Path("robots.sarif").exists()


@pytest.mark.usefixtures("my_robot")
def test_check_robot_examples_match_output(capsys):
    assert main(["check-robot", "my_robot.urdf"]) == 1
    printed = capsys.readouterr().out
    for page in (README, CHECK_ROBOT):
        (example,) = blocks(page, "text")
        for shown in example.split("  ...\n"):
            assert shown in printed


def test_check_robot_page_suppressions_work(my_robot, capsys):
    (comment,), (settings,) = blocks(CHECK_ROBOT, "xml"), blocks(CHECK_ROBOT, "toml")
    asked = ["check-robot", "my_robot.urdf", "--select", "JNT005"]
    assert main([*asked, "--strict"]) == 1
    Path("my_robot.urdf").write_text(my_robot.replace('<axis xyz="0 2 0"/>\n', comment))
    assert main([*asked, "--strict"]) == 0
    assert "the parser normalizes it" in capsys.readouterr().out
    Path("my_robot.urdf").write_text(my_robot)
    Path("pyproject.toml").write_text(settings)
    assert main([*asked, "--strict"]) == 0
    assert "our parser normalizes axes" in capsys.readouterr().out


@pytest.fixture
def healthy_robots():
    """Write the robot files of the examples; each is the bundled quadruped."""
    for name in ("my_robot.urdf", "go2.urdf"):
        Path(name).write_text(QUADRUPED.read_text())
    Path("go2.xml").write_text(QUADRUPED.with_suffix(".xml").read_text())


@pytest.mark.usefixtures("healthy_robots")
def test_onboarding_page_commands_run(capsys):
    for words in commands(blocks(ONBOARDING, "sh")[0]):
        words += ["--no-pictures"] if words[0] == "onboard" else []
        assert main(words) == 0, words
    assert sorted(path.name for path in Path("quadruped").glob("*_config.py")) == [
        "legged_gym_config.py",
        "mjlab_config.py",
    ]
    assert "yes: 5 s with the gains of robot.toml" in capsys.readouterr().out


@pytest.mark.usefixtures("healthy_robots")
def test_onboarding_page_example_matches_output(capsys):
    main(["onboard", "my_robot.urdf", "-o", "my_robot"])
    printed = [line.split() for line in capsys.readouterr().out.splitlines()]
    for line in blocks(ONBOARDING, "text")[0].splitlines():
        # Rounding errors and the availability of pictures depend on the machine.
        first = line.split()[0]
        same = [words for words in printed if words[:1] == [first]]
        assert same
        if first not in ("compared", "pictures"):
            assert line.split() in same
