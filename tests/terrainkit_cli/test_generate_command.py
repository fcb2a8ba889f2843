import dataclasses
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import terrainkit as tk

CONFIG = """
rows = 3
cols = 2
patch_size = [8.0, 4.0]
border = 2.0
seed = 5

[[terrains]]
terrain = "stairs"
step_height = [0.05, 0.1]

[[terrains]]
terrain = "gap"
name = "moat"
width = 0.3
"""


def test_generate_writes_map_and_prints_next_commands(terrainkit_process, tmp_path):
    run = terrainkit_process("generate", "--rows", 3, "--cols", 10, "-o", "map.npz")
    assert run.returncode == 0
    assert run.stderr == ""
    assert "wrote map.npz: 3 x 10 patches of 8 m x 8 m" in run.stdout
    assert "terrainkit preview map.npz" in run.stdout
    assert tk.TerrainMap.load(tmp_path / "map.npz").config == tk.MapConfig(rows=3)


def test_generate_prints_next_commands_for_maps_only(terrainkit):
    run = terrainkit("generate", "--rows", 1, "--terrain", "flat", "--cols", 1, "-o", "map.stl")
    assert run.returncode == 0
    assert "next:" not in run.stdout


def test_generate_options_set_the_config(terrainkit, tmp_path):
    terrainkit(
        *("generate", "-o", "a.npz", "--rows", 2, "--cols", 3, "--patch-size", 8, 4, "--cell", 0.2),
        *("--border", 2, "--terrain", "pit", "--set", "depth=0.1:0.6,side=2", "--seed", 9),
        *("--centered", "--slope-threshold", "none", "--spawn-radius", 0.3, "--restitution", 0.5),
        *("--difficulty-range", 0.2, 0.8, "--static-friction", 0.7, "--dynamic-friction", 0.6),
    )
    assert tk.TerrainMap.load(tmp_path / "a.npz").config == tk.MapConfig(
        rows=2,
        cols=3,
        patch_size=(8.0, 4.0),
        cell=0.2,
        border=2.0,
        terrains=(tk.SubTerrain(terrain="pit", parameters={"depth": (0.1, 0.6), "side": 2}),),
        seed=9,
        centered=True,
        slope_threshold=None,
        spawn_radius=0.3,
        restitution=0.5,
        difficulty_range=(0.2, 0.8),
        static_friction=0.7,
        dynamic_friction=0.6,
    )


def test_generate_jobs_give_same_bytes(terrainkit, tmp_path):
    for name, jobs in (("one.npz", 1), ("two.npz", 2)):
        run = terrainkit("generate", "-o", name, "--rows", 3, "--seed", 4, "--jobs", jobs)
        assert run.returncode == 0
        assert run.stderr == ""
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()


@pytest.mark.parametrize("jobs", [0, -1, 62])
def test_generate_rejects_invalid_jobs(terrainkit, jobs):
    run = terrainkit("generate", "-o", "a.npz", "--jobs", jobs)
    assert run.returncode == 2
    assert f"--jobs: got {jobs}; expected an integer from 1 to 61; see" in run.stderr


def test_generate_mode_selected(terrainkit, tmp_path):
    terrainkit(
        *("generate", "-o", "a.npz", "--rows", 2, "--cols", 2, "--border", 0),
        *("--mode", "selected", "--terrain", "pyramid_slope", "--set", "grade=0.25,inverted=true"),
    )
    terrain_map = tk.TerrainMap.load(tmp_path / "a.npz")
    # Platform 3 m in 8 m: 25 cells of 0.1 m down at a grade of 0.25.
    assert terrain_map.env_origins[..., 2] == pytest.approx(-0.625)


def test_generate_options_override_config_file(terrainkit, tmp_path):
    (tmp_path / "my.toml").write_text(CONFIG)
    terrainkit("generate", "-o", "a.npz", "--config", "my.toml", "--rows", 4)
    terrain_map = tk.TerrainMap.load(tmp_path / "a.npz")
    assert terrain_map.config.rows == 4
    assert terrain_map.config.seed == 5
    assert terrain_map.terrain_names == ("stairs", "moat")


def test_generate_flag_overrides_config_file(terrainkit, tmp_path):
    (tmp_path / "my.toml").write_text(f"centered = true\n{CONFIG}")
    terrainkit("generate", "-o", "a.npz", "--config=my.toml")
    terrainkit("generate", "-o", "b.npz", "--config", "my.toml", "--no-centered")
    centered = [tk.TerrainMap.load(tmp_path / name).config.centered for name in ("a.npz", "b.npz")]
    assert centered == [True, False]


def test_generate_from_map_config_gives_same_bytes(terrainkit, tmp_path, small_map):
    (tmp_path / "again.toml").write_text(str(np.load(tmp_path / small_map)["config"]))
    terrainkit("generate", "-o", "again.npz", "--config", "again.toml")
    assert (tmp_path / small_map).read_bytes() == (tmp_path / "again.npz").read_bytes()


def test_generate_config_accepts_a_map(terrainkit, tmp_path, small_map):
    terrainkit("generate", "-o", "other.npz", "--config", small_map, "--seed", 8)
    config = tk.TerrainMap.load(tmp_path / small_map).config
    other = tk.TerrainMap.load(tmp_path / "other.npz").config
    assert other == dataclasses.replace(config, seed=8)


def test_generate_suffix_may_be_in_upper_case(terrainkit, tmp_path):
    run = terrainkit("generate", "-o", "a.NPZ", "--rows", 1, "--seed", 4)
    assert "terrainkit preview a.NPZ" in run.stdout
    assert terrainkit("generate", "-o", "b.npz", "--config", "a.NPZ").returncode == 0
    assert (tmp_path / "a.NPZ").read_bytes() == (tmp_path / "b.npz").read_bytes()


WIDE_CELLS = ("--rows", 2, "--cell", 1, "--terrain", "pyramid_stairs")


def test_generate_warns_of_coarse_cells(terrainkit):
    run = terrainkit("generate", "-o", "a.npz", *WIDE_CELLS)
    assert run.returncode == 0
    assert (
        "pyramid_stairs.step_width on 20 patches; the map records the realized values" in run.stderr
    )
    assert run.stderr.count("\n") == 1


def test_generate_removes_files_after_signal(tmp_path):
    command = [sys.executable, "-m", "terrainkit_cli.main", "generate", "-o", "a.npz"]
    command += ["--rows", "40", "--cols", "40"]
    run = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL)
    while run.poll() is None and not list(tmp_path.iterdir()):
        time.sleep(0.01)  # until it writes
    run.terminate()
    assert run.wait(timeout=60) == 143
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("line", ["rowz = 3", "rows = 'three'", "preset = 'moon'", "rows ="])
def test_generate_invalid_config_is_one_line(terrainkit, tmp_path, line):
    (tmp_path / "my.toml").write_text(line)
    run = terrainkit("generate", "-o", "a.npz", "--config", "my.toml")
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1
    assert "my.toml" in run.stderr
    assert not (tmp_path / "a.npz").exists()


def test_generate_keeps_existing_file(terrainkit, tmp_path):
    (tmp_path / "a.npz").write_text("mine")
    run = terrainkit("generate", "-o", "a.npz", "--rows", 1)
    assert run.returncode == 2
    assert "a.npz exists" in run.stderr
    assert (tmp_path / "a.npz").read_text() == "mine"
    assert terrainkit("generate", "-o", "a.npz", "--rows", 1, "--overwrite").returncode == 0
    assert tk.TerrainMap.load(tmp_path / "a.npz").config.rows == 1


def test_generate_warns_of_preset_without_column(terrainkit):
    run = terrainkit("generate", "-o", "a.npz", "--rows", 1, "--cols", 2, "--preset", "stairs")
    assert run.returncode == 0
    assert run.stderr == (
        "terrainkit: warning: cols: got 2, too few for 3 sub-terrains at these proportions: "
        "no column for pyramid_stairs_inverted (preset stairs)\n"
    )


def test_generate_full_disk_is_one_line(tmp_path):
    limit = "ulimit -f 64; trap '' XFSZ; exec "  # 64 KiB, and an error instead of a signal
    command = f"{sys.executable} -m terrainkit_cli.main generate -o a.npz --rows 1"
    run = subprocess.run(
        ["bash", "-c", limit + command],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert run.returncode == 2
    assert run.stderr == "terrainkit: error: cannot write a.npz: File too large\n"
    assert list(tmp_path.iterdir()) == []


def test_generate_progress_bar_needs_terminal(tmp_path):
    import pty

    script = (
        "import sys; from terrainkit_cli import main, render; render.BAR_DELAY = 0.0;"
        "sys.exit(main.main(sys.argv[1:]))"
    )
    command = [sys.executable, "-c", script, "generate", "-o", "a.npz", "--rows", "3"]
    ours, theirs = pty.openpty()
    run = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=theirs, text=True)
    os.close(theirs)
    shown = b""
    try:
        while chunk := os.read(ours, 4096):
            shown += chunk
    except OSError:
        pass  # Linux ends a pseudo-terminal with an error, not with an empty read
    result, _ = run.communicate()
    assert b"patches" in shown
    assert result.startswith("wrote a.npz")


def test_generate_quotes_paths_in_commands(terrainkit):
    run = terrainkit("generate", "-o", "my map.npz", "--rows", 1)
    assert "terrainkit preview 'my map.npz' -o" in run.stdout


def test_generate_warns_about_cliffs(terrainkit):
    run = terrainkit("generate", "-o", "a.npz", "--preset", "stairs", "--cols", 3, "--border", 1)
    assert run.returncode == 0
    assert "cliffs between patches: " in run.stderr
    assert "1.61 m between stairs (9, 0) and pyramid_stairs (9, 1)" in run.stderr


def test_generate_avoids_slow_imports(tmp_path):
    code = (
        "import sys; from terrainkit_cli.main import main;"
        f"main(['generate', '-o', {str(Path(tmp_path) / 'a.npz')!r}, '--rows', '1']);"
        "heavy = {'trimesh', 'mujoco', 'torch', 'scipy', 'cv2', 'rich', 'asyncio'};"
        "print(sorted(heavy & set(sys.modules)))"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True
    )
    assert run.stdout.endswith("[]\n")
