import math

import mujoco
import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.export.budget import (
    HFIELD_COST,
    MAX_CONTACTS,
    CollisionBudget,
    box_step_time,
    compute_budget,
    foot_contacts,
)


@pytest.fixture(scope="module")
def flat_map():
    flat = SubTerrain(terrain="flat")
    return generate(MapConfig(rows=2, cols=1, patch_size=(4.0, 3.0), border=1.0, terrains=(flat,)))


@pytest.fixture(scope="module")
def flat_budget(flat_map):
    return compute_budget(flat_map)


def test_budget_counts_triangles_geoms_and_cells(flat_budget):
    # 100 x 50 samples with half a cell around them: 101 x 51 quads.
    assert flat_budget.full_triangles == 2 * 101 * 51
    assert flat_budget.merged_triangles == 2
    assert flat_budget.auto == "boxes"
    assert flat_budget.foot_contacts == 8
    assert flat_budget.collisions == {
        "boxes": CollisionBudget(num_geoms=1, num_boxes=1, hfield_cells=0, step_time=1.03),
        # 80 x 30 samples and 2 on each side; 4 boxes are the rest of the border.
        "hfield": CollisionBudget(
            num_geoms=5, num_boxes=4, hfield_cells=83 * 33, step_time=HFIELD_COST
        ),
    }


def test_budget_counts_what_mujoco_loads(terrain_map, tmp_path):
    budget = compute_budget(terrain_map)
    for collision, cost in budget.collisions.items():
        path = terrain_map.save(tmp_path / f"{collision}.xml", collision=collision)
        model = mujoco.MjModel.from_xml_path(str(path))
        cells = (model.hfield_nrow - 1) * (model.hfield_ncol - 1)
        assert cost.num_geoms == model.ngeom
        assert cost.num_boxes == (model.geom_type == mujoco.mjtGeom.mjGEOM_BOX).sum()
        assert cost.hfield_cells == cells.sum()
        assert budget.file_sizes[f".xml ({collision})"] == path.stat().st_size
    assert budget.auto == "hfield"
    mixed = budget.collisions["boxes"]
    assert mixed.step_time == max(box_step_time(mixed.num_boxes), HFIELD_COST)


def test_budget_sizes_are_those_of_the_files(flat_map, flat_budget, tmp_path):
    assert flat_budget.file_sizes[".stl"] == 84 + 50 * 2
    for suffix in (".npz", ".ply", ".obj", ".glb", ".png", ".sdf"):
        (tmp_path / suffix).mkdir()
        path = flat_map.save(tmp_path / suffix / f"map{suffix}")
        files = path.parent.iterdir()  # .json beside .png, and .stl beside .sdf
        assert flat_budget.file_sizes[suffix] == sum(file.stat().st_size for file in files)


def test_budget_says_which_format_has_no_solids():
    crawl = SubTerrain(terrain="crawl")
    terrain_map = generate(MapConfig(rows=1, cols=1, border=0.0, terrains=(crawl,)))
    budget = compute_budget(terrain_map)
    assert "solids" in budget.file_sizes[".png"]
    # The ground is one box, and crawl's bars are boxes.
    assert budget.collisions["boxes"].num_boxes == 1 + len(terrain_map.solids)


@pytest.mark.parametrize(
    ("num_boxes", "time"),
    [(0, 1.03), (1, 1.03), (95, 1.75), (259, 2.074), (3172, 3.9), (14232, 5.4)],
)
def test_box_step_time_is_linear_in_the_logarithm(num_boxes, time):
    # 259 is the geometric mean of 95 and 707; 14232 / 3172 is 3172 / 707.
    assert box_step_time(num_boxes) == pytest.approx(time, abs=1e-3)


@pytest.mark.parametrize(
    ("radius", "cell", "contacts"),
    [
        (0.03, 0.1, 8),  # 2 x 2 cells of 2 prisms
        (0.05, 0.1, 8),
        (0.05, 0.025, 50),  # 5 x 5
        (0.03, 0.01, 98),
    ],
)
def test_foot_contacts_bound_is_tight_in_mujoco(radius, cell, contacts):
    assert foot_contacts(radius, cell) == contacts
    rng, most = np.random.default_rng(0), 0
    n, half = 41, 20 * cell
    elevation = " ".join(f"{value:.4f}" for value in rng.random(n * n))
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <asset><hfield name="h" nrow="{n}" ncol="{n}" size="{half} {half} {0.01 * radius} 0.1"
        elevation="{elevation}"/></asset>
      <worldbody><geom type="hfield" hfield="h"/>
      <body name="foot"><freejoint/><geom type="box" size="{radius} {radius} {radius}"/></body>
      </worldbody></mujoco>""")
    data = mujoco.MjData(model)
    for _ in range(100):
        data.qpos[:3] = [*rng.uniform(-cell, cell, 2), 0.7 * radius]
        mujoco.mj_forward(model, data)
        most = max(most, data.ncon)
    assert mujoco.mjMAXCONPAIR == MAX_CONTACTS
    assert min(contacts, MAX_CONTACTS) - 2 <= most <= min(contacts, MAX_CONTACTS)


@pytest.mark.parametrize("radius", [0.0, -1.0, math.nan, math.inf])
def test_foot_contacts_rejects_invalid_radius(radius):
    with pytest.raises(ConfigError, match=r"foot radius: got .*; expected a number above 0 m"):
        foot_contacts(radius, 0.1)
