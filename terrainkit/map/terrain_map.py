"""TerrainMap: a generated map and the views of its surface."""

import warnings
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrainkit.curriculum import (
    Assignment,
    assign_levels,
    assign_spawns,
    resample_columns,
    update_levels,
)
from terrainkit.curriculum.arrays import Array, Seed
from terrainkit.errors import ConfigError, TerrainkitWarning
from terrainkit.geometry.free_space import Direction, clearance, first_surface, free_intervals
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.geometry.solids import Solids
from terrainkit.map.import_report import ImportReport
from terrainkit.map.map_config import MapConfig
from terrainkit.map.patch import Patch
from terrainkit.settings.type_hint import convert

if TYPE_CHECKING:
    from pathlib import Path

    from terrainkit.geometry.box_decomposition import BoxDecomposition
    from terrainkit.geometry.ground_surface import SurfacePoints
    from terrainkit.geometry.mesh import TriMesh
    from terrainkit.geometry.walls import WallRule


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class TerrainMap:
    """A map of rows x cols patches with a border."""

    config: MapConfig
    """The configuration that the map was generated from; in mode custom, it was not generated."""

    grid: Grid
    """Positions of the samples."""

    heights: NDArray[np.float32]
    """Heights [m], shape `grid.shape`: first index x, second y."""

    friction: NDArray[np.float32]
    """Friction of the ground in each cell, shape `grid.shape`. Read-only if it is the same in all
    cells."""

    spawns: NDArray[np.float32]
    """Spawn positions of each patch: x, y, z [m] and heading [rad], shape (rows, cols, k, 4), NaN
    where a patch has fewer than k. The first of each patch is its spawn origin."""

    terrain_types: NDArray[np.int32]
    """Terrain type of each patch as an index into `terrain_names`, shape (rows, cols)."""

    terrain_names: tuple[str, ...]
    """Names of the sub-terrains."""

    difficulty: NDArray[np.float32]
    """Difficulty of each patch, 0 to 1, shape (rows, cols)."""

    parameters: NDArray[np.object_]
    """`PatchParameters` of each patch, shape (rows, cols)."""

    solids: Solids
    """Solids of all patches."""

    goals: NDArray[np.float32]
    """Goals of each patch in their order: x, y, z [m] and heading [rad], shape (rows, cols, k, 4),
    NaN where a patch has fewer than k."""

    walls: NDArray[np.uint8] | None = None
    """Which edges between neighboring samples of an imported map, or one with the terrain
    `imported`, are walls: bit 1 of a sample for the edge along x to the next one, bit 2 along y,
    shape `grid.shape`. None where the difference of the heights decides, by `slope_threshold`."""

    import_reports: tuple[ImportReport, ...] = ()
    """What an imported map lost of its file. Empty for generated maps."""

    def __repr__(self) -> str:
        rows, cols = self.difficulty.shape
        names = ", ".join(self.terrain_names)
        return f"<TerrainMap {rows} x {cols} patches, {self.heights.shape} samples: {names}>"

    def _repr_jpeg_(self) -> bytes:
        """Return the preview, which notebooks display."""
        from terrainkit.views.preview import notebook_preview

        return notebook_preview(self)

    @cached_property
    def env_origins(self) -> NDArray[np.float32]:
        """Spawn origin of each patch [m], shape (rows, cols, 3), a view of `spawns`."""
        return self.spawns[:, :, 0, :3]

    def height(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Return the height of the ground [m] at `xy`.

        Args:
            xy: Points [m], shape (..., 2). Beyond the map, the edge height applies.

        Returns:
            Heights [m], shape (...). On a wall, the height of one of its sides.
        """
        points, shape = _points("xy", xy, 2)
        return self._surface_at(points).height.reshape(shape)

    def normal(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Return the upward unit normal of the ground at `xy`.

        Args:
            xy: Points [m], shape (..., 2).

        Returns:
            Unit vectors, shape (..., 3). On a wall, the normal of the ground on one of its sides.
        """
        points, shape = _points("xy", xy, 2)
        return self._surface_at(points).normals(self.grid.cell).reshape(*shape, 3)

    def scan(self, points: ArrayLike, direction: Direction = "down") -> NDArray[np.float64]:
        """Return the z of the first surface above or below `points` [m]; NaN where there is none.

        Rays hit the ground and the solids that are visible. A ray that starts inside a solid hits
        the solid's far side, as MuJoCo's `mj_ray` does.

        Args:
            points: Starts of the rays [m], shape (..., 3).
            direction: "down" or "up".

        Raises:
            ConfigError: if `points` or `direction` is invalid.
        """
        direction = convert("direction", direction, Direction)
        starts, shape = _points("points", points, 3)
        ground = self._surface_at(starts[:, :2]).height
        bounds = self._visible.intervals(starts[:, :2])
        return first_surface(ground, bounds, starts[:, 2], direction).reshape(shape)

    def clearance(self, xy: ArrayLike, step_height: float = 0.1) -> NDArray[np.float64]:
        """Return the free height above the ground at `xy` [m], below the solids that collide.

        Args:
            xy: Points [m], shape (..., 2).
            step_height: Height above the ground up to which the top of a solid, such as the sill
                of a door, is a floor on which a robot steps [m].

        Returns:
            Clearance above the ground or this floor [m], shape (...): inf under the open sky, 0
            where a higher solid covers the ground.
        """
        points, shape = _points("xy", xy, 2)
        ground = self._surface_at(points).height
        bounds = self._collision_index.intervals(points)
        return clearance(ground, bounds, step_height).reshape(shape)

    def occupancy(self, low: float, high: float) -> NDArray[np.bool_]:
        """Return the occupancy grid of the ground for a robot that walks on it.

        A cell is occupied if a solid that collides overlaps it anywhere between `low` and `high`
        above the ground, or if the ground of a neighbor, also a diagonal one, is lower by more than
        `low`. The cells are those of `heights`.

        Args:
            low: Height of the largest step of the robot [m]; lower sills and curbs are free.
            high: Height of the robot [m]; lintels and ceilings from there on are free.

        Returns:
            Whether each cell is occupied, shape `grid.shape`.

        Raises:
            ConfigError: if the band is empty or `low` is negative.
        """
        from terrainkit.geometry.occupancy_grid import occupied_cells

        if not 0 <= low < high:
            raise ConfigError(f"height band: got {low:g} m to {high:g} m; expected 0 <= low < high")
        return occupied_cells(
            self.grid, self.heights, self.solids.select(self.solids.collides), low, high
        )

    def intervals(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Return the free intervals above the ground at `xy`, between the solids that collide.

        Args:
            xy: Points [m], shape (..., 2).

        Returns:
            Floor and ceiling of each interval [m], shape (..., k, 2), upward, padded with NaN. The
            ceiling of the last interval is inf.
        """
        points, shape = _points("xy", xy, 2)
        ground = self._surface_at(points).height
        intervals = free_intervals(ground, self._collision_index.intervals(points))
        return intervals.reshape(*shape, *intervals.shape[1:])

    def mesh(self, *, merged: bool = True, closed: bool = False) -> "TriMesh":
        """Return the ground and the solids that collide as a triangle mesh.

        The ground comes first; see `terrainkit.geometry.mesh`.

        Args:
            merged: Merge coplanar faces of the ground; otherwise two triangles per cell.
            closed: Return one watertight solid: the ground with sides and a bottom, united with
                the solids.
        """
        from terrainkit.geometry.mesh import closed_mesh
        from terrainkit.geometry.mesh.solid_mesh import concatenate_meshes, solid_meshes, union

        ground = self.ground_mesh(merged=merged)
        meshes = solid_meshes(self.solids.select(self.solids.collides))
        if closed:
            return union([closed_mesh(ground), *meshes])
        return concatenate_meshes(chain([ground], meshes)) if self.solids.collides.any() else ground

    def ground_mesh(self, *, merged: bool = True) -> "TriMesh":
        """Return the ground as a triangle mesh, without the solids; see `mesh`."""
        from terrainkit.geometry.mesh import full_mesh, merged_mesh

        make_mesh = merged_mesh if merged else full_mesh
        return make_mesh(self.heights, self.grid, self.wall_rule)

    def boxes(self) -> "BoxDecomposition":
        """Return the level ground as boxes; see `terrainkit.geometry.box_decomposition`."""
        from terrainkit.geometry.box_decomposition import decompose_boxes

        edges = self.config.patch_edges
        return decompose_boxes(self.heights, self.grid, self.wall_rule, edges, self.friction)

    def height_field_raw(self, vertical_scale: float = 0.005) -> NDArray[np.int16]:
        """Return the heights in the format of Isaac Gym's `add_heightfield`.

        Args:
            vertical_scale: Height of one unit [m].

        Returns:
            Heights in units of `vertical_scale`, int16, shape (ny, nx): Isaac Gym's rows lie along
            y and its columns along x. `nbRows` is `shape[0]`, `nbColumns` is `shape[1]`, and the
            transform's x and y are `first_sample`. Its buffer is column-major: pass
            `.ravel(order="F")`. legged_gym's own `height_samples` is `.T`.

        Raises:
            ConfigError: if `vertical_scale` is not above 0.
            ExportError: if the map has solids, or a height does not fit in 16 bits at this scale.
        """
        from terrainkit.export.int16_heights import int16_heights
        from terrainkit.export.requirements import require_no_solids

        require_no_solids(self, "a heightfield")
        return np.ascontiguousarray(int16_heights(self.heights.T, vertical_scale))

    @property
    def wall_rule(self) -> "WallRule":
        """Which edges between neighboring samples are walls; see `terrainkit.geometry.walls`."""
        return self.config.wall_threshold if self.walls is None else self.walls

    @property
    def patch_names(self) -> NDArray[np.str_]:
        """Name of the sub-terrain of each patch, shape (rows, cols)."""
        return np.array(self.terrain_names)[self.terrain_types]

    @property
    def first_sample(self) -> tuple[float, float]:
        """Position of `heights[0, 0]`, x and y [m]: half a cell inside the corner of the map."""
        return self.grid.lower[0] + self.grid.cell / 2, self.grid.lower[1] + self.grid.cell / 2

    def patch(self, row: int, col: int) -> Patch:
        """Return patch (row, col); `terrainkit.make_patch` builds one without a map.

        Raises:
            IndexError: if there is no such patch.
        """
        self.config.check_patch(row, col)
        cells = self.config.patch_cells(row, col)
        goals, spawns = self.goals[row, col], self.spawns[row, col]
        return Patch(
            terrain=self.terrain_names[self.terrain_types[row, col]],
            difficulty=float(self.difficulty[row, col]),
            parameters=self.parameters[row, col],
            grid=self.config.patch_grid(row, col),
            heights=self.heights[cells],
            walls=None if self.walls is None else self.walls[cells],
            friction=self.friction[cells],
            solids=self.solids.select((self.solids.patch == (row, col)).all(axis=1)),
            goals=goals[~np.isnan(goals[:, 0])],
            spawns=spawns[~np.isnan(spawns).all(axis=1)],
        )

    def edited(self, *, heights: ArrayLike | None = None, solids: Solids | None = None) -> Self:
        """Return the map with other heights or solids, as a map of mode custom.

        Such a map is not compared with its config by `terrainkit.map.validate.validate`, and
        cannot be generated from it. Spawn positions and goals follow the height of the ground.
        Where a spawn position is no longer flat and free, all spawn positions of its patch are
        placed again.

        Args:
            heights: Heights [m], shape `grid.shape`; None to keep the heights.
            solids: All solids of the map; None to keep the solids. Each belongs to the patch of its
                center.

        Raises:
            ConfigError: if the heights have another shape or are not finite, or a patch has no
                place to spawn.
        """
        from terrainkit.map.edit import edit_map

        return edit_map(self, heights, solids)

    def assign(self, num_envs: int, max_init_level: int | None = None, seed: int = 0) -> Assignment:
        """Assign patches to `num_envs` environments, distributed over the spawn positions.

        For levels that change during training, a sampler of `terrainkit.curriculum` is recommended.

        Warns:
            TerrainkitWarning: if patches have several spawn positions, but too few for their
                environments.
        """
        rows, cols = self.difficulty.shape
        levels, columns = assign_levels(num_envs, rows, cols, max_init_level, seed)
        spawns, num_shared = assign_spawns(self.spawns, levels, columns)
        if num_shared and self.config.spawns_per_patch > 1:
            warnings.warn(
                f"{num_shared} of {num_envs} environments share a spawn position with another; "
                "increase spawns_per_patch, rows or cols, or reduce spawn_radius",
                TerrainkitWarning,
                stacklevel=2,
            )
        return Assignment(
            levels=levels,
            columns=columns,
            terrain_types=self.terrain_types[levels, columns],
            env_origins=spawns[:, :3],
            headings=spawns[:, 3],
        )

    def resample_columns(self, levels: ArrayLike, columns: Array, *, seed: Seed) -> Array:
        """Return other columns at a reset; see `terrainkit.curriculum.resample_columns`."""
        return resample_columns(levels, columns, self.terrain_types, seed=seed)

    def update_levels(
        self, levels: Array, progress: ArrayLike, *, seed: Seed, top_levels: int = 3
    ) -> Array:
        """Return levels kept elsewhere after an episode; see `terrainkit.update_levels`."""
        rows = len(self.difficulty)
        return update_levels(levels, progress, rows=rows, seed=seed, top_levels=top_levels)

    def save(self, path: "str | Path", *, overwrite: bool = False, **options: Any) -> "Path":
        """Write the map in the format of the suffix of `path`; see `terrainkit.export`."""
        from terrainkit.export import export_files

        return export_files(self, path, overwrite=overwrite, **options)[0]

    @classmethod
    def load(cls, path: "str | Path") -> Self:
        """Load a map from a .npz file.

        Raises:
            MapFileError: if the file is missing, truncated, or not a map.
        """
        from terrainkit.export.npz import read_map

        return read_map(cls, path)

    @cached_property
    def _visible(self) -> SolidIndex:
        return SolidIndex(self.solids.select(self.solids.visible))

    @cached_property
    def _collision_index(self) -> SolidIndex:
        return SolidIndex(self.solids.select(self.solids.collides))

    def _surface_at(self, points: NDArray[np.float64]) -> "SurfacePoints":
        from terrainkit.geometry.ground_surface import surface_at

        index = (points - self.first_sample) / self.grid.cell
        return surface_at(self.heights, index, rule=self.wall_rule)


def _points(name: str, values: ArrayLike, size: int) -> tuple[NDArray[np.float64], tuple[int, ...]]:
    points = np.asarray(values, dtype=np.float64)
    if points.shape[-1:] != (size,) or not np.isfinite(points).all():
        raise ConfigError(
            f"{name}: got shape {points.shape}; expected finite values of shape (..., {size})"
        )
    return points.reshape(-1, size), points.shape[:-1]
