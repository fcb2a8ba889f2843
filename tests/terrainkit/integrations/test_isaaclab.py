from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import terrainkit as tk
from terrainkit.errors import ExportError
from tests.terrainkit.integrations.stand_ins import Cfg

CONTACTS = Cfg(solver_cfg=Cfg(use_mujoco_contacts=True))


class Column(Cfg):
    """The configuration of a sub-terrain in Isaac Lab 3."""

    convert_to_heightfield = False


@pytest.fixture
def simulation():
    return Cfg(cfg=None)


@pytest.fixture
def isaaclab(load_adapter, simulation):
    names = "TerrainGeneratorCfg", "TerrainImporterCfg"
    context = SimpleNamespace(instance=lambda: simulation)
    modules = {
        "isaaclab": Cfg(),
        "isaaclab.envs": Cfg(ManagerBasedRLEnvCfg=Cfg),
        "isaaclab.managers": Cfg(
            CurriculumTermCfg=Cfg, TerminationTermCfg=Cfg, ManagerTermBase=type("Term", (), {})
        ),
        "isaaclab.sim": Cfg(SimulationContext=context, RigidBodyMaterialCfg=Cfg),
        "isaaclab.terrains": Cfg(SubTerrainBaseCfg=Column, **dict.fromkeys(names, Cfg)),
        "isaaclab.utils": Cfg(configclass=lambda cls: cls),
    }
    return load_adapter("isaaclab", modules)


@pytest.fixture(scope="module")
def stairs():
    choice = tk.SubTerrain(terrain="stairs")
    return tk.generate(
        tk.MapConfig(rows=2, cols=2, border=1.0, terrains=(choice,), static_friction=0.8)
    )


def test_importer_has_a_sub_terrain_for_each_column(isaaclab, parkour, parkour_path):
    cfg = isaaclab.terrain_importer_cfg(parkour_path)
    generator = cfg.terrain_generator
    columns = generator.__dict__.pop("sub_terrains")
    assert list(columns) == parkour.patch_names[0].tolist()
    assert all(each.function is isaaclab.MapGenerator for each in columns.values())
    assert not any(each.convert_to_heightfield for each in columns.values())  # it has solids
    assert vars(generator) == {
        "path": str(parkour_path),
        "curriculum": True,
        "size": (8.0, 6.0),
        "num_rows": 2,
        "num_cols": 7,
        "border_width": 1.0,
        "border_height": 0.0,
        "horizontal_scale": 0.1,
    }
    material = Cfg(
        friction_combine_mode="multiply",
        restitution_combine_mode="multiply",
        **parkour.config.contact,
    )
    assert (cfg.prim_path, cfg.terrain_type) == ("/World/ground", "generator")
    assert (cfg.max_init_terrain_level, cfg.physics_material) == (5, material)


@pytest.mark.parametrize(
    ("samples", "heightfield", "expected"),
    [(180, None, True), (180, False, False), (179, None, False), (179, False, False)],
)
def test_maps_without_solids_are_heightfields_up_to_a_size(
    isaaclab, stairs, tmp_path, monkeypatch, samples, heightfield, expected
):
    monkeypatch.setattr(isaaclab, "_MAX_SAMPLES", samples)  # the map has 180 x 180
    path = stairs.save(tmp_path / "map.npz")
    cfg = isaaclab.terrain_importer_cfg(path, heightfield=heightfield)
    columns = cfg.terrain_generator.sub_terrains
    assert list(columns) == ["stairs", "stairs#2"]
    assert all(each.convert_to_heightfield == expected for each in columns.values())
    if samples < 180:
        with pytest.raises(ExportError, match="a heightfield: got 180 samples; expected <= 179"):
            isaaclab.terrain_importer_cfg(path, heightfield=True)


def test_importer_rejects_what_a_mesh_cannot_represent(isaaclab, solid_map, parkour_path, tmp_path):
    with pytest.raises(ExportError, match="several friction coefficients"):
        isaaclab.terrain_importer_cfg(solid_map.save(tmp_path / "friction.npz"))
    same = replace(solid_map.solids, friction=np.full(4, np.nan, np.float32))
    path = replace(solid_map, solids=same).save(tmp_path / "flags.npz")
    with pytest.raises(ExportError, match="only collide or are only visible"):
        isaaclab.terrain_importer_cfg(path)
    with pytest.raises(ExportError, match="solids"):
        isaaclab.terrain_importer_cfg(parkour_path, heightfield=True)


@pytest.mark.parametrize("heightfield", [True, False, None])
def test_generator_provides_the_map_around_its_center(isaaclab, stairs, tmp_path, heightfield):
    path = stairs.save(tmp_path / "map.npz")
    cfg = isaaclab.terrain_importer_cfg(path, heightfield=heightfield).terrain_generator
    if heightfield is None:  # a heightfield is of all columns
        cfg.sub_terrains["stairs"].convert_to_heightfield = False
    cfg.num_rows = cfg.num_cols = 5  # as in play mode
    generator = isaaclab.MapGenerator(cfg)
    assert (generator.cfg, cfg.num_rows, cfg.num_cols) == (cfg, 2, 2)
    half = 8.95 if heightfield else 9.0  # without the rim of half a cell
    assert generator.terrain_mesh.bounds[:, :2].ravel() == pytest.approx([-half, -half, half, half])
    center = [8.0, 8.0, 0.0]
    np.testing.assert_allclose(generator.terrain_origins, stairs.env_origins - center)
    assert list(generator.flat_patches) == ["init_pos"]
    spawns = generator.flat_patches["init_pos"].numpy()
    np.testing.assert_allclose(spawns, stairs.spawns[..., :3] - center, atol=1e-6)


@pytest.mark.parametrize(
    ("lowest", "is_heightfield", "physics", "message"),
    [
        (0.0, True, CONTACTS, None),
        (0.00009, True, CONTACTS, None),
        (0.00011, True, CONTACTS, "got use_mujoco_contacts=True"),
        (0.0, False, CONTACTS, "got use_mujoco_contacts=True"),
        (1.0, False, Cfg(solver_cfg=Cfg(use_mujoco_contacts=False)), None),
        (1.0, True, Cfg(default_shape_cfg=Cfg(mu=0.80009)), None),
        (1.0, True, Cfg(default_shape_cfg=Cfg(mu=0.79989)), "got mu=0.79989 .* expected 0.8,"),
        (1.0, False, Cfg(default_shape_cfg=Cfg(mu=0.5)), None),
        (1.0, True, None, None),
    ],
)
def test_contacts_of_newton_are_checked(
    isaaclab, simulation, stairs, lowest, is_heightfield, physics, message
):
    simulation.cfg = Cfg(physics=physics)
    heights = stairs.heights - stairs.heights.min() + np.float32(lowest)
    terrain_map = replace(stairs, heights=heights)
    if message:
        with pytest.raises(ExportError, match=message):
            isaaclab._require_contacts(terrain_map, is_heightfield=is_heightfield)
    else:
        isaaclab._require_contacts(terrain_map, is_heightfield=is_heightfield)


def test_use_terrain_curriculum_replaces_the_terms(isaaclab):
    cfg = Cfg(terminations=Cfg(), curriculum=Cfg(terrain_levels=None))
    isaaclab.use_terrain_curriculum(cfg)
    progress = Cfg(func=isaaclab.TerrainProgress, params={"command_name": "base_velocity"})
    levels = Cfg(func=isaaclab.TerrainLevels, params={"sampler": "levels"})
    assert cfg.terminations == Cfg(terrain_progress=progress)
    assert cfg.curriculum == Cfg(terrain_levels=levels)
