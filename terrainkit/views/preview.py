"""Preview: a shaded relief of a map with labels, spawn origins, solids and goals."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ExportError
from terrainkit.export.requirements import require_finite
from terrainkit.files.atomic_write import atomic_write
from terrainkit.geometry.solids import Solids
from terrainkit.views.preview_layout import ABOVE, BELOW, LEFT, RIGHT, Block, make_blocks
from terrainkit.views.storey import storey_map

if TYPE_CHECKING:
    from terrainkit.geometry.mesh.tri_mesh import TriMesh
    from terrainkit.map.map_config import MapConfig
    from terrainkit.map.terrain_map import TerrainMap

Picture = NDArray[np.uint8]
Levels = NDArray[np.float64]

_COLORS = (
    (-10.0, (24, 22, 20)),
    (-1.5, (83, 80, 74)),
    (-0.4, (150, 146, 137)),
    (0.0, (224, 221, 208)),
    (0.4, (214, 178, 128)),
    (1.5, (164, 104, 62)),
    (4.0, (98, 48, 36)),
)
"""Color (red, green, blue) by height [m]: gray below 0, which does not look like water, and brown
above. The differences between neighbors are 27 to 29 in CIELAB, the same for the eye."""

LEVELS = np.array([level for level, _ in _COLORS])
"""Heights of the colors of generated maps [m]."""

_NEAR = 0.4
"""Distance of all heights from 0 above which the colors are relative to the median height [m]."""

_TEXT_COLOR = (40, 40, 46)
_SPAWN_COLOR = (196, 40, 40)
_GOAL_COLOR = (40, 90, 160)
_PASSABLE_COLOR, _IMPASSABLE_COLOR = (30, 120, 60), (200, 30, 30)
_SOLID_OPACITY = 0.75
_BACKGROUND = (250, 249, 246)
_HATCH = 12
"""Distance between the hatching lines of hanging solids along an axis [px]."""

_FRICTION_HATCH = np.array([6.0, 20.0])
"""Distance between the hatching lines of a friction of 0, and what a friction of 1 adds [px]."""

_HANGING = 0.02
"""Height above the ground below its center from which a solid hangs [m]."""

_GOAL_DISTANCE = 14
"""Smallest distance of the numbers of two goals [px]."""

_BAR_WIDTH, _MAX_BAR_HEIGHT = 22, 500
"""Size of the color bar [px]; it is lower where the relief is."""

MAX_PIXELS = 10_000
"""Largest width of the relief [px]."""

NOTEBOOK_PIXELS = 800
"""Width of the relief in notebooks [px]."""

_LABEL_HEIGHT, _LABEL_WIDTH = 18, 80
"""Size of a label [px]; where patches are smaller, only some are labeled."""

LIGHT = np.array([-0.55, 0.45, 0.7])
"""Direction of the light: the upper left, as is usual for shaded maps."""

MIN_SHADE, MAX_SHADE = 0.35, 1.25
"""Range of the brightness of slopes; level ground has 1."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Route:
    """A path of a robot over a patch."""

    points: NDArray[np.float64]
    """Points of the path, x and y [m], shape (n, 2)."""

    place: tuple[float, float]
    """Position of the mark, x and y [m]."""

    label: str
    """Text beside the mark."""

    is_passable: bool
    """Whether the path is drawn in green, not in red."""


def write_preview(
    terrain_map: "TerrainMap",
    path: str | Path,
    *,
    width: int = 1600,
    overwrite: bool = False,
    routes: Sequence[Route] = (),
    storey: int | None = None,
) -> Path:
    """Write the preview of `terrain_map` to the .png file `path`, and return `path`.

    Args:
        terrain_map: The map.
        path: Target.
        width: Width of the relief [px]. A tall map is narrower, and a long map is divided.
        overwrite: Replace an existing file.
        routes: Paths to draw.
        storey: Draw only this storey of buildings, 0 for the ground floor; None for all.

    Raises:
        ConfigError: if no building has this storey.
        ExportError: if the suffix is not .png, or the target cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".png":
        raise ExportError(f"preview: got {path}; expected a .png file")
    if not 100 <= width <= MAX_PIXELS:
        raise ExportError(f"width: got {width}; expected 100 to {MAX_PIXELS}")
    require_finite(terrain_map)
    terrain_map = terrain_map if storey is None else storey_map(terrain_map, storey)
    with atomic_write(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(_encode(render_preview(terrain_map, width, routes), ".png"))
    return path


def notebook_preview(terrain_map: "TerrainMap") -> bytes:
    """Return the preview as a JPEG, in the size of a notebook's output; a PNG is 4 times as big."""
    return _encode(render_preview(terrain_map, NOTEBOOK_PIXELS), ".jpg")


def _encode(image: Picture, suffix: str) -> bytes:
    import cv2

    options = [cv2.IMWRITE_JPEG_QUALITY, 75] if suffix == ".jpg" else []
    _, data = cv2.imencode(suffix, cv2.cvtColor(image, cv2.COLOR_RGB2BGR), options)
    return bytes(data)


def render_preview(
    terrain_map: "TerrainMap", width: int = 1600, routes: Sequence[Route] = ()
) -> Picture:
    """Return the preview as an RGB image, shape (height, width, 3): x to the right, y up."""
    blocks, axis = make_blocks(terrain_map, width)
    levels = map_levels(terrain_map.heights)
    pictures = [_draw_block(terrain_map, block, routes, levels) for block in blocks]
    sizes = np.array([picture.shape[:2] for picture in pictures])
    height, span = np.where(np.arange(2) == axis, sizes.sum(axis=0), sizes.max(axis=0)).tolist()
    image = np.full((height + ABOVE, span + RIGHT, 3), _BACKGROUND, dtype=np.uint8)
    corner = [ABOVE, 0]
    for picture in pictures:
        y, x = corner
        image[y : y + picture.shape[0], x : x + picture.shape[1]] = picture
        corner[axis] += picture.shape[axis]
    _write(image, "columns (y): terrain", (10, ABOVE - 14))
    _write(image, map_title(terrain_map.config), (LEFT, 40), 0.7)
    tops = terrain_map.solids.bounds()[1][:, 2]  # the color of a solid shows the height of its top
    shown = [terrain_map.heights[block.cells] for block in blocks]
    low = min([*(float(heights.min()) for heights in shown), tops.min(initial=np.inf)])
    high = max([*(float(heights.max()) for heights in shown), tops.max(initial=-np.inf)])
    _draw_color_bar(image[:, span:], low, high, blocks[0].size[1], levels)
    _draw_legend(image[-26:-6, LEFT:], terrain_map, has_routes=bool(routes))
    return image


def _draw_block(
    terrain_map: "TerrainMap", block: Block, routes: Sequence[Route], levels: Levels
) -> Picture:
    """Return the picture of a block with its labels to the left and below."""
    width, height = block.size
    relief = _relief(terrain_map.heights[block.cells], block, levels)
    friction = terrain_map.friction[block.cells].T[::-1]
    nearest = (np.arange(n) * m // n for n, m in zip(block.size[::-1], friction.shape, strict=True))
    friction = friction[np.ix_(*nearest)]
    _draw_solids(relief, friction, terrain_map, block, levels)
    hatch_friction(relief, friction, terrain_map.config.static_friction)
    _draw_poses(relief, terrain_map, block)
    for route in routes:
        _draw_route(relief, route, block)
    picture = np.full((height + BELOW, LEFT + width, 3), _BACKGROUND, dtype=np.uint8)
    picture[:height, LEFT:] = relief
    _draw_labels(picture, terrain_map, block)
    return picture


def _relief(heights: NDArray[np.float32], block: Block, levels: Levels) -> Picture:
    """Return the relief of the heights of a block in its size: averages, or a square per sample."""
    import cv2

    width, height = block.size
    if width < heights.shape[0]:
        # OpenCV's x is the second index.
        heights = cv2.resize(heights, (height, width), interpolation=cv2.INTER_AREA)
        heights = np.asarray(heights, dtype=np.float32).reshape(width, height)
    cell = max(block.grid.cell, 1 / block.scale)
    relief = np.ascontiguousarray(shaded_relief(heights, cell, levels).swapaxes(0, 1)[::-1])
    resized = cv2.resize(relief, (width, height), interpolation=cv2.INTER_NEAREST)
    return np.asarray(resized, dtype=np.uint8)


def shaded_relief(heights: NDArray[np.float32], cell: float, levels: Levels = LEVELS) -> Picture:
    """Return the heights as a colored relief with Lambertian shading, shape (nx, ny, 3).

    Args:
        heights: Heights [m], shape (nx, ny).
        cell: Distance between two samples [m].
        levels: Heights of the colors [m].
    """
    padded = np.pad(heights, 1, mode="edge")
    slope_x = (padded[2:, 1:-1] - padded[:-2, 1:-1]) / (2 * cell)
    slope_y = (padded[1:-1, 2:] - padded[1:-1, :-2]) / (2 * cell)
    light = LIGHT / np.linalg.norm(LIGHT)
    steepness = np.sqrt(slope_x**2 + slope_y**2 + 1)
    shade = (light[2] - light[0] * slope_x - light[1] * slope_y) / steepness / light[2]
    return shaded_colors(height_colors(heights, levels), shade).astype(np.uint8)


def shaded_colors(colors: NDArray[np.floating], shade: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return colors at a brightness.

    Args:
        colors: Red, green and blue, 0 to 255, shape (..., 3) or (3,).
        shade: Brightness relative to level ground, shape (...).

    Returns:
        Red, green and blue, 0 to 255, shape (..., 3).
    """
    brightness = np.clip(shade, MIN_SHADE, MAX_SHADE)[..., None]
    return np.asarray(np.clip(colors * brightness, 0, 255))


def map_levels(heights: NDArray[np.floating]) -> Levels:
    """Return the heights of the colors of a map [m], ascending.

    They are the levels of generated maps, unless this ground would have the colors of one end only.

    Args:
        heights: Heights of the map [m].
    """
    bottom, low, middle, high, top = np.percentile(heights, (0, 2, 50, 98, 100)).tolist()
    center = 0.0 if bottom <= _NEAR and top >= -_NEAR else middle
    factor = max(1.0, (low - center) / float(LEVELS[0]), (high - center) / float(LEVELS[-1]))
    return np.asarray(center + factor * LEVELS)


def height_colors(heights: NDArray[np.floating], levels: Levels = LEVELS) -> NDArray[np.float64]:
    """Return the colors of heights.

    Args:
        heights: Heights [m], any shape (...).
        levels: Heights of the colors [m].

    Returns:
        Red, green and blue, 0 to 255, shape (..., 3).
    """
    channels = zip(*(color for _, color in _COLORS), strict=True)
    return np.stack([np.interp(heights, levels, channel) for channel in channels], axis=-1)


def map_title(config: "MapConfig") -> str:
    """Return the title of the pictures of a map: its size, its friction if not 1, and its seed."""
    size_x, size_y = config.patch_size
    patches = f"{config.rows} x {config.cols} patches of {size_x:g} m x {size_y:g} m"
    friction = "" if config.static_friction == 1 else f", friction {config.static_friction:g}"
    seed = "" if config.mode == "custom" else f", seed {config.seed}"
    return patches + friction + seed


def hatch_friction(picture: Picture, friction: NDArray[np.float32], usual: float) -> None:
    """Hatch a picture where the friction is not the usual one: the lower it is, the denser.

    The lines have the other direction than those of hanging solids.

    Args:
        picture: The picture, which is changed, shape (height, width, 3).
        friction: Friction of each pixel, shape (height, width).
        usual: Friction of the map.
    """
    spacing = np.rint(np.minimum(friction, 10.0) * _FRICTION_HATCH[1] + _FRICTION_HATCH[0])
    row, col = np.ogrid[: friction.shape[0], : friction.shape[1]]
    line = np.where(friction == np.float32(usual), -1, (col - row) % spacing)
    picture[line == 0] = _TEXT_COLOR  # dark beside light, to be visible on any ground
    picture[line == 1] = _BACKGROUND


def own_frictions(terrain_map: "TerrainMap") -> NDArray[np.float32]:
    """Return the frictions of the ground and the solids that are not the map's, ascending."""
    usual = np.float32(terrain_map.config.static_friction)
    ground, solids = terrain_map.friction, terrain_map.solids.friction
    own = ground[ground != usual], solids[(solids != usual) & ~np.isnan(solids)]
    return np.unique(np.concatenate(own))


def _draw_legend(image: Picture, terrain_map: "TerrainMap", *, has_routes: bool) -> None:
    """Explain the hatching and the routes in a line; of many frictions, three."""
    frictions, x = own_frictions(terrain_map), 0
    for friction in np.unique(frictions[[0, len(frictions) // 2, -1]] if len(frictions) else []):
        swatch = image[:, x : x + 50]
        hatch_friction(swatch, np.full(swatch.shape[:2], friction, np.float32), np.nan)
        _write(image, f"friction {friction:.2f}", (x + 56, 16))
        x += 170
    if _is_hanging(terrain_map, terrain_map.solids).any():
        _write(image, "/// hangs", (x, 16))
        x += 100
    if has_routes:
        _write(image, "green: can be crossed; red cross: cannot be crossed", (x, 16))


def color_levels(low: float, high: float, levels: Levels = LEVELS) -> NDArray[np.float64]:
    """Return the heights of the ticks of a color bar [m], ascending.

    They are both ends, and the levels in between at which the color scale changes its slope. The
    intervals have the same length on the bar, so that a deep hole does not fill it.

    Args:
        low: Lowest height [m].
        high: Highest height [m].
        levels: Heights of the colors [m].
    """
    inner = [level for level in levels.tolist() if low < level < high]
    return np.unique([low, *inner, high])


def _draw_color_bar(image: Picture, low: float, high: float, length: int, levels: Levels) -> None:
    """Draw the color bar of heights from `low` to `high` [m] into the right margin `image`.

    It is as long as the relief, `length` [px], but limited.
    """
    marks = color_levels(low, high, levels)
    height = min(length - 1, _MAX_BAR_HEIGHT)
    ticks = np.linspace(height, 0, len(marks))
    rows = np.interp(np.arange(height + 1), ticks[::-1], marks[::-1])
    bar = image[ABOVE : ABOVE + height + 1, 20 : 20 + _BAR_WIDTH]
    bar[:] = height_colors(rows, levels)[:, None]
    bar[[0, -1]] = bar[:, [0, -1]] = _TEXT_COLOR
    every = max(1, math.ceil(_LABEL_HEIGHT * len(marks) / (height + 1)))
    for row, level in list(zip(ticks.round().astype(int).tolist(), marks, strict=True))[::every]:
        image[ABOVE + row, 20 + _BAR_WIDTH : 26 + _BAR_WIDTH] = _TEXT_COLOR
        y = ABOVE + min(max(row + 5, 11), length - 2)
        _write(image, f"{level:.2f} m".replace("-0.00", "0.00"), (32 + _BAR_WIDTH, y))
    if len(marks) > 2 and np.ptp(np.diff(marks)) > 1e-3:
        _write(image, "scale not", (20, ABOVE - 26))
        _write(image, "linear", (20, ABOVE - 10))


def _write(
    image: Picture,
    text: str,
    at: tuple[int, int],
    size: float = 0.5,
    color: tuple[int, int, int] = _TEXT_COLOR,
) -> None:
    import cv2

    cv2.putText(image, text, at, cv2.FONT_HERSHEY_SIMPLEX, size, color, 1, cv2.LINE_AA)


def _draw_solids(
    image: Picture,
    frictions: NDArray[np.float32],
    terrain_map: "TerrainMap",
    block: Block,
    levels: Levels,
) -> None:
    """Draw each solid: its upper facets, shaded, in the color of their height; the highest last.

    The ground shows through. Solids that hang above the ground are hatched. `frictions`, the
    friction of the ground in each pixel, becomes that of the solids that have their own.
    """
    import cv2

    from terrainkit.geometry.mesh.solid_mesh import solid_meshes

    lower, upper = (corner[:, :2] for corner in terrain_map.solids.bounds())
    is_near = np.all((lower < block.grid.upper) & (upper > block.grid.lower), axis=1)
    solids = terrain_map.solids.select(np.asarray(is_near))
    hanging = _is_hanging(terrain_map, solids)
    meshes = zip(solid_meshes(solids), hanging, solids.friction.tolist(), strict=True)
    for mesh, hangs, friction in sorted(meshes, key=lambda item: item[0].vertices[:, 2].max()):
        outline = cv2.convexHull(block.pixels(mesh.vertices[:, :2]))
        first = np.maximum(outline.min(axis=(0, 1)), 0)
        x, y = first.tolist()
        last_x, last_y = (outline.max(axis=(0, 1)) + 1).tolist()
        window = image[y:last_y, x:last_x]
        if not window.size:
            continue
        layer = window.copy()
        for points, color in _facets(mesh, levels):
            facet = cv2.convexHull(block.pixels(points[:, :2])) - first
            cv2.fillConvexPoly(layer, facet, color.tolist(), cv2.LINE_AA)
        edge = height_colors(mesh.vertices[:, 2].max(), levels) * 0.6
        if hangs:
            inside = cv2.fillConvexPoly(np.zeros(layer.shape[:2], np.uint8), outline - first, 1)
            i, j = np.indices(inside.shape)
            layer[(inside > 0) & ((x + j + y + i) % _HATCH < 2)] = edge
        window[:] = cv2.addWeighted(layer, _SOLID_OPACITY, window, 1 - _SOLID_OPACITY, 0)
        cv2.polylines(image, [outline], True, edge.tolist(), 1, cv2.LINE_AA)
        if not math.isnan(friction):
            cv2.fillConvexPoly(frictions, outline, friction)


def _is_hanging(terrain_map: "TerrainMap", solids: Solids) -> NDArray[np.bool_]:
    """Return whether each solid hangs above the ground below its center."""
    lower, upper = solids.bounds()
    ground = terrain_map.height((lower + upper)[:, :2] / 2)
    return np.asarray(lower[:, 2] > ground + _HANGING)


def _facets(
    mesh: "TriMesh", levels: Levels
) -> Iterator[tuple[NDArray[np.float32], NDArray[np.float64]]]:
    """Yield the points of each upper facet of a convex mesh, and its color."""
    z, top = mesh.vertices[:, 2], mesh.vertices[:, 2].max()
    is_top = z > top - 1e-4
    if (np.ptp(mesh.vertices[is_top, :2], axis=0) >= np.ptp(mesh.vertices[:, :2], axis=0)).all():
        yield mesh.vertices[is_top], height_colors(top, levels)  # most solids have a level top
        return
    corners = mesh.vertices[mesh.triangles].astype(float)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    light = LIGHT / LIGHT[2]
    for facet in np.unique(normal[normal[:, 2] > 1e-3].round(3), axis=0):
        points = mesh.vertices[mesh.triangles[(np.abs(normal - facet) < 1e-3).all(axis=1)].ravel()]
        color = height_colors(points[:, 2].mean(), levels)
        yield points, shaded_colors(color, np.asarray(facet @ light))


def _draw_labels(image: Picture, terrain_map: "TerrainMap", block: Block) -> None:
    """Write the names of the columns to the left, and the difficulties of the rows below."""
    config, (_, height) = terrain_map.config, block.size
    is_custom = config.mode == "custom"  # an imported map, which has no difficulty
    size_x, size_y = config.patch_size
    for col in block.cols[:: max(1, math.ceil(_LABEL_HEIGHT / (size_y * block.scale)))]:
        _, y = block.pixels(config.patch_grid(block.rows[0], col).center).tolist()
        is_type = config.mode != "randomized"
        name = terrain_map.terrain_names[terrain_map.terrain_types[0, col]] if is_type else ""
        _write(image, f"{col:>3}  {name}", (10, y + 5))
    for row in block.rows[:: max(1, math.ceil(_LABEL_WIDTH / (size_x * block.scale)))]:
        x, _ = block.pixels(config.patch_grid(row, block.cols[0]).center).tolist()
        low, high = terrain_map.difficulty[row].min(), terrain_map.difficulty[row].max()
        level = f": d {low:.2f}" if low == high else f": d {low:.2f}-{high:.2f}"
        x = min(LEFT + x - 36, image.shape[1] - _LABEL_WIDTH)
        _write(image, f"{row}{'' if is_custom else level}", (x, height + 24))
    _write(image, "rows (x)" if is_custom else "rows (x): difficulty", (10, height + 24))


def _draw_poses(image: Picture, terrain_map: "TerrainMap", block: Block) -> None:
    """Draw the spawn origins, and the goals with their numbers where there is space."""
    import cv2

    radius = max(2, round(block.scale * terrain_map.config.spawn_radius))
    for origin in block.pixels(terrain_map.env_origins[..., :2]).reshape(-1, 2).tolist():
        cv2.circle(image, origin, radius, _BACKGROUND, 3, cv2.LINE_AA)
        cv2.circle(image, origin, radius, _SPAWN_COLOR, 1, cv2.LINE_AA)
        cv2.circle(image, origin, 2, _SPAWN_COLOR, -1, cv2.LINE_AA)
    for row, col in np.ndindex(terrain_map.difficulty.shape):
        goals = terrain_map.goals[row, col].astype(float)
        goals = goals[~np.isnan(goals[:, 0])]
        tips = goals[:, :2] + 0.4 * np.column_stack([np.cos(goals[:, 3]), np.sin(goals[:, 3])])
        last = np.full(2, -_GOAL_DISTANCE)
        arrows = np.stack([block.pixels(goals[:, :2]), block.pixels(tips)], axis=1)
        for number, (at, tip) in enumerate(arrows.tolist(), start=1):
            cv2.arrowedLine(image, at, tip, _GOAL_COLOR, 1, cv2.LINE_AA, tipLength=0.4)
            if len(goals) > 1 and np.abs(at - last).max() >= _GOAL_DISTANCE:
                last = np.array(at)
                _write(image, f"{number}", (at[0] + 2, at[1] - 5), 0.45, _GOAL_COLOR)


def _draw_route(image: Picture, route: Route, block: Block) -> None:
    """Draw a path, and its mark with the label in a box to the right, within the picture."""
    import cv2

    color = _PASSABLE_COLOR if route.is_passable else _IMPASSABLE_COLOR
    cv2.polylines(image, [block.pixels(route.points)], False, color, 2, cv2.LINE_AA)
    x, y = block.pixels(route.place).tolist()
    if route.is_passable:
        cv2.circle(image, (x, y), 5, color, -1, cv2.LINE_AA)
    else:
        cv2.drawMarker(image, (x, y), color, cv2.MARKER_TILTED_CROSS, 14, 3, cv2.LINE_AA)
    width = cv2.getTextSize(route.label, cv2.FONT_HERSHEY_SIMPLEX, 0.5, 1)[0][0]
    x, y = min(x + 10, image.shape[1] - width - 4), max(y - 6, 16)
    cv2.rectangle(image, (x - 3, y - 13), (x + width + 3, y + 4), _BACKGROUND, -1)
    _write(image, route.label, (x, y))
