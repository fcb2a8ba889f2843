import json
import shlex
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.map.layout import column_types, terrain_and_difficulty
from terrainkit.terrain import registry
from terrainkit.terrain.paper import paper_names
from terrainkit_cli.generate_command import Generate
from tests.tables import read_table

WORKS = json.loads((Path(__file__).parents[1] / "terrainkit/terrain/works.json").read_text())


def test_list_names_every_terrain(terrainkit):
    names = [line.partition(" ")[0] for line in terrainkit("list").stdout.splitlines()]
    assert {*registry.terrain_names()} < {*names}


@pytest.mark.parametrize(("name", "line"), read_table(__file__, "list_shows_parameters"))
def test_list_shows_parameters_or_terrains(terrainkit, name, line):
    lines = terrainkit("list", name).stdout.splitlines()
    assert line in [" ".join(each.split()) for each in lines]


def test_list_papers_has_the_citations_in_100_columns(terrainkit, monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    lines = terrainkit("list", "--papers").stdout.splitlines()
    assert {*paper_names()} < {*lines}
    assert "    (2023), arXiv:2309.14341" in lines
    assert any("height=0.15:0.4," in line for line in lines)
    for name in paper_names():
        lines += terrainkit("list", name).stdout.splitlines()
    assert max(map(len, lines)) <= 100


@pytest.mark.parametrize("name", sorted(WORKS))
def test_list_prints_the_command_for_the_map_of_a_work(terrainkit, name):
    text = terrainkit("list", name).stdout.replace("\\\n", "")
    (line,) = [each for each in text.splitlines() if each.startswith("terrainkit generate")]
    config = Generate.parse(shlex.split(line)[2:]).changed_config()
    layout = WORKS[name]["layout"]
    assert config.rows == layout["rows"]
    assert config.cell <= layout["cell"]
    assert list(config.patch_size) == layout.get("patch_size", [12.8, 1.6])
    assert config.cols == layout.get("cols", config.cols)
    if layout.get("columns") == "random":
        assert (config.mode, np.mean(config.random_difficulties)) == ("randomized", 0.5)
        return
    columns = column_types(config)
    names = [config.sub_terrains[column].name for column in columns]
    assert names == layout.get("columns", names)
    exact = replace(config, difficulty_jitter=0.0)
    levels = [terrain_and_difficulty(exact, columns, row, 0)[1] for row in range(config.rows)]
    assert levels == pytest.approx(layout["levels"], abs=1e-3)


def test_list_papers_with_a_name_is_an_error(terrainkit):
    run = terrainkit("list", "--papers", "barkour")
    assert (run.returncode, "--papers: got 'barkour' as well" in run.stderr) == (2, True)


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


def test_info_patch_shows_a_pair_of_sides_that_differ(terrainkit, tmp_path):
    pit = SubTerrain(terrain="pit", parameters={"side": 3.0})
    size = {"rows": 1, "cols": 1, "patch_size": (8.0, 5.1), "border": 1.0}
    generate(MapConfig(terrains=(pit,), **size)).save(tmp_path / "a.npz")
    lines = [
        line.split() for line in terrainkit("info", "a.npz", "--patch", 0, 0).stdout.split("\n")
    ]
    (side,) = [line[1:] for line in lines if line[:1] == ["side"]]
    assert side == ["3", "3", "x", "3.1"]


def test_preview_has_the_given_width(terrainkit, tmp_path, small_map):
    run = terrainkit("preview", small_map, "-o", "a.png", "--width", 400)
    assert run.returncode == 0
    picture = cv2.imread(str(tmp_path / "a.png"))
    assert picture.shape[1] >= 400
    assert picture.std() > 10
    run = terrainkit("preview", small_map, "-o", "b.png", "--storey", 0)
    assert (run.returncode, "expected a map with buildings" in run.stderr) == (2, True)


@pytest.mark.parametrize(
    ("collision", "is_hinted"), [((), True), ("hfield", False), ("boxes", False)]
)
def test_export_hints_at_other_collision(terrainkit, collision, is_hinted):
    terrainkit("generate", "-o", "a.npz", "--rows", 1, "--cols", 1, "--terrain", "rough_slope")
    options = ("--collision", collision) if collision else ()
    run = terrainkit("export", "a.npz", "-o", "a.xml", *options)
    assert run.returncode == 0, run.stderr
    assert ("--collision boxes" in run.stdout) == is_hinted


def test_check_map_accepts_a_map_without_a_mesh(terrainkit, tmp_path, small_map):
    run = terrainkit("check-map", small_map)
    assert (run.returncode, "no issues" in run.stdout) == (0, True)
    run = terrainkit("generate", "-o", "a.npz", "--config", small_map, "--no-mesh")
    assert run.returncode == 0, run.stderr
    assert (tmp_path / "a.npz").stat().st_size < (tmp_path / small_map).stat().st_size
    run = terrainkit("check-map", "a.npz")
    assert (run.returncode, "no issues" in run.stdout) == (0, True)


def test_check_map_prints_the_largest_seam(terrainkit):
    options = ("--rows", 1, "--cols", 1, "--border", 1, "--difficulty-range", 1, 1)
    terrainkit("generate", "-o", "a.npz", "--terrain", "stairs", *options)
    run = terrainkit("check-map", "a.npz")
    assert run.returncode == 0
    assert "largest patch edge: 1.61 m between stairs (0, 0) and the border\n" in run.stdout
    assert (
        "cliffs: 2 patch edges, up to 1.61 m between stairs (0, 0) and the border\n" in run.stdout
    )


def test_check_map_reports_issues(terrainkit, tmp_path, small_map):
    arrays = dict(np.load(tmp_path / small_map))
    arrays["env_origins"][1, 2, 2] += 0.2
    np.savez(tmp_path / "broken.npz", **arrays)
    run = terrainkit("check-map", "broken.npz")
    assert run.returncode == 1
    assert "spawn: patch (1, 2): the spawn origin is 0.200 m above the ground" in run.stdout
    assert run.stdout.endswith("broken.npz: 1 issue\n")


@pytest.mark.parametrize("height", [np.nan, np.inf, 3e38])
def test_heights_out_of_range_are_one_line(terrainkit, tmp_path, small_map, height):
    arrays = dict(np.load(tmp_path / small_map))
    arrays["heights"][...] = height
    np.savez(tmp_path / "broken.npz", **arrays)
    for words in (("info", "broken.npz"), ("info", "broken.npz", "--budget")):
        run = terrainkit(*words)
        assert (run.returncode, run.stdout) == (2, "")
        assert run.stderr.startswith("terrainkit: error: heights has values that are not finite or")
    run = terrainkit("check-map", "broken.npz")
    assert (run.returncode, run.stderr) == (1, "")


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


@pytest.mark.parametrize(("words", "message"), read_table(__file__, "info_rejects_invalid_options"))
def test_info_rejects_invalid_options(rejected, small_map, words, message):
    assert rejected(f"info {small_map} {words}") == f"{message}\n"
