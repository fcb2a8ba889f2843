"""Every Python block of the README is run: on the real package where it is installed, else on a
stand-in that takes what the real one takes, and whose ground is then looked at."""

import re
import shlex
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import mujoco
import numpy as np
import pytest
import trimesh

import terrainkit as tk
from terrainkit import registry
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


def test_there_are_two_set_up_commands_and_nothing_else():
    (part,) = re.findall(r"<!-- set-up -->(.*?)<!-- /set-up -->", README, re.DOTALL)
    assert re.findall(r"```sh\n(.*?)\n```", part, re.DOTALL) == [
        "pip install . && terrainkit generate --rows 10 --cols 10 -o map.npz",
        'pip install -e ".[dev]" && python -m pytest',
    ]


def test_no_block_is_left_out():
    assert len(BLOCKS) == 8


def test_every_link_to_a_file_leads_there():
    root = Path(__file__).parent.parent
    for target in re.findall(r"\]\((?!http)([^)#]+)", README):
        assert (root / target).exists(), target


def test_terrainkit():
    names = {}
    exec(block("import terrainkit\n\nconfig"), names)
    assert names["m"].config.rows == 6
    assert len(names["start"].levels) == len(names["levels"]) == 4096
    assert Path("first.npz").exists()


def test_numpy(m):
    names = {}
    exec(block("import numpy"), names)
    assert names["name"] == "stepping_stones"
    assert m.height(names["spawn"][:2]) == pytest.approx(names["spawn"][2], abs=1e-3)
    assert names["x"][0] == pytest.approx(m.first_sample[0])


def test_mujoco(m):
    names = {}
    exec(block("import mujoco"), names)
    x, y, z = names["data"].qpos[:3]
    assert z - 0.1 == pytest.approx(m.height([x, y]), abs=0.01)  # the ball, 0.1 m, lies on it


def test_isaac_gym_trimesh(m):
    gym, gymapi = MagicMock(), SimpleNamespace(TriangleMeshParams=SimpleNamespace)
    exec(block("TriangleMeshParams"), {"m": m, "gym": gym, "sim": 0, "gymapi": gymapi})
    (_, vertices, triangles, params), _ = gym.add_triangle_mesh.call_args
    assert (vertices.dtype, triangles.dtype) == (np.float32, np.uint32)
    assert (vertices.ndim, triangles.ndim) == (1, 1)
    assert len(vertices) == 3 * params.nb_vertices
    assert len(triangles) == 3 * params.nb_triangles


def test_isaac_gym_heightfield(m):
    gym, params = MagicMock(), SimpleNamespace(transform=SimpleNamespace(p=SimpleNamespace()))
    gymapi = SimpleNamespace(HeightFieldParams=lambda: params)
    exec(block("HeightFieldParams"), {"m": m, "gym": gym, "sim": 0, "gymapi": gymapi})
    (_, buffer, params), _ = gym.add_heightfield.call_args
    # "Column-major order", say its docs: sample (row, column) is at column * nbRows + row.
    column, row = np.divmod(np.arange(0, len(buffer), 37), params.nbRows)
    x = params.transform.p.x + column * params.column_scale
    y = params.transform.p.y + row * params.row_scale
    found = buffer[::37] * params.vertical_scale
    assert found == pytest.approx(m.height(np.column_stack([x, y])), abs=0.0026)


def test_isaac_lab(m):
    names = {"m": m, "trimesh": trimesh}
    names |= dict.fromkeys(("TerrainGeneratorCfg", "TerrainImporterCfg"), SimpleNamespace)
    exec(block("class FromMap"), names)
    generator = names["terrain"].terrain_generator
    made = generator.class_type(cfg=generator, device="cpu")
    assert made.terrain_mesh.bounds[:, :2] == pytest.approx(np.array([m.grid.lower, m.grid.upper]))
    assert made.terrain_origins.shape == (4, 10, 3)


def test_genesis(m):
    gs, scene = MagicMock(), MagicMock()
    exec(block("gs.morphs.Terrain"), {"m": m, "gs": gs, "scene": scene})
    given = gs.morphs.Terrain.call_args.kwargs
    # Genesis puts height_field[i, j] at pos + (i, j) * horizontal_scale.
    x, y = np.array(given["pos"][:2]) + np.array([5, 9]) * given["horizontal_scale"]
    assert given["height_field"][5, 9] * given["vertical_scale"] == pytest.approx(m.height([x, y]))


# MuJoCo minds that a model attached without a prefix cannot be saved; mjlab does not save it.
@pytest.mark.filterwarnings("ignore:Attaching a spec with an empty prefix")
def test_mjlab(m):
    cfg = SimpleNamespace(scene=SimpleNamespace(), events={})
    names = {"m": m, "mujoco": mujoco, "cfg": cfg}
    names |= dict.fromkeys(("TerrainEntityCfg", "EventTermCfg"), SimpleNamespace)
    exec(block("spec_fn = ground"), names)
    spec = mujoco.MjSpec()  # mjlab's plane: a body and a geom called terrain
    spec.worldbody.add_body(name="terrain").add_geom(
        name="terrain", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 1]
    )
    cfg.scene.spec_fn(spec)
    model = spec.compile()
    assert model.body("terrain").geomnum[0] > 0
    assert mujoco.mjtGeom.mjGEOM_PLANE not in model.geom_type
    env = MagicMock()
    cfg.events["origins"].func(env, None)
    (origins,), _ = env.scene.terrain.configure_env_origins.call_args
    assert origins is m.env_origins


def test_every_terrain_is_in_the_table():
    for name in registry.names():
        assert f"[{name}](docs/terrains.md#{name})" in README, name


@pytest.mark.usefixtures("m")
def test_the_lines_of_the_command_line_run_one_after_the_other(tmp_path):
    (lines,) = re.findall(r"## From the command line\n.*?```sh\n(.*?)```", README, re.DOTALL)
    (config,) = re.findall(r"```toml\n(rows.*?)```", README, re.DOTALL)
    (tmp_path / "own.toml").write_text(config)
    Path("map.xml").unlink()
    for line in lines.splitlines():
        words = shlex.split(line, comments=True)
        assert words[0] == "terrainkit"
        assert main(words[1:]) == 0, line


def check_robot_lines():
    (part,) = re.findall(r"## Check a robot\n(.*?)\n## ", README, re.DOTALL)
    (lines,) = re.findall(r"```sh\n(.*?)```", part, re.DOTALL)
    return part, [shlex.split(line, comments=True) for line in lines.splitlines()]


@pytest.fixture
def my_robot():
    """Write the robot of the example: two numbers exchanged, and a 2 instead of a 1."""
    from terrainkit_robots.description import bundled

    path = bundled.find("quadruped")
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
def test_the_lines_that_check_a_robot_run():
    _, lines = check_robot_lines()
    codes = []
    for words in lines:
        words = [word for part in words for word in (["my_robot.urdf"] if "*" in part else [part])]
        assert words.pop(0) == "terrainkit"
        codes.append(main(words))
    assert codes == [0, 1, 0, 1, 0]
    assert Path("robots.sarif").exists()


@pytest.mark.usefixtures("my_robot")
def test_the_example_of_a_checked_robot_is_what_is_printed(capsys):
    part, _ = check_robot_lines()
    (example,) = re.findall(r"```text\n(.*?)```", part, re.DOTALL)
    assert main(["check-robot", "my_robot.urdf"]) == 1
    printed = capsys.readouterr().out
    for shown in example.split("  ...\n"):
        assert shown in printed


def test_the_comment_and_the_settings_of_the_example_ignore_what_they_say(my_robot, capsys):
    part, _ = check_robot_lines()
    (comment,) = re.findall(r"```xml\n(.*?)```", part, re.DOTALL)
    (settings,) = re.findall(r"```toml\n(.*?)```", part, re.DOTALL)
    asked = ["check-robot", "my_robot.urdf", "--select", "JNT005"]
    assert main([*asked, "--strict"]) == 1
    Path("my_robot.urdf").write_text(my_robot.replace('<axis xyz="0 2 0"/>\n', comment))
    assert main([*asked, "--strict"]) == 0
    assert "the reader divides" in capsys.readouterr().out
    Path("my_robot.urdf").write_text(my_robot)
    Path("pyproject.toml").write_text(settings)
    assert main([*asked, "--strict"]) == 0
    assert "our reader divides" in capsys.readouterr().out


def onboard_part():
    return README.partition("## Onboard a robot")[2].partition("\n## ")[0]


@pytest.fixture
def healthy_robots():
    """Write the robot files of the examples; each is the bundled quadruped."""
    from terrainkit_robots.description import bundled

    path = bundled.find("quadruped")
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
