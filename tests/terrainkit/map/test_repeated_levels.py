import warnings

import pytest

from terrainkit import MapConfig, SubTerrain, TerrainkitWarning, generate
from tests.tables import read_table


def warnings_of(terrain, rows=6, **options):
    """Return the warnings about levels of a map of one terrain, or of several."""
    terrains = terrain if isinstance(terrain, tuple) else (terrain,)
    config = MapConfig(**{"rows": rows, "cols": len(terrains), "terrains": terrains} | options)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", TerrainkitWarning)
        generate(config)
    texts = [str(each.message) for each in caught]
    return [text.split("the levels of ")[1] for text in texts if "the levels of" in text]


def gap(easy, hard):
    return SubTerrain(terrain="gap", parameters={"width": (easy, hard), "depth": (0.5, 1.0)})


@pytest.mark.parametrize(("terrain", "parameters", "said"), read_table(__file__, "said"))
def test_repeated_levels_name_parameter_rows_and_remedy(terrain, parameters, said):
    found = warnings_of(SubTerrain(terrain=terrain, parameters=parameters))
    assert len(found) == bool(said)
    assert all(said in text for text in found)


def test_repeated_levels_are_one_warning_per_terrain_and_heed_the_remedy():
    terrains = (gap(0.04, 0.24), SubTerrain(terrain="flat"), SubTerrain(terrain="rings"))
    assert [text.split(":")[0] for text in warnings_of(terrains)] == ["gap", "rings"]
    assert warnings_of(gap(0.06, 0.26), cell=0.025) == []
    assert warnings_of(gap(0.06, 0.26), rows=3) == []


def test_repeated_levels_of_other_modes_and_with_jitter():
    assert warnings_of(gap(0.04, 0.24), mode="selected") == []
    random = {"mode": "randomized", "random_difficulties": (0.0, 0.4, 1.0), "cols": 8}
    assert "is 0 in difficulties 0;" in warnings_of(gap(0.04, 0.24), **random)[0]
    jitter = {"difficulty_jitter": 0.1, "cols": 4}
    assert len(warnings_of(gap(0.04, 0.24), **jitter)) == 1
    assert warnings_of(gap(0.1, 0.6), **jitter) == []
