from dataclasses import make_dataclass
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import terrainkit as tk
from terrainkit.errors import ExportError
from terrainkit.integrations import terrain_curriculum
from tests.rays import cast_rays
from tests.terrainkit.integrations.stand_ins import Cfg


class Generator:
    """A generator with a plate of 10 m, with a bump on the second patch along y."""

    terrain_origins = np.array([[[0.0, -2.0, 0.0], [0.0, 2.0, 0.0]]])

    def __init__(self, cfg):
        pass

    def compile(self, spec):
        for pos, size in (((0, 0, -0.5), (5, 5, 0.5)), ((3, 2, 0), (0.5, 0.5, 0.3))):
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=pos, size=size)


@pytest.fixture
def mjlab(load_adapter):
    names = "FlatPatchSamplingCfg", "TerrainEntityCfg", "TerrainGeneratorCfg"
    column = make_dataclass("SubTerrainCfg", [("flat_patch_sampling", dict, None)], kw_only=True)
    generator = SimpleNamespace(TerrainGenerator=Generator, TerrainOutput=Cfg)
    modules = {
        "mjlab": Cfg(),
        "mjlab.envs": Cfg(ManagerBasedRlEnvCfg=Cfg),
        "mjlab.managers": Cfg(CurriculumTermCfg=Cfg, TerminationTermCfg=Cfg),
        "mjlab.terrains": Cfg(SubTerrainCfg=column, **dict.fromkeys(names, Cfg)),
        "mjlab.terrains.terrain_generator": generator,
    }
    return load_adapter("mjlab", modules)


def test_terrain_entity_has_a_sub_terrain_for_each_column(mjlab, parkour, parkour_path):
    cfg = mjlab.terrain_entity_cfg(parkour_path, collision="hfield")
    generator = cfg.terrain_generator
    columns = generator.__dict__.pop("sub_terrains")
    assert generator == Cfg(
        curriculum=True, size=(8.0, 6.0), num_rows=2, num_cols=7, border_width=1.0
    )
    assert (cfg.terrain_type, cfg.max_init_terrain_level) == ("generator", 5)
    assert list(columns) == parkour.patch_names[0].tolist()
    radius = parkour.config.spawn_radius
    sampling = {
        "spawn": Cfg(num_patches=1, patch_radius=radius),
        "goal": Cfg(num_patches=parkour.goals.shape[2], patch_radius=radius),
    }
    for column, each in enumerate(columns.values()):
        expected = str(parkour_path), column, "hfield", sampling
        assert (each.path, each.column, each.collision, each.flat_patch_sampling) == expected


def test_border_is_a_wall_of_mjlab(mjlab, tmp_path):
    flat = {"rows": 1, "cols": 1, "border": 1.0, "terrains": (tk.SubTerrain(terrain="flat"),)}
    path = tk.generate(tk.MapConfig(**flat, border_height=0.4)).save(tmp_path / "wall.npz")
    generator = mjlab.terrain_entity_cfg(path).terrain_generator
    assert (generator.border_width, generator.border_height) == (1.0, -0.4)  # mjlab: downward
    for other in ({"border_height": -0.1}, {"border_height": 0.4, "border_rim": 0.1}):
        path = tk.generate(tk.MapConfig(**flat, **other)).save(tmp_path / "no.npz", overwrite=True)
        with pytest.raises(ExportError, match="mjlab's border: got border_height"):
            mjlab.terrain_entity_cfg(path)


def test_columns_place_the_map_once_and_return_its_points(mjlab, parkour, parkour_path):
    cfg = mjlab.terrain_entity_cfg(parkour_path, collision="boxes")
    spec = mujoco.MjSpec()
    spec.worldbody.add_body(name="terrain")
    for row, col in np.ndindex(2, 7):
        column = [*cfg.terrain_generator.sub_terrains.values()][col]
        found = column.function(row, spec, None)
        corner = np.array([8.0 * row, 6.0 * col, 0.0])
        np.testing.assert_allclose(found.origin + corner, parkour.env_origins[row, col], atol=1e-6)
        for name, points in (("spawn", parkour.spawns), ("goal", parkour.goals)):
            points = points[row, col, :, :3]
            points = points[~np.isnan(points[:, 0])]
            np.testing.assert_allclose(found.flat_patches[name] + corner, points, atol=1e-5)
    model = spec.compile()
    center = [*parkour.grid.center, 0.0]
    starts = np.random.default_rng(0).uniform((0, 0, 9), (16, 42, 9), (50, 3))
    heights, _ = cast_rays(model, starts - center)
    assert np.median(np.abs(heights - parkour.scan(starts))) < 1e-5
    # Two cells of the border are left.
    heights, _ = cast_rays(model, np.array([[-0.19, 5.0, 9.0], [-0.21, 5.0, 9.0]]) - center)
    assert heights == pytest.approx([0.0, np.nan], abs=1e-6, nan_ok=True)


@pytest.mark.parametrize(("border", "kept"), [(0.1, 1), (0.2, 2), (0.3, 2)])
def test_narrow_border_is_at_most_two_cells(mjlab, border, kept):
    flat = tk.SubTerrain(terrain="flat")
    given = tk.generate(tk.MapConfig(rows=1, cols=1, border=border, terrains=(flat,)))
    found = mjlab._with_narrow_border(given)
    assert found.config.border_cells == kept
    assert found.grid.lower == pytest.approx((-0.1 * kept, -0.1 * kept))
    assert found.heights.shape == found.friction.shape == (80 + 2 * kept, 80 + 2 * kept)


@pytest.mark.parametrize(
    ("curriculum", "names"), [(True, ["plate", "bump"]), (False, ["mjlab", "mjlab"])]
)
def test_import_terrain_is_a_map_of_the_generated_terrain(mjlab, curriculum, names):
    sub_terrains = {"plate": None, "bump": None}
    cfg = Cfg(size=(8.0, 4.0), border_width=1.0, sub_terrains=sub_terrains, curriculum=curriculum)
    found = mjlab.import_terrain(cfg).terrain_map
    assert found.patch_names.tolist() == [names]
    assert found.grid.lower == pytest.approx((-5.0, -5.0))
    assert found.height([[0.0, -2.0], [3.0, 2.0], [3.0, -2.0]]) == pytest.approx([0, 0.3, 0])


def test_use_terrain_curriculum_replaces_the_terms(mjlab):
    cfg = Cfg(terminations={}, curriculum={"terrain_levels": None})
    mjlab.use_terrain_curriculum(cfg)
    progress, levels = terrain_curriculum.TerrainProgress, terrain_curriculum.TerrainLevels
    terminations = {"terrain_progress": Cfg(func=progress, params={"command_name": "twist"})}
    curriculum = {"terrain_levels": Cfg(func=levels, params={"sampler": "levels"})}
    assert (cfg.terminations, cfg.curriculum) == (terminations, curriculum)
