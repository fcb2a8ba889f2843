"""The commands for terrains and maps: list, info, preview, check-map and diff."""

import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from terrainkit.errors import ConfigError
from terrainkit.map.terrain_map import TerrainMap
from terrainkit.terrain import presets, registry
from terrainkit.terrain.paper import get_paper, paper_names
from terrainkit.terrain.parameter import format_value
from terrainkit.terrain.sub_terrain import SubTerrain
from terrainkit_cli import render
from terrainkit_cli.argument_types import Limits, MapFile, OutputPath, RobotName
from terrainkit_cli.map_text import bytes_text, size_text, written
from terrainkit_cli.parse import option, positional
from terrainkit_cli.plugin_command import PluginCommand


@dataclass(frozen=True, kw_only=True)
class List(PluginCommand):
    """List terrains, overlays and presets, or the contents of one."""

    terrain: Annotated[str, positional("[NAME]")] = ""
    """Name of a terrain or overlay, to print its parameters, or of a preset, to print its
    terrains. `stairs` and `rough` are terrains and presets: the terrain is printed."""

    papers: bool = False
    """List the presets of published work, with their citations and ranges (easy:hard)."""

    def run(self) -> int:
        """Print the terrains, overlays and presets, or the contents of one."""
        from terrainkit.terrain.terrain_docs import class_doc, summary

        if self.papers:
            if self.terrain:
                raise ConfigError(f"--papers: got {self.terrain!r} as well; expected one of them")
            for name in paper_names():
                _print_citation(name)
                _print_wrapped("; ".join(map(_ranges_text, get_paper(name).terrains)), indent=4)
            render.result("\nterrainkit list NAME shows all values, their source and what differs.")
            return 0
        if not self.terrain:
            terrains, overlays = registry.terrain_names(), registry.overlay_names()
            render.table([(name, summary(registry.get_terrain(name))) for name in terrains])
            groups = registry.TERRAINS, registry.OVERLAYS
            if names := [name for group in groups for name in registry.registered_names(group)]:
                render.result(f"\nregistered: {', '.join(names)}")
            if others := registry.plugins(registry.TERRAINS):
                render.result("\nfrom other packages:")
                render.table([(f"  {name}", point.value) for name, point in others.items()])
            render.result("\noverlays, which change any terrain:")
            render.table([(f"  {name}", summary(registry.get_overlay(name))) for name in overlays])
            if others := registry.plugins(registry.OVERLAYS):
                render.result("\noverlays from other packages:")
                render.table([(f"  {name}", point.value) for name, point in others.items()])
            mixes = (
                (name, ", ".join(c.name for c in presets.get_preset(name)))
                for name in presets.preset_names()
                if name not in paper_names()
            )
            render.result("\npresets:")
            render.table([(f"  {name}", mix) for name, mix in mixes])
            render.result("\npresets of published work, which list --papers describes:")
            _print_wrapped(", ".join(paper_names()), indent=2)
            render.result(
                "\nterrainkit list NAME shows a terrain's parameters, or a preset's terrains."
            )
            return 0
        if self.terrain in set(presets.preset_names()) - set(registry.terrain_names()):
            _print_preset(self.terrain)
            return 0
        known = (*registry.overlay_names(), *registry.plugins(registry.OVERLAYS))
        get_class = registry.get_overlay if self.terrain in known else registry.get_terrain
        about = class_doc(self.terrain, get_class(self.terrain))
        render.result(f"{about.name}: {about.text}\n")
        render.table([("parameter", "easy", "hard", ""), *about.parameters])
        return 0


def _print_preset(name: str) -> None:
    from terrainkit.terrain.terrain_docs import parameter_texts

    paper = get_paper(name) if name in paper_names() else None
    if paper:
        _print_citation(name)
        render.result("")
    options = "".join(
        f" --{key.replace('_', '-')} {' '.join(map(format_value, np.atleast_1d(value).tolist()))}"
        for key, value in (paper.map.items() if paper else ())
    )
    command = f"terrainkit generate --preset {name}{options} -o map.npz"
    lines = textwrap.wrap(command, 96, subsequent_indent="    ", break_on_hyphens=False)
    render.result(" \\\n".join(lines))
    render.result("")
    rows = [("terrain", "proportion", "parameters")]
    for sub_terrain in presets.get_preset(name):
        parameters = ", ".join(parameter_texts(sub_terrain))
        rows.append((sub_terrain.name, f"{sub_terrain.proportion:g}", parameters))
    render.table(_wrapped_rows(rows))
    if paper:
        _print_wrapped(f"\nfigures: {paper.figures}")
        for title, texts in (
            ("second-hand", paper.second_hand and (", ".join(paper.second_hand),)),
            ("not stated", paper.not_stated),
            ("different", paper.differences),
        ):
            for text in texts:
                _print_wrapped(f"{title}: {text}")


def _ranges_text(sub_terrain: SubTerrain) -> str:
    from terrainkit.terrain.terrain_docs import parameter_texts

    ranges = ", ".join(text for text in parameter_texts(sub_terrain) if ":" in text)
    return f"{sub_terrain.name} {ranges}".rstrip()


def _print_citation(name: str) -> None:
    paper = get_paper(name)
    render.result(name)
    _print_wrapped(f"{paper.authors}: {paper.title} ({paper.year}), {paper.source}", indent=4)


def _print_wrapped(text: str, indent: int = 0) -> None:
    """Print a text whose lines are as wide as a report."""
    first, later = " " * indent, " " * max(indent, 4)
    lines = text.lstrip("\n")
    render.result(
        "\n" * (len(text) - len(lines))
        + textwrap.fill(
            lines,
            render.width(),
            initial_indent=first,
            subsequent_indent=later,
            break_on_hyphens=False,
            break_long_words=False,
        )
    )


def _wrapped_rows(rows: list[tuple[str, str, str]]) -> list[tuple[str, str, str]]:
    """Return the rows of a table, whose last column continues on further rows."""
    used = sum(max(len(row[k]) for row in rows) + 2 for k in (0, 1))
    wrapped = []
    for first, second, text in rows:
        lines = textwrap.wrap(text, max(render.width() - used, 20)) or [""]
        wrapped += [(first, second, lines[0]), *(("", "", line) for line in lines[1:])]
    return wrapped


@dataclass(frozen=True, kw_only=True)
class Info(PluginCommand):
    """Print the size, terrains and difficulty of a map, or one patch."""

    map: MapFile
    """The map, a file written by terrainkit generate."""

    patch: Annotated[tuple[int, int], option("ROW COL")] | None = None
    """Row and column of a patch, to print its requested and realized parameters."""

    budget: bool = False
    """Print what the map costs: triangles, geoms, file sizes, contacts, and the estimated time of
    a MuJoCo step."""

    foot_radius: Annotated[float, option("M")] = 0.03
    """With --budget: half of the side of the square that contains a foot [m]."""

    def run(self) -> int:
        """Print the size of the map and its columns, one patch, or the budget."""
        from terrainkit.export.requirements import require_finite

        terrain_map = TerrainMap.load(self.map)
        require_finite(terrain_map)
        if self.patch and self.budget:
            raise ConfigError("--budget, --patch: got both; expected one of them")
        if self.budget:
            _print_budget(terrain_map, self.foot_radius)
        elif self.patch:
            _print_patch(terrain_map, *self.patch)
        else:
            _print_map(terrain_map)
        return 0


def _print_map(terrain_map: TerrainMap) -> None:
    from terrainkit.geometry.measured_difficulty import measured_difficulty

    config, grid = terrain_map.config, terrain_map.grid
    heights = terrain_map.heights
    facts = {
        "patches": f"{config.rows} x {config.cols} of {size_text(*config.patch_size)}",
        "samples": f"{grid.shape[0]} x {grid.shape[1]}, one every {config.cell:g} m",
        "extent": f"{grid.extent}, from ({grid.lower[0]:g}, {grid.lower[1]:g})",
        "border": f"{config.border:g} m"
        + (f" at height {config.border_height:g} m" if config.border_height else ""),
        "heights": f"{heights.min():g} to {heights.max():g} m",
        "solids": _solids_text(terrain_map),
        "mode": f"{config.mode}, seed {config.seed}",
        "friction": f"static {config.static_friction:g}, dynamic {config.dynamic_friction:g}, "
        f"restitution {config.restitution:g}",
    }
    render.table(list(facts.items()))
    render.result("")
    rows = [("column", "terrain", "difficulty", "measured difficulty of the ground")]
    for col in range(config.cols):
        patches = [terrain_map.patch(row, col) for row in range(config.rows)]
        hard = [measured_difficulty(t.heights, config.cell, float(t.origin[2])) for t in patches]
        names = ", ".join(dict.fromkeys(patch.terrain for patch in patches))
        difficulties = [patch.difficulty for patch in patches]
        hint = ", without its solids" if any(len(patch.solids) for patch in patches) else ""
        rows.append(
            (
                str(col),
                names,
                f"{min(difficulties):.2f} to {max(difficulties):.2f}",
                f"{min(hard):.3f} to {max(hard):.3f} m{hint}",
            )
        )
    render.table(rows)
    _print_sources(terrain_map)


def _print_sources(terrain_map: TerrainMap) -> None:
    """Print the files that an imported map is made of, and the patches of each."""
    sources: dict[tuple[str, str], list[tuple[int, ...]]] = {}
    for patch, parameters in np.ndenumerate(terrain_map.parameters):
        record = parameters.realized
        if digest := record.get("sha256"):
            sources.setdefault((record["file"], digest), []).append(patch)
    rows = [("file", "SHA-256", "patches")]
    for source, patches in sources.items():
        others = f" and {len(patches) - 5} more" if len(patches) > 5 else ""
        rows.append((*source, f"{str(patches[:5])[1:-1]}{others}"))
    if len(rows) > 1:
        render.result("")
        render.table(rows)


def _solids_text(terrain_map: TerrainMap) -> str:
    solids = terrain_map.solids
    if not len(solids):
        return "none"
    counts = {
        "boxes": len(solids.boxes),
        "cylinders": len(solids.cylinders),
        "hulls": len(solids.hull_counts),
        "that do not collide": int((~solids.collides).sum()),
    }
    return ", ".join(f"{n} {name}" for name, n in counts.items() if n)


def _print_budget(terrain_map: TerrainMap, foot_radius: float) -> None:
    from terrainkit.export.budget import MAX_CONTACTS, compute_budget

    budget = compute_budget(terrain_map, foot_radius)
    contacts = (
        f"a foot of radius {foot_radius:g} m has at most {budget.foot_contacts} with a heightfield"
    )
    if budget.foot_contacts > MAX_CONTACTS:
        contacts += f"; MuJoCo drops contacts beyond {MAX_CONTACTS}: use larger cells, or boxes"
    else:
        contacts += f"; MuJoCo allows {MAX_CONTACTS}"
    render.table(
        [
            ("triangles", f"{budget.merged_triangles:,} merged, {budget.full_triangles:,} full"),
            ("contacts", contacts),
        ]
    )
    render.result("")
    rows = [("MuJoCo collision", "geoms", "boxes", "heightfield cells", "time of a step")]
    for name, cost in budget.collisions.items():
        geoms, boxes, cells = f"{cost.num_geoms:,}", f"{cost.num_boxes:,}", f"{cost.hfield_cells:,}"
        label = f"{name} (auto)" if name == budget.auto else name
        rows.append((label, geoms, boxes, cells, f"about {cost.step_time:.1f} x a plane"))
    render.table(rows)
    render.result("")
    sizes = budget.file_sizes.items()
    texts = [(name, bytes_text(n) if isinstance(n, int) else n) for name, n in sizes]
    render.table([("file", "size"), *texts])


def _print_patch(terrain_map: TerrainMap, row: int, col: int) -> None:
    try:
        patch = terrain_map.patch(row, col)
    except IndexError as error:
        raise ConfigError(str(error)) from None
    x, y, z = (float(value) for value in patch.origin)
    render.result(
        f"patch ({row}, {col}): {patch.terrain} at difficulty {patch.difficulty:.3f}, "
        f"spawn origin ({x:g}, {y:g}, {z:g})\n"
    )
    rows = [("parameter", "requested", "realized")]
    for name, requested in patch.parameters.requested.items():
        realized = patch.parameters.realized[name]
        if isinstance(realized, tuple) and not isinstance(requested, tuple):
            text = " x ".join(map(format_value, realized))
        else:
            text = format_value(realized)
        rows.append((name, format_value(requested), text))
    render.table(rows)


@dataclass(frozen=True, kw_only=True)
class Preview(PluginCommand):
    """Render a map from above, with terrain names and spawn origins."""

    map: MapFile
    """The map, a file written by terrainkit generate."""

    output: OutputPath | None = None
    """The image to write (.png); by default, the name of the map with this suffix."""

    width: int = 1600
    """Width of the map in the image [pixels]; a tall map is narrower, and a long one is divided."""

    storey: int | None = None
    """Draw only this storey of buildings: 0 is the ground floor. Walls are cut off above it."""

    overwrite: bool = False
    """Replace an existing file."""

    def run(self) -> int:
        """Render the image and write it."""
        from terrainkit.views.preview import write_preview

        terrain_map = TerrainMap.load(self.map)
        output = self.output or self.map.with_suffix(".png")
        write_preview(
            terrain_map, output, width=self.width, overwrite=self.overwrite, storey=self.storey
        )
        render.result(written(terrain_map, output))
        return 0


@dataclass(frozen=True, kw_only=True)
class CheckMap(PluginCommand):
    """Validate a map: spawn origins, patches, sizes, difficulty, mesh.

    It also prints the largest height difference between neighboring patches, which does not count
    as an issue. Exit code 0: no issues. 1: the map has issues. 2: the file cannot be read.
    """

    map: MapFile
    """The map, a file written by terrainkit generate."""

    robot: RobotName = ""
    """Also check that this robot can cross every patch: name of a bundled robot, or a folder
    written by terrainkit onboard."""

    limit: Limits = ()
    """Limits that replace the robot's, or describe one without --robot; see terrainkit
    feasibility."""

    def run(self) -> int:
        """Print the issues and the largest patch edge, and return 1 if there are issues."""
        from terrainkit.export.npz import read_mesh
        from terrainkit.feasibility import assess_map
        from terrainkit.map.patch_edges import PatchEdges, cliffs_text, edge_text
        from terrainkit.map.validate import validate
        from terrainkit_cli.feasibility_command import print_impassable, robot_limits
        from terrainkit_robots.text import count

        derived = robot_limits(self.robot, self.limit) if self.robot or self.limit else None
        terrain_map = TerrainMap.load(self.map)
        issues = validate(terrain_map, read_mesh(self.map))
        for issue in issues:
            render.result(f"{issue.check}: {issue.message}")
        if not any(issue.check == "finite" for issue in issues):
            edges = PatchEdges(terrain_map=terrain_map)
            if largest := edges.max():
                render.result(f"largest patch edge: {edge_text(largest, terrain_map.patch_names)}")
            if cliffs := edges.cliffs():
                render.result(f"cliffs: {cliffs_text(cliffs, terrain_map.patch_names)}")
        # The path over a map with issues would be of no use.
        blocked = 0
        if derived and not issues:
            results = assess_map(terrain_map, derived.limits, progress=render.progress)
            blocked = print_impassable(results, derived, self.map)
        if issues:
            render.result(f"\n{self.map}: {count(len(issues), 'issue')}")
        elif not blocked:
            render.result(f"{self.map}: {terrain_map.difficulty.size} patches, no issues")
        return 1 if issues else blocked


@dataclass(frozen=True, kw_only=True)
class Diff(PluginCommand):
    """Compare two maps: config, and each patch.

    Exit code 0: the maps are the same. 1: they differ. 2: a file cannot be read.
    """

    a: MapFile
    """The first map, a file written by terrainkit generate."""

    b: Annotated[Path, positional("OTHER.npz")]
    """The second map."""

    def run(self) -> int:
        """Print the differences, and return 1 if there are any."""
        from terrainkit.map.map_diff import diff_maps

        a, b = TerrainMap.load(self.a), TerrainMap.load(self.b)
        diff = diff_maps(a, b)
        for line in diff.config:
            render.result(f"config: {line}")
        for line in diff.grid:
            render.result(line)
        for (row, col), lines in diff.patches.items():
            render.result(f"patch ({row}, {col}): {'; '.join(lines)}")
        if diff:
            total = a.difficulty.size
            render.result(f"\n{self.a} -> {self.b}: {len(diff.patches)} of {total} patches differ")
            return 1
        render.result(f"{self.a} and {self.b} are the same")
        return 0
