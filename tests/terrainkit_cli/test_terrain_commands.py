import dataclasses
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

import terrainkit as tk
from terrainkit.terrain import registry

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


def test_generate_jobs_give_same_bytes(terrainkit_process, tmp_path):
    for name, jobs in (("one.npz", 1), ("two.npz", 2)):
        run = terrainkit_process("generate", "-o", name, "--rows", 3, "--seed", 4, "--jobs", jobs)
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


def test_list_names_every_terrain(terrainkit):
    lines = terrainkit("list").stdout.splitlines()
    for name in registry.terrain_names():
        assert any(line.startswith(f"{name} ") for line in lines)


def test_list_terrain_shows_parameters(terrainkit):
    lines = [line.split() for line in terrainkit("list", "pyramid_stairs").stdout.splitlines()]
    assert ["step_height", "0.05", "0.23", "Rise", "of", "a", "step", "[m]."] in lines


def test_info_describes_the_map(terrainkit, small_map):
    output = terrainkit("info", small_map).stdout
    assert "2 x 5 of 8 m x 6 m" in output
    assert "82 x" not in output
    assert "180 x 320, one every 0.1 m" in output  # 2 x 80 and 5 x 60 cells, and 10 on each side
    assert "rough_slope" in output


def test_info_counts_the_solids(terrainkit, solid_map, tmp_path):
    path = solid_map.save(tmp_path / "solids.npz")
    expected = "2 boxes, 1 cylinders, 1 hulls, 1 that do not collide"
    assert expected in terrainkit("info", path).stdout


def test_info_patch_shows_requested_and_realized(terrainkit):
    terrainkit("generate", "-o", "a.npz", "--rows", 2, "--cols", 1, "--terrain", "stairs")
    lines = [
        line.split() for line in terrainkit("info", "a.npz", "--patch", 1, 0).stdout.split("\n")
    ]
    assert ["step_width", "0.31", "0.3"] in lines


def test_info_unknown_patch_is_rejected(terrainkit, small_map):
    for patch in ((2, 0), (-1, -1)):
        run = terrainkit("info", small_map, "--patch", *patch)
        assert run.returncode == 2
        assert f"no patch {patch} in a map of 2 rows and 5 columns" in run.stderr


def test_preview_has_the_given_width(terrainkit, tmp_path, small_map):
    run = terrainkit("preview", small_map, "-o", "a.png", "--width", 400)
    assert run.returncode == 0
    picture = cv2.imread(str(tmp_path / "a.png"))
    assert picture.shape[1] >= 400
    assert picture.std() > 10


@pytest.mark.parametrize("name", ["a.xml", "a.stl", "a.ply", "a.obj", "a.glb", "a.png"])
def test_export_writes_every_format(terrainkit, tmp_path, small_map, name):
    run = terrainkit("export", small_map, "-o", name)
    assert run.returncode == 0, run.stderr
    assert re.match(rf"wrote {name}(, with .* beside it)?: 2 x 5 patches", run.stdout)
    assert (tmp_path / name).stat().st_size > 1000


@pytest.mark.parametrize(
    ("collision", "is_hinted"), [((), True), ("hfield", False), ("boxes", False)]
)
def test_export_hints_at_other_collision(terrainkit, collision, is_hinted):
    terrainkit("generate", "-o", "a.npz", "--rows", 1, "--cols", 1, "--terrain", "rough_slope")
    options = ("--collision", collision) if collision else ()
    run = terrainkit("export", "a.npz", "-o", "a.xml", *options)
    assert run.returncode == 0, run.stderr
    assert ("--collision boxes" in run.stdout) == is_hinted


def test_generate_quotes_paths_in_commands(terrainkit):
    run = terrainkit("generate", "-o", "my map.npz", "--rows", 1)
    assert "terrainkit preview 'my map.npz' -o" in run.stdout


def test_export_rejects_option_of_other_format(terrainkit, small_map):
    run = terrainkit("export", small_map, "-o", "a.stl", "--collision", "boxes")
    assert run.returncode == 2
    assert "option of .stl: got 'collision'; expected full, closed, y_up" in run.stderr


def test_check_map_accepts_generated_map(terrainkit, small_map):
    run = terrainkit("check-map", small_map)
    assert run.returncode == 0
    assert "no issues" in run.stdout


def test_check_map_prints_the_largest_seam(terrainkit):
    options = ("--rows", 1, "--cols", 1, "--border", 1, "--difficulty-range", 1, 1)
    terrainkit("generate", "-o", "a.npz", "--terrain", "stairs", *options)
    run = terrainkit("check-map", "a.npz")
    assert run.returncode == 0
    assert "largest seam: 1.61 m between stairs (0, 0) and the border\n" in run.stdout
    assert "cliffs: 2 seams, up to 1.61 m between stairs (0, 0) and the border\n" in run.stdout


def test_generate_warns_about_cliffs(terrainkit):
    run = terrainkit("generate", "-o", "a.npz", "--preset", "stairs", "--cols", 3, "--border", 1)
    assert run.returncode == 0
    assert "cliffs between patches: " in run.stderr
    assert "1.61 m between stairs (9, 0) and pyramid_stairs (9, 1)" in run.stderr


def test_check_map_reports_issues(terrainkit, tmp_path, small_map):
    arrays = dict(np.load(tmp_path / small_map))
    arrays["env_origins"][1, 2, 2] += 0.2
    np.savez(tmp_path / "broken.npz", **arrays)
    run = terrainkit("check-map", "broken.npz")
    assert run.returncode == 1
    assert "spawn: patch (1, 2): the spawn origin is 0.200 m above the ground" in run.stdout
    assert run.stdout.endswith("broken.npz: 1 issue\n")


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


def test_diff_exit_codes(terrainkit, tmp_path):
    small = ("--rows", 1, "--cols", 2, "--border", 0, "--terrain", "rough")
    for name, seed in (("a.npz", 0), ("b.npz", 0), ("c.npz", 1)):
        assert terrainkit("generate", "-o", name, "--seed", seed, *small).returncode == 0
    run = terrainkit("diff", "a.npz", "b.npz")
    assert (run.returncode, run.stdout) == (0, "a.npz and b.npz are the same\n")
    run = terrainkit("diff", "a.npz", "c.npz")
    assert run.returncode == 1
    assert "config: seed: 0 -> 1\n" in run.stdout
    assert "patch (0, 1): heights differ by up to 0." in run.stdout
    assert run.stdout.endswith("\na.npz -> c.npz: 2 of 2 patches differ\n")
    (tmp_path / "d.npz").write_bytes(b"PK")
    run = terrainkit("diff", "a.npz", "d.npz")
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.startswith("terrainkit: error: ")


def test_info_budget_prints_costs(terrainkit):
    flat = ("--rows", 1, "--cols", 2, "--border", 0, "--patch-size", 4, 3, "--terrain", "flat")
    terrainkit("generate", "-o", "flat.npz", *flat)
    run = terrainkit("info", "flat.npz", "--budget", "--foot-radius", 0.3)
    assert (run.returncode, run.stderr) == (0, "")
    rows = [" ".join(line.split()) for line in run.stdout.splitlines()]
    assert "triangles 2 merged, 5,002 full" in rows  # 2 x 41 x 61 quads
    assert rows[1].startswith(
        "contacts a foot of radius 0.3 m has at most 98 with a heightfield; MuJoCo drops"
    )
    assert "boxes (auto) 1 1 0 about 1.0 x a plane" in rows
    assert ".stl 0.2 kB" in rows


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--foot-radius", 0), "foot radius: got 0; expected a number above 0 m"),
        (("--patch", 0, 0), "--budget, --patch: got both; expected one of them"),
    ],
)
def test_info_budget_rejects_invalid_options(terrainkit, small_map, words, message):
    run = terrainkit("info", small_map, "--budget", *words)
    assert run.returncode == 2
    assert run.stderr == f"terrainkit: error: {message}\n"
