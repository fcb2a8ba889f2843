"""The command import: a file of heights or a mesh becomes a map."""

from dataclasses import dataclass
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated

from terrainkit.importing.options import ImportOptions
from terrainkit_cli import render
from terrainkit_cli.argument_types import OutputPath, is_map
from terrainkit_cli.config_options import ConfigCommand
from terrainkit_cli.map_text import written
from terrainkit_cli.parse import positional

if TYPE_CHECKING:
    from terrainkit import ImportReport


@dataclass(frozen=True, kw_only=True)
class Import(ConfigCommand):
    """Import a file of heights or a mesh as a map with spawn origins.

    The report says how many missing heights were filled, and what the map lost of a mesh whose
    parts hang over the ground.
    """

    file: Annotated[Path, positional("FILE")]
    """Image (.png with 16 bits, .tif), array (.npy), ASCII grid (.asc) or mesh (.obj, .stl, .ply,
    .glb)."""

    output: OutputPath
    """File to write, as of terrainkit generate."""

    overwrite: bool = False
    """Replace an existing file."""

    @classmethod
    def default_config(cls) -> ImportOptions:
        """Return the default options."""
        return ImportOptions()

    def run(self) -> int:
        """Import the file, write the map, and print the report."""
        from terrainkit import export, import_map

        options: ImportOptions = self.changed_config()
        export.check_export(self.output, 0, overwrite=self.overwrite)
        imported = import_map(self.file, options)
        files = export.export_files(imported.terrain_map, self.output, overwrite=self.overwrite)
        render.result(written(imported.terrain_map, *files))
        for line in _report_lines(imported.report, has_solids=options.solids):
            render.result(line)
        if is_map(self.output):
            path = quote(str(self.output))
            render.result(f"next: terrainkit preview {path} -o preview.png  (render it)")
        return 0


def _report_lines(report: "ImportReport", *, has_solids: bool) -> list[str]:
    lines = []
    if report.num_missing:
        lines.append(f"filled {report.num_missing} missing heights")
    if report.max_error_at:
        x, y = report.max_error_at
        lines.append(
            f"overhangs over {report.overhang_area:.2f} m2, of which {report.lost_area:.2f} m2 are "
            f"lost; largest error {report.max_error:.3f} m at ({x:.2f}, {y:.2f})"
            + ("" if has_solids else "; --solids keeps overhangs of closed bodies")
        )
    return lines
