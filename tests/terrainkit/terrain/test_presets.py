import pytest

from terrainkit import MapConfig, generate
from terrainkit.errors import ConfigError
from terrainkit.terrain import presets, registry
from terrainkit.terrain.parameter import parameters_of


def test_get_preset_unknown_name_lists_presets():
    with pytest.raises(
        ConfigError,
        match=r"'leggedgym'; did you mean 'legged_gym'\? There are: legged_gym, legged_gym_rough",
    ):
        presets.get_preset("leggedgym")


def test_get_preset_legged_gym_has_nine_sub_terrains():
    assert [(choice.name, choice.proportion) for choice in presets.get_preset("legged_gym")] == [
        ("pyramid_slope_inverted", 1),
        ("pyramid_slope", 1),
        ("rough_slope", 1),
        ("pyramid_stairs_inverted", 2),
        ("pyramid_stairs", 1),
        ("obstacles", 1),
        ("stepping_stones", 1),
        ("gap", 1),
        ("pit", 1),
    ]


def test_get_preset_all_has_no_course():
    assert "course" not in {choice.name for choice in presets.get_preset("all")}


@pytest.mark.parametrize("name", sorted({*registry.terrain_names()} - {"course"}))
def test_get_preset_all_has_every_terrain(name):
    mix = {choice.name: choice for choice in presets.get_preset("all")}
    assert mix[name].at(1.0) == registry.get_terrain(name).at(1.0)
    inverse = mix.get(f"{name}_inverted")
    if "inverted" in parameters_of(registry.get_terrain(name)):
        assert inverse.at(1.0).inverted
    else:
        assert inverse is None


@pytest.mark.parametrize("name", presets.preset_names())
def test_every_preset_generates_a_map(name):
    cols = max(20, len(presets.get_preset(name)))
    terrain_map = generate(MapConfig(preset=name, rows=2, cols=cols, border=0.0))
    assert set(terrain_map.terrain_types.flat) == set(range(len(terrain_map.terrain_names)))


def test_get_preset_isaaclab_has_the_figures_of_its_rough_mix():
    mix = {each.name: each for each in presets.get_preset("isaaclab")}
    assert [each.proportion for each in mix.values()] == [2, 2, 2, 2, 1, 1]
    stairs, grid = mix["pyramid_stairs_inverted"].at(1.0), mix["random_grid"].at(0.0)
    assert (stairs.step_height, stairs.step_width, stairs.inverted) == (0.23, 0.3, True)
    assert (grid.height, grid.block, grid.platform) == (0.05, 0.45, 2.0)


@pytest.mark.parametrize("name", ["parkour", "sparse", "confined", "natural"])
def test_get_preset_has_terrains_of_equal_proportion(name):
    mix = presets.get_preset(name)
    assert len({each.terrain for each in mix}) == len(mix) >= 7
    assert {each.proportion for each in mix} == {1.0}
