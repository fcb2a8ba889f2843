import warnings

import pytest

from terrainkit import MapConfig, SubTerrain, TerrainkitWarning, generate


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


@pytest.mark.parametrize(
    ("terrain", "said"),
    [
        # 0.04, 0.08, 0.12, 0.16, 0.2 and 0.24 m become 0, 1, 1, 2, 2 and 2 cells.
        (
            gap(0.04, 0.24),
            "gap: width is 0 in rows 0 and is the same as before in rows 2, 4, 5; use at "
            "most 3 rows or smaller cells or larger ranges",
        ),
        (gap(0.03, 0.53), "gap: width is 0 in rows 0; use smaller cells or larger ranges"),
        (gap(0.0, 0.5), None),  # 0 was requested
        (gap(0.3, 0.3), None),  # the same on purpose
        (
            gap(0.31, 0.30999),
            "gap: width is the same as before in rows 1, 2, 3, 4, 5; use smaller",
        ),
        (
            SubTerrain(terrain="pallets"),
            "layers is the same as before in rows 1, 3, 5; use at most 3",
        ),
        (SubTerrain(terrain="floating_islands"), None),  # fewer islands, or narrower walkways
        (
            SubTerrain(terrain="rough", parameters={"amplitude": (0.01, 0.025)}),
            "use at most 4 rows o",
        ),
    ],
)
def test_repeated_levels_name_parameter_rows_and_remedy(terrain, said):
    found = warnings_of(terrain)
    assert len(found) == (said is not None)
    assert said is None or said in found[0]


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
