"""The command import: a file of heights or a mesh becomes a map."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated

import numpy as np

from terrainkit.errors import ConfigError
from terrainkit.importing.import_options import ImportOptions
from terrainkit.settings.type_hint import NonNegative
from terrainkit_cli import render
from terrainkit_cli.argument_types import OutputPath, is_map
from terrainkit_cli.config_options import ConfigCommand
from terrainkit_cli.map_text import written
from terrainkit_cli.parse import positional

if TYPE_CHECKING:
    from terrainkit import ImportReport

_MAX_LINES = 20
"""Most lines of the report of several files."""


@dataclass(frozen=True, kw_only=True)
class Import(ConfigCommand):
    """Import heights, meshes or point clouds as a map.

    Several files, or the files in a folder, become levels of difficulty: the rows, easiest first.
    The report says the largest difference in height from the file, and what the map lost: parts
    that are narrower than a cell or hang over the ground.
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

    blend: NonNegative = 1.0
    """Several files: distance over which the heights fade to 0 at the edges of a patch [m]; 0 to
    keep them."""

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
            if self.blend != Import.blend:
                raise ConfigError("--blend: got one file; expected several files")
            terrain_map = import_map(self.files[0], options).terrain_map
            names = [""]
        else:
            progress = partial(render.progress, of="files")
            terrain_map = import_curriculum(
                self.files, options, blend=self.blend, progress=progress
            )
            patches = np.ndenumerate(terrain_map.patch_names)
            names = [f"patch {index}, {name}: " for index, name in patches]
        files = export.export_files(terrain_map, self.output, overwrite=self.overwrite)
        render.result(written(terrain_map, *files))
        lines = [
            f"{name}{line}"
            for name, report in zip(names, terrain_map.import_reports, strict=True)
            for line in _report_lines(report, has_solids=options.solids)
        ]
        for line in lines[:_MAX_LINES]:
            render.result(line)
        if len(lines) > _MAX_LINES:
            render.result(f"and {len(lines) - _MAX_LINES} more, in import_reports")
        if is_map(self.output):
            path = quote(str(self.output))
            render.result(f"next: terrainkit preview {path} -o preview.png  (render it)")
        return 0


def _report_lines(report: "ImportReport", *, has_solids: bool) -> Iterator[str]:
    if report.num_missing:
        yield f"filled missing heights: {report.num_missing}"
    if report.num_thin_bodies:
        yield f"closed bodies narrower than a cell, now solids: {report.num_thin_bodies}"
    if report.lost_at:
        hint = "" if has_solids else ", or --solids for closed bodies"
        yield (
            f"the file reaches {report.lost_top:.2f} m at {_place(report.lost_at)}, the map "
            f"{report.map_top:.2f} m: parts narrower than a cell are lost, "
            f"{report.num_lost_faces} faces (smaller --cell{hint})"
        )
    if report.overhang_error_at:
        hint = "" if has_solids else "; --solids keeps overhangs of closed bodies"
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
    if report.num_open_bodies and (report.lost_area or report.lost_at):
        yield f"bodies that are not closed, and cannot become solids: {report.num_open_bodies}"
    at = f" at {_place(report.max_error_at)}" if report.max_error_at else ""
    yield (
        f"largest difference from the file {report.max_error:.3f} m{at}, apart from walls, which "
        "move by less than a cell"
    )


def _place(xy: tuple[float, float]) -> str:
    return f"({xy[0]:.2f}, {xy[1]:.2f})"
