"""Run the code and the commands of the README."""

import re
import shlex
from pathlib import Path

import pytest

import terrainkit as tk
from terrainkit.terrain import presets, registry
from terrainkit_cli.main import main

README = (Path(__file__).parent.parent / "README.md").read_text()
BLOCKS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


def block(words):
    (found,) = (text for text in BLOCKS if words in text)
    return found


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def m():
    terrain_map = tk.generate(tk.MapConfig(rows=4, cols=10, patch_size=(8.0, 6.0), border=1.0))
    terrain_map.save("map.npz")
    terrain_map.save("map.xml")
    return terrain_map


def test_readme_lists_all_presets():
    text = README.split("\nPresets: ")[1].split(";")[0]
    assert re.findall(r"`(\w+)`", text) == list(presets.preset_names())


def test_readme_has_two_setup_commands():
    (part,) = re.findall(r"<!-- set-up -->(.*?)<!-- /set-up -->", README, re.DOTALL)
    assert re.findall(r"```sh\n(.*?)\n```", part, re.DOTALL) == [
        "pip install . && terrainkit generate --rows 10 --cols 10 -o map.npz",
        'pip install -e ".[dev]" && python -m pytest',
    ]


def test_readme_all_blocks_are_tested():
    assert len(BLOCKS) == 3


def test_readme_links_exist():
    root = Path(__file__).parent.parent
    for target in re.findall(r"\]\((?!http)([^)#]+)", README):
        assert (root / target).exists(), target


def test_readme_first_block_runs():
    exec(block("terrain_map = terrainkit.generate"), {})
    assert Path("map.xml").exists()


def test_readme_terrain_block_runs():
    names = {}
    exec(block("import terrainkit\n\nconfig"), names)
    assert names["m"].config.rows == 6
    assert len(names["start"].levels) == len(names["levels"]) == 4096
    assert Path("first.npz").exists()


def test_readme_table_lists_every_terrain():
    for name in registry.terrain_names():
        assert f"[{name}](docs/terrains.md#{name})" in README, name


@pytest.mark.usefixtures("healthy_robots")
def test_readme_robot_block_runs():
    names = {}
    exec(block("from terrainkit_robots import"), names)
    assert names["model"].name == "quadruped"
    assert not [f for f in names["report"].findings if f.severity == "error"]
    assert Path("my_robot/robot.toml").exists()


@pytest.mark.usefixtures("m")
def test_readme_terrain_commands_run(tmp_path):
    (lines,) = re.findall(r"## Generate terrain\n.*?```sh\n(.*?)```", README, re.DOTALL)
    (config,) = re.findall(r"```toml\n(rows.*?)```", README, re.DOTALL)
    (tmp_path / "own.toml").write_text(config)
    Path("map.xml").unlink()
    for line in lines.splitlines():
        words = shlex.split(line, comments=True)
        assert words[0] == "terrainkit"
        if words[1] != "view":  # it runs until it is interrupted
            assert main(words[1:]) == 0, line


def check_robot_lines():
    (part,) = re.findall(r"## Check a robot\n(.*?)\n## ", README, re.DOTALL)
    (lines,) = re.findall(r"```sh\n(.*?)```", part, re.DOTALL)
    return part, [shlex.split(line, comments=True) for line in lines.splitlines()]


@pytest.fixture
def my_robot():
    """Write the robot of the example: two numbers exchanged, and a 2 instead of a 1."""
    from terrainkit_robots.description import bundled

    path = bundled.urdf_path("quadruped")
    assert path is not None
    text = path.read_text()
    limits = 'lower="-2.7227" upper="-0.83776"', 'lower="-0.83776" upper="-2.7227"'
    for old, new in (limits, ('axis xyz="0 1 0"', 'axis xyz="0 2 0"')):
        assert old in text
        text = text.replace(old, new, 1)
    Path("my_robot.urdf").write_text(text)
    Path("my_robot.xacro").write_text(path.read_text())
    return text


@pytest.mark.usefixtures("my_robot")
def test_readme_check_robot_commands_run():
    _, lines = check_robot_lines()
    codes = []
    for words in lines:
        words = [word for part in words for word in (["my_robot.urdf"] if "*" in part else [part])]
        assert words.pop(0) == "terrainkit"
        if words[0] != "view":  # it runs until it is interrupted
            codes.append(main(words))
    assert codes == [0, 1, 0, 1, 0]
    assert Path("robots.sarif").exists()


@pytest.mark.usefixtures("my_robot")
def test_readme_check_robot_output_is_current(capsys):
    part, _ = check_robot_lines()
    (example,) = re.findall(r"```text\n(.*?)```", part, re.DOTALL)
    assert main(["check-robot", "my_robot.urdf"]) == 1
    printed = capsys.readouterr().out
    for shown in example.split("  ...\n"):
        assert shown in printed


def test_readme_suppressions_work(my_robot, capsys):
    part, _ = check_robot_lines()
    (comment,) = re.findall(r"```xml\n(.*?)```", part, re.DOTALL)
    (settings,) = re.findall(r"```toml\n(.*?)```", part, re.DOTALL)
    asked = ["check-robot", "my_robot.urdf", "--select", "JNT005"]
    assert main([*asked, "--strict"]) == 1
    Path("my_robot.urdf").write_text(my_robot.replace('<axis xyz="0 2 0"/>\n', comment))
    assert main([*asked, "--strict"]) == 0
    assert "the parser normalizes it" in capsys.readouterr().out
    Path("my_robot.urdf").write_text(my_robot)
    Path("pyproject.toml").write_text(settings)
    assert main([*asked, "--strict"]) == 0
    assert "our parser normalizes axes" in capsys.readouterr().out


def onboard_part():
    return README.partition("## Onboard a robot")[2].partition("\n## ")[0]


@pytest.fixture
def healthy_robots():
    """Write the robot files of the examples; each is the bundled quadruped."""
    from terrainkit_robots.description import bundled

    path = bundled.urdf_path("quadruped")
    assert path is not None
    for name in ("my_robot.urdf", "go2.urdf"):
        Path(name).write_text(path.read_text())
    Path("go2.xml").write_text(path.with_suffix(".xml").read_text())


@pytest.mark.usefixtures("healthy_robots")
def test_onboard_commands_run(capsys):
    (lines,) = re.findall(r"```sh\n(.*?)```", onboard_part(), re.DOTALL)
    for line in lines.splitlines():
        words = shlex.split(line, comments=True)
        assert words.pop(0) == "terrainkit"
        words += ["--no-pictures"] if words[0] == "onboard" else []
        assert main(words) == 0, line
    assert sorted(path.name for path in Path("quadruped").glob("*_config.py")) == [
        "legged_gym_config.py",
        "mjlab_config.py",
    ]
    assert "yes: 5 s with the gains of robot.toml" in capsys.readouterr().out


@pytest.mark.usefixtures("healthy_robots")
def test_onboard_example_matches_output(capsys):
    (example,) = re.findall(r"```text\n(.*?)```", onboard_part(), re.DOTALL)
    main(["onboard", "my_robot.urdf", "-o", "my_robot"])
    printed = [line.split() for line in capsys.readouterr().out.splitlines()]
    for line in example.splitlines():
        # Rounding errors and the availability of pictures depend on the machine.
        first = line.split()[0]
        same = [words for words in printed if words[:1] == [first]]
        assert same
        if first not in ("compared", "pictures"):
            assert line.split() in same
