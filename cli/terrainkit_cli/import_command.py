"""The command import: a file of heights or a mesh becomes a map."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated

from terrainkit.importing.readers.import_options import ImportOptions
from terrainkit_cli import render
from terrainkit_cli.argument_types import OutputPath, is_map
from terrainkit_cli.config_options import ConfigCommand
from terrainkit_cli.map_text import written
from terrainkit_cli.parse import positional

if TYPE_CHECKING:
    from terrainkit import ImportReport, TerrainMap

_MAX_ROWS = 20
"""Most rows whose files are printed."""


@dataclass(frozen=True, kw_only=True)
class Import(ConfigCommand):
    """Import heights, meshes or point clouds as a map.

    Several files, or the files in a folder, become levels of difficulty: the rows, easiest first.
    terrainkit generate makes such a map again from its config.
    The report compares the map with the file at points that are not its samples. It gives the
    largest differences, ground that the file does not have, and parts that are lost because they
    are narrower than a cell or hang over the ground.
    """

    files: Annotated[tuple[Path, ...], positional("FILE...")]
    """Image (.png with 16 bits, .tif), array (.npy, .npz), table (.txt, .csv), ASCII grid (.asc),
    geodata (.hgt, .dem), mesh (.obj, .stl, .ply, .glb, .dae), point cloud (.ply, .xyz, .pts, .csv,
    .pcd, .las, .laz) or scene (.xml of MuJoCo, .usd, .sdf or .world of Gazebo); or a folder of
    such files."""

    output: OutputPath
    """File to write, as of terrainkit generate."""

    overwrite: bool = False
    """Replace an existing file."""

    @classmethod
    def default_config(cls) -> ImportOptions:
        """Return the default options."""
        return ImportOptions()

    def run(self) -> int:
        """Import the files, write the map, and print the report."""
        from terrainkit import export, import_curriculum, import_map

        options: ImportOptions = self.changed_config()
        export.check_export(self.output, 0, overwrite=self.overwrite)
        if len(self.files) == 1 and not self.files[0].is_dir():
            progress = partial(render.progress, of="steps")
            terrain_map = import_map(self.files[0], options, progress=progress).terrain_map
            lines = [*_report_lines(terrain_map.import_reports[0], options)]
        else:
            terrain_map = import_curriculum(self.files, options, progress=render.progress)
            lines = [*_row_lines(terrain_map)]
        files = export.export_files(terrain_map, self.output, overwrite=self.overwrite)
        render.result(written(terrain_map, *files))
        for line in lines:
            render.result(line)
        if is_map(self.output):
            path = quote(str(self.output))
            render.result(f"next: terrainkit preview {path} -o preview.png  (render it)")
        return 0


def _row_lines(terrain_map: "TerrainMap") -> Iterator[str]:
    """Yield the file of each row, and what differs from all of them."""
    rows = [parameters.realized["file"] for parameters in terrain_map.parameters[:, 0]]
    for row, file in enumerate(rows[:_MAX_ROWS]):
        yield f"row {row}: {Path(file).name}"
    if len(rows) > _MAX_ROWS:
        yield f"and {len(rows) - _MAX_ROWS} more; terrainkit info prints them"
    yield (
        "heights are relative to the center of a patch and fade to 0 at its platform and its "
        "edges; a mesh has its highest surface only"
    )


def _report_lines(report: "ImportReport", options: ImportOptions) -> Iterator[str]:
    if report.hole_area:
        yield (
            f"holes {options.hole_depth:g} m deep where the mesh has no ground: "
            f"{report.hole_area:.2f} m2 (--hole-depth; 0 fills them)"
        )
    if report.lost_ground_area >= 0.005:
        yield f"the map has holes over {report.lost_ground_area:.2f} m2 where the file has ground"
    if report.num_missing or report.filled_area >= 0.005:
        yield (
            f"filled missing heights: {report.num_missing}; the map has ground over "
            f"{report.filled_area:.2f} m2 where the file has none"
        )
    if report.num_steep_slopes:
        yield (
            f"between neighboring samples: {report.num_walls} walls, and {report.num_steep_slopes} "
            "slopes above --slope-threshold that go on"
        )
    yield from _lost_parts(report, options)
    if report.num_points:
        yield f"compared with the file at {report.num_points} points: {_differences(report)}"


def _lost_parts(report: "ImportReport", options: ImportOptions) -> Iterator[str]:
    if report.num_thin_bodies:
        yield f"closed bodies narrower than a cell, now solids: {report.num_thin_bodies}"
    if report.num_lost_faces:
        hint = "" if options.solids else ", or --solids for closed bodies"
        yield (
            f"parts narrower than a cell are lost: {report.num_lost_faces} faces reach more than "
            f"half a cell above the map (smaller --cell{hint})"
        )
    if report.overhang_error_at:
        hint = "" if options.solids else "; --solids keeps overhangs of closed bodies"
        error, at = report.overhang_error, _place(report.overhang_error_at)
        yield (
            f"overhangs over {report.overhang_area:.2f} m2, of which {report.lost_area:.2f} m2 are "
            f"lost; largest error {error:.3f} m at {at}{hint}"
        )
    if report.hidden_area:
        yield (
            f"surfaces without thickness are above each other over {report.hidden_area:.2f} m2, "
            "such as floors of a building; the map has only the highest"
        )
    if report.num_open_bodies and (report.lost_area or report.num_lost_faces):
        yield f"bodies that are not closed, and cannot become solids: {report.num_open_bodies}"


def _differences(report: "ImportReport") -> str:
    if not report.max_error_at or report.max_error <= 0.01:
        return "all within 1 cm"
    shares: dict[float, str] = {}
    for share, limit in zip(report.shares, ("1 cm", "5 cm", "a cell"), strict=True):
        shares.setdefault(share, f"{math.floor(1000 * share) / 10:g}% within {limit}")
    places = [(report.max_error, *report.max_error_at), *report.further_errors]
    largest = ", ".join(f"{error:.3f} m at {_place(xy)}" for error, *xy in places)
    return f"{', '.join(shares.values())}; largest differences: {largest}"


def _place(xy: Sequence[float]) -> str:
    return f"({xy[0]:.2f}, {xy[1]:.2f})"
