import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

CLASS = """
class MyCfg:
    class env:
        num_envs = 4
        env_spacing = 3.0
        send_timeouts = True
    class terrain:
        mesh_type = "trimesh"
        num_rows = 3
"""


def test_import_config(terrainkit, rejected, tmp_path):
    (tmp_path / "my_config.py").write_text(CLASS)
    command = "import-config my_config.py -o my_task"
    run = terrainkit(*command.split())
    assert (run.returncode, run.stderr) == (0, "")
    assert run.stdout.splitlines() == [
        "MyCfg: 3 of 5 settings taken; 1 make no difference here; 1 not taken:",
        "  env.env_spacing: each robot has a world of its own",
        "wrote my_task: task.toml, map.toml",
        "next: terrainkit train ROBOT --config my_task/task.toml --terrain my_task/map.toml",
    ]
    assert "my_task/task.toml exists; use another name, or --overwrite" in rejected(command)
    run = terrainkit(*command.split(), "--overwrite", "--robot", "quadruped", "--class", "MyCfg")
    assert "train my_task --config my_task/task.toml" in run.stdout
    assert sorted(file.name for file in (tmp_path / "my_task").iterdir()) == [
        "map.toml",
        "robot.toml",
        "task.toml",
    ]
    (tmp_path / "my_config.py").write_text("class A:\n class terrain: mesh_type = 'trimesh'\n")
    run = terrainkit("import-config", "my_config.py", "-o", "no_map")
    assert run.stdout.splitlines() == [
        "A: 1 of 1 settings taken; 0 make no difference here; 0 not taken",
        "wrote no_map: task.toml",
        "next: terrainkit train ROBOT --config no_map/task.toml",
    ]
    (tmp_path / "my_config.py").write_bytes(b"\xff")
    assert rejected("import-config my_config.py -o new").startswith("my_config.py: 'utf-8' codec")
    assert not (tmp_path / "new").exists()
