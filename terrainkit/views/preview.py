"""Preview: a shaded relief of a map with labels, spawn origins, solids and goals."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ExportError
from terrainkit.export.requirements import require_finite
from terrainkit.files.atomic_write import atomic_write

if TYPE_CHECKING:
    from terrainkit.map.config import MapConfig
    from terrainkit.map.terrain_map import TerrainMap

Picture = NDArray[np.uint8]

_COLORS = (
    (-10.0, (38, 32, 44)),
    (-1.5, (70, 62, 92)),
    (-0.4, (112, 138, 168)),
    (0.0, (224, 221, 208)),
    (0.4, (214, 178, 128)),
    (1.5, (164, 104, 62)),
    (4.0, (116, 66, 46)),
)
"""Color (red, green, blue) by height [m]: blue below 0, brown above."""

_TEXT_COLOR = (40, 40, 46)
_SPAWN_COLOR = (196, 40, 40)
_GOAL_COLOR = (40, 90, 160)
_PASSABLE_COLOR, _IMPASSABLE_COLOR = (30, 120, 60), (200, 30, 30)
_SOLID_OPACITY = 0.75
_BACKGROUND = (250, 249, 246)
_MARGIN = (250, 60, 130, 70)
"""Margin to the left, below, to the right and above the relief [px]."""

_BAR_WIDTH, _MAX_BAR_HEIGHT = 22, 500
"""Size of the color bar [px]; it is lower where the relief is."""

MAX_PIXELS = 10_000
"""Largest side of the relief [px]."""

NOTEBOOK_PIXELS = 800
"""Approximate length of the longer side of the relief in notebooks [px]."""

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

    place: tuple[float, float] | None
    """Position of the mark, x and y [m]; None for no mark."""

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
) -> Path:
    """Write the preview of `terrain_map` to the .png file `path`, and return `path`.

    Args:
        terrain_map: The map.
        path: Target.
        width: Minimum width of the relief [px].
        overwrite: Replace an existing file.
        routes: Paths to draw.

    Raises:
        ExportError: if the suffix is not .png, or the target cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".png":
        raise ExportError(f"preview: got {path}; expected a .png file")
    if not 100 <= width <= MAX_PIXELS:
        raise ExportError(f"width: got {width}; expected 100 to {MAX_PIXELS}")
    require_finite(terrain_map)
    with atomic_write(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(_png(render_preview(terrain_map, width, routes)))
    return path


def notebook_preview(terrain_map: "TerrainMap") -> bytes:
    """Return the preview as a PNG, in the size of a notebook's output."""
    heights, _ = _without_border(terrain_map)
    # The longer side of the relief is limited.
    width = round(NOTEBOOK_PIXELS * min(1.0, heights.shape[0] / heights.shape[1]))
    return _png(render_preview(terrain_map, max(1, width)))


def _png(image: Picture) -> bytes:
    import cv2

    _, data = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    return bytes(data)


def render_preview(
    terrain_map: "TerrainMap", width: int = 1600, routes: Sequence[Route] = ()
) -> Picture:
    """Return the preview as an RGB image, shape (height, width, 3): x to the right, y up."""
    heights, crop = _without_border(terrain_map)
    cell = terrain_map.config.cell
    extent = heights.shape[0] * cell
    # A tall map is drawn narrower to limit the height of the picture.
    width = max(1, min(width, MAX_PIXELS * heights.shape[0] // heights.shape[1]))
    if heights.shape[0] > width:
        heights, cell = _downsample(heights, width), extent / width
    # Image rows go down. Each sample is a square of whole pixels.
    factor = max(1, min(-(-width // heights.shape[0]), MAX_PIXELS // max(heights.shape)))
    ground = (
        shaded_relief(heights, cell)
        .swapaxes(0, 1)[::-1]
        .repeat(factor, axis=0)
        .repeat(factor, axis=1)
    )
    scale = ground.shape[1] / extent
    left, below, right, above = _MARGIN
    height, span = ground.shape[:2]
    image = np.full((height + above + below, span + left + right, 3), _BACKGROUND, dtype=np.uint8)
    image[above : above + height, left : left + span] = ground
    tops = terrain_map.solids.bounds()[1][:, 2]  # the color of a solid shows the height of its top
    low = min(float(heights.min()), tops.min(initial=np.inf))
    high = max(float(heights.max()), tops.max(initial=-np.inf))
    _draw_color_bar(image[above : above + height, left + span :], low, high)
    zero = (left - crop[0] * scale, above + height + crop[1] * scale)
    _draw_solids(image, terrain_map, scale, zero)
    _draw_labels(image, terrain_map, scale, zero)
    for route in routes:
        _draw_route(image, route, scale, zero)
    return image


def shaded_relief(heights: NDArray[np.float32], cell: float) -> Picture:
    """Return the heights as a colored relief with Lambertian shading, shape (nx, ny, 3).

    Args:
        heights: Heights [m], shape (nx, ny).
        cell: Distance between two samples [m].
    """
    padded = np.pad(heights, 1, mode="edge")
    slope_x = (padded[2:, 1:-1] - padded[:-2, 1:-1]) / (2 * cell)
    slope_y = (padded[1:-1, 2:] - padded[1:-1, :-2]) / (2 * cell)
    light = LIGHT / np.linalg.norm(LIGHT)
    steepness = np.sqrt(slope_x**2 + slope_y**2 + 1)
    shade = (light[2] - light[0] * slope_x - light[1] * slope_y) / steepness / light[2]
    return shaded_colors(height_colors(heights), shade).astype(np.uint8)


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


def height_colors(heights: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the colors of heights.

    Args:
        heights: Heights [m], any shape (...).

    Returns:
        Red, green and blue, 0 to 255, shape (..., 3).
    """
    levels = [level for level, _ in _COLORS]
    channels = zip(*(color for _, color in _COLORS), strict=True)
    return np.stack([np.interp(heights, levels, channel) for channel in channels], axis=-1)


def map_title(config: "MapConfig") -> str:
    """Return the title of the pictures of a map."""
    size_x, size_y = config.patch_size
    patches = f"{config.rows} x {config.cols} patches of {size_x:g} m x {size_y:g} m"
    return f"{patches}, seed {config.seed}"


def _without_border(terrain_map: "TerrainMap") -> tuple[NDArray[np.float32], tuple[float, float]]:
    """Return the heights with 1 m of the border, and their lower corner [m]."""
    config = terrain_map.config
    cut = max(0, config.border_cells - round(1.0 / config.cell))
    heights = terrain_map.heights[cut : len(terrain_map.heights) - cut, :]
    heights = heights[:, cut : heights.shape[1] - cut]
    lower = terrain_map.grid.lower
    return heights, (lower[0] + cut * config.cell, lower[1] + cut * config.cell)


def _downsample(heights: NDArray[np.float32], width: int) -> NDArray[np.float32]:
    """Return the heights averaged to `width` samples along x."""
    import cv2

    other = max(1, round(heights.shape[1] * width / heights.shape[0]))
    # OpenCV's x is the second index.
    shrunk = cv2.resize(heights, (other, width), interpolation=cv2.INTER_AREA)
    return np.asarray(shrunk.reshape(width, other), dtype=np.float32)


def color_levels(low: float, high: float) -> NDArray[np.float64]:
    """Return the heights of the ticks of a color bar [m], ascending.

    They are both ends, and the levels in between at which the color scale changes its slope. The
    intervals have the same length on the bar, so that a deep hole does not fill it.

    Args:
        low: Lowest height [m].
        high: Highest height [m].
    """
    inner = [level for level, _ in _COLORS if low < level < high]
    return np.unique([low, *inner, high])


def _draw_color_bar(image: Picture, low: float, high: float) -> None:
    """Draw the color bar of heights from `low` to `high` [m] into the margin `image`."""
    levels = color_levels(low, high)
    height = min(len(image) - 1, _MAX_BAR_HEIGHT)
    ticks = np.linspace(height, 0, len(levels))
    rows = np.interp(np.arange(height + 1), ticks[::-1], levels[::-1])
    bar = image[: height + 1, 20 : 20 + _BAR_WIDTH]
    bar[:] = height_colors(rows)[:, None]
    bar[[0, -1]] = bar[:, [0, -1]] = _TEXT_COLOR
    every = max(1, math.ceil(_LABEL_HEIGHT * len(levels) / (height + 1)))
    for row, level in list(zip(ticks.round().astype(int).tolist(), levels, strict=True))[::every]:
        image[row, 20 + _BAR_WIDTH : 26 + _BAR_WIDTH] = _TEXT_COLOR
        y = min(max(row + 5, 11), len(image) - 2)
        _write(image, f"{level:.2f} m".replace("-0.00", "0.00"), (32 + _BAR_WIDTH, y))


def _write(image: Picture, text: str, at: tuple[int, int], size: float = 0.5) -> None:
    import cv2

    cv2.putText(image, text, at, cv2.FONT_HERSHEY_SIMPLEX, size, _TEXT_COLOR, 1, cv2.LINE_AA)


def _draw_solids(
    image: Picture, terrain_map: "TerrainMap", scale: float, zero: tuple[float, float]
) -> None:
    """Draw the outline of each solid, filled in the color of its top, the highest one last."""
    import cv2

    from terrainkit.geometry.mesh.solid_mesh import solid_meshes

    for mesh in sorted(solid_meshes(terrain_map.solids), key=lambda m: m.vertices[:, 2].max()):
        corners = np.array(zero) + mesh.vertices[:, :2] * (scale, -scale)
        outline = cv2.convexHull(np.rint(corners).astype(np.int32))
        x, y, width, height = cv2.boundingRect(outline)
        window = image[y : y + height, x : x + width]
        top = height_colors(mesh.vertices[:, 2].max())
        layer = cv2.fillConvexPoly(window.copy(), outline - (x, y), top.tolist(), cv2.LINE_AA)
        # The ground shows through, since a solid may hang above it.
        window[:] = cv2.addWeighted(layer, _SOLID_OPACITY, window, 1 - _SOLID_OPACITY, 0)
        cv2.polylines(image, [outline], True, (top * 0.6).tolist(), 1, cv2.LINE_AA)


def _draw_labels(
    image: Picture, terrain_map: "TerrainMap", scale: float, zero: tuple[float, float]
) -> None:
    import cv2

    config, (rows, cols) = terrain_map.config, terrain_map.difficulty.shape
    first = config.patch_grid(0, 0).lower
    write = partial(_write, image)

    def pixel(x: float, y: float) -> tuple[int, int]:
        return round(zero[0] + x * scale), round(zero[1] - y * scale)

    size_x, size_y = config.patch_size
    by_column = config.mode != "randomized"
    for col in range(0, cols, max(1, math.ceil(_LABEL_HEIGHT / (size_y * scale)))):
        _, y = pixel(0, first[1] + (col + 0.5) * size_y)
        name = terrain_map.terrain_names[terrain_map.terrain_types[0, col]] if by_column else ""
        write(f"{col:>3}  {name}", (10, y + 5))
    for row in range(0, rows, max(1, math.ceil(_LABEL_WIDTH / (size_x * scale)))):
        x, _ = pixel(first[0] + (row + 0.5) * size_x, 0)
        low, high = terrain_map.difficulty[row].min(), terrain_map.difficulty[row].max()
        level = f"{low:.2f}" if low == high else f"{low:.2f}-{high:.2f}"
        write(f"{row}: d {level}", (x - 36, image.shape[0] - _MARGIN[1] + 24))
    write("columns (y): terrain", (10, _MARGIN[3] - 14))
    write("rows (x): difficulty", (10, image.shape[0] - _MARGIN[1] + 24))
    write(map_title(config), (_MARGIN[0], 40), 0.7)
    radius = max(2, round(scale * config.spawn_radius))
    for origin in terrain_map.env_origins.reshape(-1, 3).tolist():
        cv2.circle(image, pixel(*origin[:2]), radius, _BACKGROUND, 3, cv2.LINE_AA)
        cv2.circle(image, pixel(*origin[:2]), radius, _SPAWN_COLOR, 1, cv2.LINE_AA)
        cv2.circle(image, pixel(*origin[:2]), 2, _SPAWN_COLOR, -1, cv2.LINE_AA)
    goals = terrain_map.goals[~np.isnan(terrain_map.goals[..., 0])].tolist()
    for x, y, _, heading in goals:
        tip = x + 0.4 * math.cos(heading), y + 0.4 * math.sin(heading)
        cv2.arrowedLine(image, pixel(x, y), pixel(*tip), _GOAL_COLOR, 1, cv2.LINE_AA, tipLength=0.4)


def _draw_route(image: Picture, route: Route, scale: float, zero: tuple[float, float]) -> None:
    """Draw a path, and its mark with the label to the right."""
    import cv2

    color = _PASSABLE_COLOR if route.is_passable else _IMPASSABLE_COLOR
    pixels = np.rint(np.array(zero) + route.points * (scale, -scale)).astype(np.int32)
    cv2.polylines(image, [pixels], False, color, 2, cv2.LINE_AA)
    if route.place is not None:
        x, y = round(zero[0] + route.place[0] * scale), round(zero[1] - route.place[1] * scale)
        cv2.drawMarker(image, (x, y), color, cv2.MARKER_TILTED_CROSS, 14, 3, cv2.LINE_AA)
        at, font = (x + 10, y - 6), cv2.FONT_HERSHEY_SIMPLEX
        cv2.putText(image, route.label, at, font, 0.5, _BACKGROUND, 4, cv2.LINE_AA)
        _write(image, route.label, at)
