import dataclasses

import cv2
import numpy as np
import pytest

import terrainkit as tk
from terrainkit.errors import ConfigError, ExportError
from terrainkit.geometry.solids import Solids, make_boxes
from terrainkit.views.preview import (
    LEVELS,
    LIGHT,
    Route,
    color_levels,
    height_colors,
    map_levels,
    render_preview,
    shaded_relief,
    write_preview,
)
from terrainkit.views.preview_layout import ABOVE, BELOW, LEFT, RIGHT, make_blocks
from terrainkit.views.storey import storey_map
from tests.tables import read_table

PAPER = (250, 249, 246)
FLAT = tk.SubTerrain(terrain="flat")


def texts_of(monkeypatch, *arguments, **options):
    """Return the texts that a preview has."""
    texts = []
    monkeypatch.setattr(cv2, "putText", lambda *put: texts.append(put[1]))
    render_preview(*arguments, **options)
    return texts


def map_of(*terrains, rows=1, cols=1, border=0.0, **options):
    config = tk.MapConfig(rows=rows, cols=cols, border=border, terrains=terrains, **options)
    return tk.generate(config)


def slope(*, inverted):
    return tk.SubTerrain(terrain="pyramid_slope", parameters={"inverted": inverted})


def color_bar(picture):
    return picture[ABOVE:-BELOW, -RIGHT + 20 : -RIGHT + 42].astype(int)


@pytest.fixture(scope="module")
def pits():
    """Make three rows along x and one column along y; only the last row has a deep pit."""
    return map_of(tk.SubTerrain(terrain="pit", parameters={"side": 6.0}), rows=3, border=1.0)


def test_preview_has_x_to_the_right_and_y_up(pits):
    picture = render_preview(pits, 520)  # 26 m along x: 20 px for a meter
    first, last = (picture[ABOVE + 100, LEFT + 50 + row * 160].astype(int) for row in (0, 2))
    assert np.abs(last - first).max() > 40
    assert (picture[:, :LEFT] != PAPER).any()  # labels
    bowl = dataclasses.replace(slope(inverted=True), name="bowl")
    # 8 m x 16 m in 256 px x 320 px: 20 px for a meter.
    picture = render_preview(map_of(FLAT, bowl, cols=2, difficulty_range=(1.0, 1.0)), 256)
    top, bottom = (picture[ABOVE + 30 + i, LEFT + 30].astype(int) for i in (80, 240))
    assert bottom.tolist() == shaded_relief(np.zeros((3, 3), np.float32), 0.1)[1, 1].tolist()
    assert np.abs(top - bottom).max() > 40


@pytest.mark.parametrize("width", [100, 260, 261, 1600])
def test_preview_has_the_width(pits, width):
    assert render_preview(pits, width).shape[1] == LEFT + width + RIGHT


@pytest.mark.parametrize(
    ("rows", "cols", "axis", "parts"),
    read_table(__file__, "preview_divides_long_maps_to_fit_a_screen"),
)
def test_preview_divides_long_maps_to_fit_a_screen(rows, cols, axis, parts):
    terrain_map = map_of(FLAT, rows=rows, cols=cols, cell=0.2)
    blocks, found_axis = make_blocks(terrain_map, 1600)
    assert (found_axis, len(blocks)) == (axis, parts)
    patches = [(row, col) for block in blocks for row in block.rows for col in block.cols]
    assert sorted(patches) == [*np.ndindex(rows, cols)]
    seen = np.zeros(terrain_map.heights.shape)
    for block in blocks:
        seen[block.cells] += 1
        assert block.pixels(block.grid.lower).tolist() == [0, block.size[1]]
        assert block.pixels(block.grid.upper).tolist() == [block.size[0], 0]
    assert (seen == 1).all()
    height, width, _ = render_preview(terrain_map, 1600).shape
    assert height <= ABOVE + 2000 + BELOW + 2
    assert width <= LEFT + 1600 + RIGHT + 2
    assert max(height / (ABOVE + 2000 + BELOW), width / (LEFT + 1600 + RIGHT)) > 0.9


@pytest.mark.parametrize(("rows", "cols"), [(1, 40), (40, 1), (3, 3)])
def test_map_in_a_notebook_is_a_picture_of_limited_size(rows, cols):
    data = map_of(FLAT, rows=rows, cols=cols, border=20.0)._repr_jpeg_()
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert 700 <= max(picture.shape) <= ABOVE + 1000 + BELOW + 250


def test_color_levels_are_ends_and_color_stops():
    assert color_levels(-10.2, 0.3) == pytest.approx([-10.2, -10.0, -1.5, -0.4, 0.0, 0.3])
    assert color_levels(0.0, 0.0).tolist() == [0.0]


def test_height_colors_are_linear_between_stops():
    found = height_colors(np.array([-20.0, -0.2, 0.0, 0.95, 9.0]))
    expected = [(24, 22, 20), (187, 183.5, 172.5), (224, 221, 208), (189, 141, 95), (98, 48, 36)]
    np.testing.assert_allclose(found, expected)


def test_color_scale_is_centered_where_the_heights_are():
    near = np.r_[-2.0, np.zeros(98), 0.5]
    assert (map_levels(near) == LEVELS).all()
    assert (map_levels(np.full(9, 0.3)) == LEVELS).all()
    # Between 2 % and 98 %: 502 m to 598 m, 48 m around the median, where the colors end at 4 m.
    hill = map_levels(np.arange(500.0, 601.0))
    np.testing.assert_allclose(hill, [430, 532, 545.2, 550, 554.8, 568, 598])
    levels = [500, 532, 545.2, 550, 554.8, 568, 598, 600]
    assert color_levels(500, 600, hill) == pytest.approx(levels)
    # 0 m remains the center of ground that begins there, such as a coast: 98 m at 98 %.
    np.testing.assert_allclose(map_levels(np.arange(101.0)), 24.5 * LEVELS)
    np.testing.assert_allclose(map_levels(-np.arange(101.0)), 9.8 * LEVELS)


def test_preview_of_ground_far_from_0_has_several_colors():
    flat = map_of(FLAT)
    wave = 5 * np.sin(np.arange(80) / 12)[:, None] * np.ones(80)
    bars, ground = [], []
    for height in (500.0, -70.0):
        raised = dataclasses.replace(flat, heights=(height + wave).astype(np.float32))
        picture = render_preview(raised, 320)
        bars.append(color_bar(picture)[2:-2, 5])
        ground.append(picture[ABOVE + 40, LEFT + 10 : LEFT + 310].astype(int))
    assert np.ptp(ground[0], axis=0).min() > 80
    assert np.abs(ground[0] - ground[1]).max() <= 1
    assert np.ptp(bars[0], axis=0).min() > 80


def test_shaded_relief_is_brighter_toward_the_light():
    grid = np.indices((5, 5)) * np.float32(0.01)
    color = height_colors(np.array(0.02))
    # The light comes from (-0.55, 0.45, 0.7); the slopes are -0.1 along x and 0.2 along y.
    heights = (2 * grid[1] - grid[0]).astype(np.float32)
    shade = (0.7 - 0.55 * 0.1 - 0.45 * 0.2) / 0.7 / np.sqrt(1 + 0.1**2 + 0.2**2)
    assert shaded_relief(heights, 0.1)[2, 2] == pytest.approx(color * shade - 0.5, abs=0.5)


def test_preview_height_scale_includes_the_tops_of_solids(solid_map):
    lifted = solid_map.solids.transform(np.eye(3), np.array([0.0, 0.0, 3.0]))
    # The top of the cylinder is the highest.
    for solids, top in ((Solids.empty(), 0.0), (solid_map.solids, 0.7), (lifted, 3.7)):
        bar = color_bar(render_preview(dataclasses.replace(solid_map, solids=solids), 400))
        assert bar[2, 5] == pytest.approx(height_colors(np.array(top)), abs=4)


@pytest.mark.parametrize(
    ("inverted", "heights"), [(False, (1.0, 0.4, 0.0)), (True, (0.0, -0.4, -1.0))]
)
def test_preview_height_scale_has_the_colors_of_heights(inverted, heights):
    terrain_map = map_of(slope(inverted=inverted), border=20.0, difficulty_range=(1.0, 1.0))
    picture = render_preview(terrain_map, 400)
    bar = color_bar(picture)
    found = bar[[2, len(bar) // 2, -3], 10]  # row 0 is the highest
    assert np.abs(found - height_colors(np.array(heights))).max() < 8
    assert (picture[ABOVE:-BELOW, -80:] != PAPER).any()  # tick labels


def test_write_preview_keeps_existing_file(pits, tmp_path):
    path = write_preview(pits, tmp_path / "a.png", width=300)
    assert (cv2.imread(str(path))[..., ::-1] == render_preview(pits, 300)).all()
    path.write_text("mine")
    with pytest.raises(ExportError, match="exists"):
        write_preview(pits, path)
    assert path.read_text() == "mine"
    assert write_preview(pits, path, overwrite=True).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(("name", "width", "said"), read_table(__file__, "write_preview_rejects"))
def test_write_preview_rejects_invalid_input(pits, tmp_path, name, width, said):
    (tmp_path / "file").write_text("")
    with pytest.raises(ExportError, match=said):
        write_preview(pits, tmp_path / name, width=width)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def render_with(terrain_map, solids, goals=np.nan, routes=()):
    """Return a function that returns the color at a position of a map with 100 px for a meter."""
    goals = np.full_like(terrain_map.goals, goals) if np.isscalar(goals) else goals
    changed = dataclasses.replace(terrain_map, solids=solids, goals=goals)
    extent = changed.grid.size
    assert extent[0] == pytest.approx(7.0)
    picture = render_preview(changed, round(100 * max(7.0, extent[1] / 1.25)), routes)
    bottom = picture.shape[0] - BELOW

    def pixel(x, y):
        return picture[bottom - round((y + 0.5) * 100), LEFT + round((x + 0.5) * 100)].astype(int)

    return pixel


def test_preview_draws_solids_and_goals(solid_map):
    bare = render_with(solid_map, Solids.empty())
    drawn = render_with(solid_map, solid_map.solids, solid_map.goals)
    # The color at the center of the box mixes the colors of its top and the ground.
    expected = 0.75 * height_colors(np.array(0.6)) + 0.25 * bare(1, 6)
    assert drawn(1, 6) == pytest.approx(expected, abs=2)
    assert (drawn(3, 1) == bare(3, 1)).all()
    assert (drawn(3.1, 6) != bare(3.1, 6)).any()  # the arrow of a goal


def test_preview_draws_the_solid_with_the_highest_top_last(solid_map):
    # A pillar of 1 m leads through a slab from 0.4 m to 0.6 m.
    solids = make_boxes([(1, 6, 0.5), (1, 6, 0.5)], [(0.5, 0.5, 1.0), (1.5, 1.5, 0.2)])
    slab = 0.75 * height_colors(np.array(0.6)) + 0.25 * render_with(solid_map, Solids.empty())(1, 6)
    expected = 0.75 * height_colors(np.array(1.0)) + 0.25 * slab
    assert render_with(solid_map, solids)(1, 6) == pytest.approx(expected, abs=2)


def test_preview_draws_spawns_and_routes(solid_map):
    def route(y, place, *, is_passable):
        points = np.array([[1.0, y], [3.0, y]])
        return Route(points=points, place=place, label="no", is_passable=is_passable)

    routes = [route(1.0, (2.0, 1.0), is_passable=True), route(3.0, (5.0, 3.0), is_passable=False)]
    color = render_with(solid_map, Solids.empty(), routes=routes)
    x, y, _ = solid_map.env_origins[0, 0]
    assert color(x, y).tolist() == [196, 40, 40]
    assert color(1.5, 1).tolist() == [30, 120, 60]
    assert color(1.5, 3).tolist() == color(5, 3).tolist() == [200, 30, 30]
    label = [color(5 + dx / 100, 3 + dy / 100) for dx in range(10, 30) for dy in range(6, 17)]
    assert [40, 40, 46] in np.array(label).tolist()
    assert color(5.08, 3.05).tolist() == list(PAPER)  # the box of the label
    # A dot of 5 px and a cross of 14 px.
    assert color(2.02, 1.03).tolist() == [30, 120, 60]
    assert color(5.05, 3.0).tolist() != [200, 30, 30]


def test_labels_of_routes_are_within_the_picture(solid_map):
    at = tuple(np.array(solid_map.grid.upper) - 0.02)
    route = Route(points=np.array([at, at]), place=at, label="no path", is_passable=False)
    picture = render_preview(solid_map, 700, [route])
    x, y = picture.shape[1] - RIGHT, slice(ABOVE + 3, ABOVE + 20)
    assert (picture[y, x - 60 : x - 4] == (40, 40, 46)).all(axis=-1).any()
    assert (picture[y, x : x + 19] == PAPER).all()  # up to the color bar


@pytest.mark.parametrize(("friction", "spacing"), [(0.2, 10), (0.69, 20), (0.0, 6)])
def test_ground_with_its_own_friction_is_hatched(monkeypatch, friction, spacing):
    usual, slippery = map_of(FLAT), map_of(dataclasses.replace(FLAT, friction=friction))
    line = render_preview(slippery, 320)[ABOVE + 10, LEFT + 10 : LEFT + 210]
    dark = np.flatnonzero((line == (40, 40, 46)).all(axis=1))
    assert np.diff(dark).tolist() == [spacing] * (len(dark) - 1)
    assert (line[dark + 1] == PAPER).all()
    assert np.ptp(render_preview(usual, 320)[ABOVE + 10, LEFT + 10 : LEFT + 210], axis=0).max() == 0
    assert f"friction {friction:.2f}" in texts_of(monkeypatch, slippery)
    assert not any("friction" in text for text in texts_of(monkeypatch, usual))
    assert any(
        "friction 0.5," in text for text in texts_of(monkeypatch, map_of(FLAT, static_friction=0.5))
    )


def test_solids_with_their_own_friction_are_hatched(monkeypatch, solid_map):
    # Of the four solids, a box has a friction of 0.3: 12 px.
    assert [t for t in texts_of(monkeypatch, solid_map) if "friction" in t] == ["friction 0.30"]
    monkeypatch.undo()
    color = render_with(solid_map, solid_map.solids)
    dark = [i for i in range(24) if color(0.88 + i / 100, 6).tolist() == [40, 40, 46]]
    assert np.diff(dark).tolist() == [12]


def test_imported_maps_have_no_difficulty_and_no_seed(monkeypatch, pits):
    texts = texts_of(monkeypatch, pits)
    assert {"rows (x): difficulty", "2: d 1.00"} < {*texts}
    config = dataclasses.replace(pits.config, mode="custom")
    texts = texts_of(monkeypatch, dataclasses.replace(pits, config=config))
    assert {"rows (x)", "2", "3 x 1 patches of 8 m x 8 m"} < {*texts}
    assert not any("d 1.00" in text or "seed" in text for text in texts)


def test_storey_has_its_floor_at_the_ground_and_walls_up_to_the_cut():
    house = tk.SubTerrain(terrain="building", parameters={"storeys": 2, "riser": 0.15})
    terrain_map = map_of(house)
    for storey, floor in enumerate((0.0, 2.4)):
        shown = storey_map(terrain_map, storey)
        assert shown.solids.bounds()[1][:, 2].max() == pytest.approx(1.2, abs=1e-4)
        x, y, *_ = shown.goals[~np.isnan(shown.goals[..., 0])][-1].tolist()
        # There is no wall at a goal, and the floor above is not shown.
        assert shown.scan([x, y, 9.0]) == pytest.approx(0.0, abs=1e-4)
        assert terrain_map.scan([x, y, floor + 1.0]) == pytest.approx(floor, abs=1e-4)
        # The middle of the outer wall at low y, 0.12 m thick.
        assert shown.scan([5.0, 0.06, 9.0]) == pytest.approx(1.2, abs=1e-4)
    with pytest.raises(ConfigError, match="storey: got 2; expected 0 to 1"):
        storey_map(terrain_map, 2)
    with pytest.raises(ConfigError, match="storey: got 0; expected a map with buildings"):
        storey_map(map_of(FLAT), 0)


def test_preview_shades_tilted_solids_and_hatches_hanging_ones(solid_map):
    roll = np.pi / 6
    solids = make_boxes([(1, 6, 0.5), (3, 6, 0.5)], (1.0, 1.0, 0.2), rpy=[(0, 0, 0), (roll, 0, 0)])
    standing = make_boxes([(1, 6, 0.0), (3, 6, 0.0)], (1.0, 1.0, 1.0))
    bare, drawn = (render_with(solid_map, each) for each in (Solids.empty(), solids))
    # The normal (0, -sin, cos) turns away from the light.
    shade = (np.cos(roll) * LIGHT[2] - np.sin(roll) * LIGHT[1]) / LIGHT[2]
    top = 0.5 + 0.1 * np.cos(roll)
    expected = 0.75 * height_colors(np.array(top)) * shade + 0.25 * bare(2, 6)
    edge = 0.75 * 0.6 * height_colors(np.array(0.6)) + 0.25 * bare(1, 6)
    line = [(x / 100, 6.05) for x in range(285, 315)]
    tilted = np.array([drawn(x, y) for x, y in line])
    assert (np.abs(tilted - expected).max(axis=1) < 4).sum() > 20
    level = np.array([drawn(x - 2, y) for x, y in line])
    dark = np.abs(level - edge).max(axis=1) < 4
    assert 4 <= dark.sum() <= 6  # two of twelve pixels
    below = render_with(solid_map, standing)
    assert len(np.unique([below(x - 2, y) for x, y in line], axis=0)) == 1


def test_preview_numbers_goals_in_order_where_there_is_space():
    lane = tk.SubTerrain(terrain="hurdles")
    terrain_map = map_of(lane)
    texts = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cv2, "putText", lambda *put: texts.append((put[1], put[2][0])))
        render_preview(terrain_map, 800)
        numbers = [each for each in texts if each[0].isdigit()]
        assert numbers == [("1", 372), ("2", 542), ("3", 712)]  # goals at 3.7, 5.4 and 7.1 m
        assert ("scale not", 20) not in texts  # 0 to 5 cm
        texts.clear()
        # 8 px for a meter: 13.6 px from goal to goal.
        render_preview(map_of(lane, rows=20, cols=20), 1280)
        assert {text for text, _ in texts if text.isdigit()} == {"1", "3"}
        assert ("scale not", 20) in texts  # 0 to 50 cm, with a change of the slope at 40 cm
