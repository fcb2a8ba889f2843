import os
import subprocess
import sys

import pytest

import terrainkit as tk


def test_generate_writes_map_and_prints_next_commands(terrainkit_process, tmp_path):
    run = terrainkit_process("generate", "--rows", 3, "--cols", 10, "-o", "map.npz")
    assert (run.returncode, run.stderr) == (0, "")
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


def test_generate_jobs_give_same_bytes(terrainkit, tmp_path):
    for name, jobs in (("one.npz", 1), ("two.npz", 2)):
        run = terrainkit("generate", "-o", name, "--rows", 3, "--seed", 4, "--jobs", jobs)
        assert (run.returncode, run.stderr) == (0, "")
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()


@pytest.mark.parametrize("jobs", [0, 62])
def test_generate_rejects_invalid_jobs(rejected, jobs):
    told = f"--jobs: got {jobs}; expected an integer from 1 to 61; see"
    assert told in rejected(f"generate -o a.npz --jobs {jobs}")


def test_generate_options_override_config_file(terrainkit, tmp_path):
    terrains = '[[terrains]]\nterrain = "stairs"\n[[terrains]]\nterrain = "gap"\nname = "moat"\n'
    config = f"centered = true\nrows = 3\ncols = 2\nseed = 5\n{terrains}"
    (tmp_path / "my.toml").write_text(config)
    run = terrainkit("generate", "-o", "my map.npz", "--config", "my.toml", "--rows", 4)
    assert "terrainkit preview 'my map.npz' -o" in run.stdout
    terrain_map = tk.TerrainMap.load(tmp_path / "my map.npz")
    config = terrain_map.config
    assert (config.rows, config.seed, config.centered) == (4, 5, True)
    assert terrain_map.terrain_names == ("stairs", "moat")
    terrainkit("generate", "-o", "b.npz", "--config=my.toml", "--no-centered")
    assert not tk.TerrainMap.load(tmp_path / "b.npz").config.centered


def test_generate_suffix_may_be_in_upper_case(terrainkit, tmp_path):
    run = terrainkit("generate", "-o", tmp_path / "a.NPZ", "--rows", 1, "--seed", 4)
    assert run.stdout.startswith("wrote a.NPZ: ")  # relative to the folder
    assert "terrainkit preview a.NPZ" in run.stdout
    assert terrainkit("generate", "-o", "b.npz", "--config", "a.NPZ").returncode == 0
    assert (tmp_path / "a.NPZ").read_bytes() == (tmp_path / "b.npz").read_bytes()
    terrainkit("generate", "-o", "c.npz", "--config", "b.npz", "--seed", 8)
    assert tk.TerrainMap.load(tmp_path / "c.npz").config == tk.MapConfig(rows=1, seed=8)


def test_generate_warns_of_coarse_cells(terrainkit):
    words = ("--rows", 2, "--cell", 1, "--terrain", "pyramid_stairs")
    run = terrainkit("generate", "-o", "a.npz", *words)
    assert (run.returncode, run.stderr.count("\n")) == (0, 1)
    told = "pyramid_stairs.step_width on 20 patches, such as 1 instead of 0.31; reduce"
    assert told in run.stderr


@pytest.mark.parametrize("line", ["rowz = 3", "rows = 'three'", "preset = 'moon'", "rows ="])
def test_generate_invalid_config_is_one_line(rejected, tmp_path, line):
    (tmp_path / "my.toml").write_text(line)
    assert "my.toml" in rejected("generate -o a.npz --config my.toml")
    assert not (tmp_path / "a.npz").exists()


def test_generate_keeps_existing_file(terrainkit, rejected, tmp_path):
    (tmp_path / "a.npz").write_text("mine")
    assert "a.npz exists" in rejected("generate -o a.npz --rows 1")
    assert (tmp_path / "a.npz").read_text() == "mine"
    assert terrainkit("generate", "-o", "a.npz", "--rows", 1, "--overwrite").returncode == 0
    assert tk.TerrainMap.load(tmp_path / "a.npz").config.rows == 1


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
