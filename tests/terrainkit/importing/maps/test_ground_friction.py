import cv2
import numpy as np
import pytest

import terrainkit as tk
from terrainkit.errors import ConfigError, HeightFileError
from terrainkit.importing import ImportOptions, import_map
from terrainkit.map.validate import validate

# Two columns along x and three rows along y, the upper one first.
PIXELS = np.array([[0, 51], [102, 153], [204, 255]], np.uint8)
RANGE = (0.1, 0.6)


@pytest.fixture
def make(tmp_path):
    """Return a function that imports 40 x 60 flat heights with a friction image."""
    np.save(tmp_path / "a.npy", np.zeros((40, 60)))

    def run(pixels, classes="", **options):
        assert cv2.imwrite(str(tmp_path / "f.png"), pixels)
        if classes:
            (tmp_path / "c.toml").write_text(classes)
            options["friction_classes"] = str(tmp_path / "c.toml")
        options = {"file_cell": 0.1, "friction": str(tmp_path / "f.png"), **options}
        return import_map(tmp_path / "a.npy", ImportOptions(**options)).terrain_map

    return run


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_friction_range_is_of_black_and_white(make, tmp_path, dtype):
    made = make(PIXELS.astype(dtype) * (np.iinfo(dtype).max // 255), friction_range=RANGE)
    blocks = np.array([[0.5, 0.3, 0.1], [0.6, 0.4, 0.2]])  # along x, then y
    expected = blocks.repeat(20, 0).repeat(20, 1)
    np.testing.assert_allclose(made.friction, expected, atol=1e-6)
    assert validate(tk.TerrainMap.load(made.save(tmp_path / "m.npz"))) == []


def test_friction_follows_the_crop_and_continues_in_the_border(make):
    options = {"origin": (2.0, 2.0, 0.0), "patch_size": (2.0, 4.0), "border": 1.0}
    made = make(PIXELS, friction_range=RANGE, **options)
    # From 1 m to 5 m along x, beyond 4 m as the edge, and from 1 m to 7 m along y.
    along_x = made.friction[:, 15]
    np.testing.assert_allclose(along_x[[0, 9, 10, 39]], [0.3, 0.3, 0.4, 0.4], atol=1e-6)
    np.testing.assert_allclose(made.friction[20, [0, 9, 10, 30, 59]], [0.6, 0.6, 0.4, 0.2, 0.2])


def test_friction_classes(make):
    made = make(np.where(PIXELS > 150, 7, 0).astype(np.uint8), "0 = 0.8\n7 = 0.15\n9 = 1\n")
    assert made.friction[[0, 39, 0, 39], [0, 25, 59, 59]].tolist() == pytest.approx(
        [0.15, 0.15, 0.8, 0.8]
    )


@pytest.mark.parametrize(
    ("pixels", "options", "error", "message"),
    [
        (PIXELS, {}, ConfigError, "expected either `friction_range=.* or `friction_classes"),
        (PIXELS, {"classes": "0 = 1", "friction_range": RANGE}, ConfigError, "expected either"),
        (PIXELS, {"classes": "0 = 1\n51 = 2"}, ConfigError, "0, 51; .* values 102, 153, 204, 255"),
        (PIXELS, {"classes": "0 = -1"}, ConfigError, r"c\.toml.*expected"),
        (PIXELS.T, {"friction_range": RANGE}, HeightFileError, "3 x 2 pixels of 1.33 m x 3 m; exp"),
        (PIXELS, {"friction": "", "friction_range": RANGE}, ConfigError, "^friction: missing"),
    ],
)
def test_friction_that_is_not_clear_is_rejected(make, pixels, options, error, message):
    with pytest.raises(error, match=message):
        make(pixels, **options)
