import dataclasses

import cv2
import numpy as np
import pytest

import terrainkit as tk
from terrainkit.errors import ExportError
from terrainkit.geometry.solids import Solids, make_boxes
from terrainkit.views.preview import (
    color_levels,
    height_colors,
    render_preview,
    shaded_relief,
    write_preview,
)

PAPER = (250, 249, 246)


@pytest.fixture(scope="module")
def pits():
    """Make three rows along x and one column along y; only the last row has a deep pit."""
    pit = tk.SubTerrain(terrain="pit", parameters={"side": 6.0})
    return tk.generate(tk.MapConfig(rows=3, cols=1, border=1.0, terrains=(pit,)))


def test_preview_x_is_to_the_right(pits):
    picture = render_preview(pits, 520)  # 26 m along x: 20 px for a metre
    left, _, _, above = 250, 60, 130, 70
    first, last = (picture[above + 100, left + 20 + row * 160 + 30].astype(int) for row in (0, 2))
    assert np.abs(last - first).max() > 40


def test_preview_y_is_up():
    bowl = tk.SubTerrain(terrain="pyramid_slope", name="bowl", parameters={"inverted": True})
    config = tk.MapConfig(
        rows=1,
        cols=2,
        border=0.0,
        difficulty_range=(1.0, 1.0),
        terrains=(tk.SubTerrain(terrain="flat"), bowl),
    )
    picture = render_preview(tk.generate(config), 160)
    top, bottom = (picture[70 + i, 250 + 30].astype(int) for i in (80 + 30, 240 + 30))
    assert tuple(bottom) == tuple(shaded_relief(np.zeros((3, 3), np.float32), 0.1)[1, 1])
    assert np.abs(top - bottom).max() > 40


def test_preview_has_the_minimum_width(pits):
    for width in (100, 520, 1000):
        ground = render_preview(pits, width).shape[1] - 250 - 130
        assert width <= ground < 2 * max(width, 260)


def test_preview_labels_every_column(pits):
    picture = render_preview(pits, 520)
    assert (picture[:, :250] != PAPER).any()


def test_color_levels_are_ends_and_color_stops():
    assert color_levels(-10.2, 0.3) == pytest.approx([-10.2, -10.0, -1.5, -0.4, 0.0, 0.3])
    assert color_levels(0.0, 0.0).tolist() == [0.0]


def test_preview_height_scale_includes_the_tops_of_solids(solid_map):
    lifted = dataclasses.replace(
        solid_map, solids=solid_map.solids.transformed(np.eye(3), np.array([0.0, 0.0, 3.0]))
    )
    bars = [
        render_preview(each, 400)[70:-60, -130 + 25]
        for each in (dataclasses.replace(solid_map, solids=Solids.empty()), solid_map, lifted)
    ]
    highest = [0.0, 0.7, 3.7]  # the top of the cylinder
    for bar, top in zip(bars, highest, strict=True):
        assert bar[2] == pytest.approx(height_colors(np.array(top)), abs=4)


@pytest.mark.parametrize("inverted", [False, True])
def test_preview_height_scale_has_the_colors_of_heights(inverted):
    slope = tk.SubTerrain(terrain="pyramid_slope", parameters={"inverted": inverted})
    config = tk.MapConfig(rows=1, cols=1, difficulty_range=(1.0, 1.0), terrains=(slope,))
    picture = render_preview(tk.generate(config), 400)
    bar = picture[70:-60, -130 + 20 : -130 + 42].astype(int)
    # Heights from 0 to 1 m or from -1 m to 0; row 0 is the highest.
    top, bottom = height_colors(np.array([0.0, -1.0] if inverted else [1.0, 0.0]))
    assert np.abs(bar[2, 10] - top).max() < 8
    assert np.abs(bar[-3, 10] - bottom).max() < 8
    middle = height_colors(np.array([-0.4 if inverted else 0.4]))[0]
    assert np.abs(bar[len(bar) // 2, 10] - middle).max() < 8
    assert (picture[70:-60, -80:] != PAPER).any()  # tick labels


@pytest.mark.parametrize("width", [100, 130, 400])
def test_preview_height_scale_of_a_flat_map(width):
    flat = tk.SubTerrain(terrain="flat")
    terrain_map = tk.generate(tk.MapConfig(rows=5, cols=1, border=0.0, terrains=(flat,)))
    bar = render_preview(terrain_map, width)[70:-60, -130 + 20 : -130 + 42]
    assert (bar[3:-3, 3:-3] == height_colors(np.array(0.0)).astype(np.uint8)).all()


def test_shaded_relief_is_brighter_toward_the_light():
    x = np.arange(20, dtype=np.float32)[:, None] * np.ones((1, 20), np.float32) * 0.01
    facing, away = shaded_relief(x, 0.1)[10, 10].sum(), shaded_relief(x[::-1], 0.1)[10, 10].sum()
    assert facing > away


def test_height_colors_are_blue_to_red():
    low, high = height_colors(np.array([-1.0, 1.0]))
    assert low[2] > low[0]
    assert high[0] > high[2]


def test_write_preview_writes_the_image(pits, tmp_path):
    path = write_preview(pits, tmp_path / "a.png", width=300)
    assert (cv2.imread(str(path))[..., ::-1] == render_preview(pits, 300)).all()


@pytest.mark.parametrize(
    ("name", "width", "said"),
    [
        ("a.jpg", 300, "expected a .png file"),
        ("a.png", 0, "width: got 0; expected 100 to 10000"),
        ("a.png", 10**6, "width: got 1000000; expected 100 to 10000"),
        ("file/a.png", 300, "is not a folder"),
    ],
)
def test_write_preview_rejects_invalid_input(pits, tmp_path, name, width, said):
    (tmp_path / "file").write_text("")
    with pytest.raises(ExportError, match=said):
        write_preview(pits, tmp_path / name, width=width)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_write_preview_keeps_existing_file(pits, tmp_path):
    target = tmp_path / "a.png"
    target.write_text("mine")
    with pytest.raises(ExportError, match="exists"):
        write_preview(pits, target)
    assert target.read_text() == "mine"
    write_preview(pits, target, overwrite=True)
    assert target.read_bytes().startswith(b"\x89PNG")


def test_preview_of_a_long_map_is_limited():
    flat = tk.SubTerrain(terrain="flat")
    config = tk.MapConfig(
        rows=1, cols=300, patch_size=(2.0, 2.0), cell=0.2, border=0.0, terrains=(flat,)
    )
    height, width, _ = render_preview(tk.generate(config), 1600).shape
    assert height <= 10_000 + 70 + 60
    assert width < 300 + 10_000 / 300 + 130


def test_preview_draws_solids_and_goals(solid_map):
    """The color at the center of the box mixes the colors of its top and the ground."""
    bare = dataclasses.replace(
        solid_map, solids=Solids.empty(), goals=np.full_like(solid_map.goals, np.nan)
    )
    with_solids, without = (render_preview(each, 700).astype(int) for each in (solid_map, bare))
    scale = 100  # 7 m on 700 pixels
    bottom, left = without.shape[0] - 60, 250

    def pixel(picture, x, y):
        return picture[bottom - round((y + 0.5) * scale), left + round((x + 0.5) * scale)]

    expected = 0.75 * height_colors(np.array(0.6)) + 0.25 * pixel(without, 1, 6)
    assert pixel(with_solids, 1, 6) == pytest.approx(expected, abs=2)
    assert (pixel(with_solids, 3, 1) == pixel(without, 3, 1)).all()
    assert (pixel(with_solids, 3.1, 6) != pixel(without, 3.1, 6)).any()  # the arrow of a goal


@pytest.mark.parametrize(("rows", "cols", "longer"), [(1, 40, 0), (40, 1, 1), (3, 3, 0)])
def test_map_in_a_notebook_is_a_picture_of_limited_size(rows, cols, longer):
    flat = tk.SubTerrain(terrain="flat")
    terrain_map = tk.generate(tk.MapConfig(rows=rows, cols=cols, terrains=(flat,)))
    picture = cv2.imdecode(np.frombuffer(terrain_map._repr_png_(), np.uint8), cv2.IMREAD_COLOR)
    relief = np.subtract(picture.shape[:2], (130, 380))  # without the margins
    assert relief.argmax() == longer or rows == cols
    assert 700 <= relief.max() <= 1100


def test_preview_draws_the_solid_with_the_highest_top_last(solid_map):
    """A pillar of 1 m leads through a slab from 0.4 m to 0.6 m."""
    boxes = make_boxes([(1, 6, 0.5), (1, 6, 0.5)], [(0.5, 0.5, 1.0), (1.5, 1.5, 0.2)])
    solids = dataclasses.replace(boxes, patch=np.tile(np.array([0, 1], np.int32), (2, 1)))
    given = dataclasses.replace(solid_map, solids=solids, goals=np.full_like(solid_map.goals, 0.0))
    ground = dataclasses.replace(given, solids=Solids.empty())
    picture, bare = (render_preview(each, 700).astype(int) for each in (given, ground))
    at = bare.shape[0] - 60 - 650, 250 + 150
    slab = 0.75 * height_colors(np.array(0.6)) + 0.25 * bare[at]
    expected = 0.75 * height_colors(np.array(1.0)) + 0.25 * slab
    assert picture[at] == pytest.approx(expected, abs=2)
