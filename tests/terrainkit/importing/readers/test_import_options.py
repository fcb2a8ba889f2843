import pytest

from terrainkit.errors import ConfigError
from terrainkit.importing.readers.import_options import ReadOptions


@pytest.mark.parametrize("values", [(0, 10), (-5.5, 5.5), (-1e6, 1e6)])
def test_height_range_has_any_two_heights(values):
    assert ReadOptions(height_range=values).height_range == values


@pytest.mark.parametrize("values", [(-1e6 - 1, 0), (0, 1e6 + 1), (0, float("nan")), (1,)])
def test_height_range_rejects_other_values(values):
    with pytest.raises(ConfigError, match="height_range"):
        ReadOptions(height_range=values)
