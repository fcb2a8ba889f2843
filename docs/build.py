"""Build the generated docs: pages, llms.txt and pictures.

python docs/build.py              write the texts, and draw the pictures that are missing
python docs/build.py NAME...      also draw these pictures again, such as `wave`
python docs/build.py --pictures   also draw every picture again
python docs/build.py --check      exit with 1 if a text is out of date or a picture is missing
"""

import ast
import dataclasses
import importlib
import inspect
import json
import os
import pkgutil
import re
import subprocess
import sys
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

import yaml
from config_schema import config_schema
from draw_pictures import PICTURES, pictures

from terrainkit.errors import ConfigError, listing
from terrainkit.features.building_codes import Clause, clauses
from terrainkit.lazy_names import public_names
from terrainkit.map.map_config import MapConfig
from terrainkit.settings.field_docs import field_docs
from terrainkit.settings.schema import Config, field_keys, field_types, is_required
from terrainkit.settings.toml_text import value_text
from terrainkit.settings.type_hint import NONE, describe, is_table, parse_hint
from terrainkit.terrain import presets, registry
from terrainkit.terrain.paper import Paper, get_paper, paper_names
from terrainkit.terrain.sub_terrain import SubTerrain
from terrainkit.terrain.terrain_docs import TerrainDoc, class_doc, parameter_texts
from terrainkit_cli.main import COMMANDS
from terrainkit_robots.lint.rule import FAMILIES, TASK_FAMILIES, Rule, rules
from terrainkit_robots.lint.settings import Settings
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.legged_gym_names import Name, names, place_of
from terrainkit_robots.spec.robot_spec import RobotSpec

DOCS = Path(__file__).parent
RESULT_FILES = DOCS.parent / "benchmarks" / "results" / "policies"
NOTE = "<!-- Written by docs/build.py: change the docstrings, not this file. -->\n"


def terrains_page() -> str:
    terrains = [class_doc(name, registry.get_terrain(name)) for name in registry.terrain_names()]
    overlays = [class_doc(name, registry.get_overlay(name)) for name in registry.overlay_names()]
    parts = [
        "# Terrains\n",
        NOTE,
        "Each terrain with its parameters. A parameter with two values is a range from difficulty",
        "0 to difficulty 1. Replace it with one value or another range in a",
        "[configuration file](conventions.md#configuration-files) or with `--set`. The pictures",
        "show difficulty 0.1, 0.5 and 1 on patches of 8 m x 8 m, with holes truncated; a building",
        "cut off above its ground floor, cut off above the next floor, and whole.\n",
        "| terrain | range | description |",
        "|---|---|---|",
        *map(summary_row, terrains),
    ]
    parts += ["", *map(terrain_section, terrains)]
    parts += [OVERLAYS, "| overlay | range | description |", "|---|---|---|"]
    parts += map(summary_row, overlays)
    for about in overlays:
        parts.append(f"\n### {about.name}\n\n{about.text}\n\n" + "\n".join(parameter_rows(about)))
    parts += ["\n## Presets\n", "| preset | columns |\n|---|---|"]
    for name in presets.preset_names():
        mix = ", ".join(
            f"{c.name} x {c.proportion:g}" if c.proportion != 1 else c.name
            for c in presets.get_preset(name)
        )
        parts.append(f"| {name} | {mix} |")
    parts += [
        "",
        'legged_gym\'s "stairs up", which a robot climbs from the platform outward, are',
        '`pyramid_stairs_inverted` here. Its "stairs down" are `pyramid_stairs`.',
        "",
        "[papers.md](papers.md) has the ranges and sources of the presets of published work.",
        "",
        "`parkour_course` on patches of 18 m x 4 m; the arrows are goals:",
        "",
        "![parkour_course](pictures/parkour_course.png)",
        "",
        "Stairs of `residential`, `public`, `industrial` and `fire_escape` at difficulty 1, at the",
        "limit of their codes:",
        "",
        "![built_stairs](pictures/built_stairs.png)",
        BUILDING_CODES,
        *(building_code_row(clause) for clause in clauses()),
    ]
    return "\n".join(parts) + "\n"


BUILDING_CODES = """
## Building codes

The presets `residential`, `public`, `industrial` and `fire_escape` reach from easy stairs to the
limits of building codes. The presets with `_beyond_code` go on from there to steeper stairs, with
risers that differ. `check_flight` returns the clauses that a flight violates:

```python
import terrainkit
from terrainkit.terrains.staircase import Staircase

grid = terrainkit.MapConfig().patch_grid(0, 0)
flight = Staircase(riser=0.19, going=0.26).flight(grid)
assert [limit.quantity for limit in terrainkit.check_flight(flight, "ibc")] == ["riser", "going"]
```

The table has only limits of dimensions, and codes have exceptions. Values that were not read in the
official publication of a code are second-hand. Never call stairs compliant because of it. Lengths
are in m, and angles in rad.

| code | clause | quantity | limit | read in |
|---|---|---|---|---|"""


def building_code_row(clause: Clause) -> str:
    low, high = (f"{bound:.4g}" for bound in (clause.minimum, clause.maximum))
    limit = f"{low} to {high}" if clause.minimum else f"at most {high}"
    if clause.maximum == float("inf"):
        limit = f"at least {low}"
    source = clause.source + (" (second-hand)" if clause.second_hand else "")
    return f"| {clause.code} | {clause.clause} | {clause.quantity} | {limit} | {source} |"


OVERLAYS = """## Overlays

An overlay changes the patches of any terrain. Overlays are applied in the order that is given; see
[conventions.md](conventions.md#overlays).
"""


def summary_row(about: TerrainDoc) -> str:
    ranges = ", ".join(f"{p.name} {p.easy} to {p.hard}" for p in about.parameters if p.hard)
    return f"| [{about.name}](#{about.name}) | {ranges} | {about.text.splitlines()[0]} |"


def terrain_section(about: TerrainDoc) -> str:
    lines = [
        f"## {about.name}\n",
        f"{about.text}\n",
        f"![{about.name}](pictures/{about.name}.png)\n",
    ]
    if about.parameters:
        lines += [*parameter_rows(about), ""]
    return "\n".join(lines)


def parameter_rows(about: TerrainDoc) -> list[str]:
    rows = [f"| {p.name} | {p.easy} | {p.hard or p.easy} | {p.text} |" for p in about.parameters]
    return ["| parameter | easy | hard | |", "|---|---|---|---|", *rows]


def papers_page() -> str:
    parts = [
        "# Terrains of published work\n",
        NOTE,
        PAPERS,
        "| preset | work | source |\n|---|---|---|",
    ]
    for name in paper_names():
        paper = get_paper(name)
        parts.append(f"| [{name}](#{name}) | {paper.title} ({paper.year}) | {source_link(paper)} |")
    return "\n".join([*parts, "", *map(paper_section, paper_names())])


PAPERS = """Presets with the terrains of papers and projects. `terrainkit list --papers` prints the
citations, `terrainkit list PRESET` a preset, and `terrainkit generate --preset PRESET` generates
it. Where the code of a work is public, its own functions were run, and the tests compare the ground
that they build with ours: platforms, number and height of rises, gaps, levels and columns. What
remains is under "Different". The other figures were read in papers; those of terrains marked
second-hand, in the work of others. A preset
sets the terrains only; `terrainkit list PRESET` prints the options for a map of the size of the
work. In Python, `terrainkit.terrain.paper.get_paper` returns an entry. The pictures show difficulty
0, 0.5 and 1, from left to right.
"""


def source_link(paper: Paper) -> str:
    hosts = {"arXiv:": "https://arxiv.org/abs/", "doi:": "https://doi.org/"}
    for prefix, host in hosts.items():
        if paper.source.startswith(prefix):
            return f"[{paper.source}]({host}{paper.source.removeprefix(prefix)})"
    return f"<{paper.source}>"


def paper_section(name: str) -> str:
    paper = get_paper(name)
    lines = [
        f"## {name}\n",
        f"{paper.authors}: *{paper.title}* ({paper.year}), {source_link(paper)}.\n",
        f"![{name}](pictures/{name}.png)\n",
        "| terrain | proportion | easy:hard |\n|---|---|---|",
    ]
    for part in paper.terrains:
        mark = ", second-hand" if part.name in paper.second_hand else ""
        kind = f"{part.name} ({part.terrain})" if part.name != part.terrain else part.name
        texts = ", ".join(parameter_texts(part))
        lines.append(f"| {kind}{mark} | {part.proportion:g} | {texts} |")
    settings = ", ".join(f"`{key} = {value_text(value, 100)}`" for key, value in paper.map.items())
    lines += [f"\nMap: {settings}."] if settings else []
    lines.append(f"\nFigures: {markup(paper.figures)}.")
    for title, texts in (("Not stated", paper.not_stated), ("Different", paper.differences)):
        lines += [f"\n{title}:\n", *(f"- {markup(text)}" for text in texts)] if texts else []
    return "\n".join(lines) + "\n"


def rules_page() -> str:
    parts = [
        "# The rules of check-robot and check-task\n",
        NOTE,
        "The rules that `terrainkit check-robot` runs on robots, and `terrainkit check-task` on",
        "tasks (family TSK). An error breaks training or a simulator. A",
        "warning is a likely mistake that should be corrected. A note needs no correction. `--fix`",
        "applies fixes that do not change the robot for any parser that accepts the file.",
        "`--unsafe-fixes` also applies fixes that change numbers, shapes or other files.\n",
    ]
    every = rules() + rules("task")
    for family, about in (FAMILIES | TASK_FAMILIES).items():
        parts.append(f"## {family}: {about.title}\n\n| rule | violation | severity | fix |")
        parts.append("|---|---|---|---|")
        for rule in every:
            if rule.family == family:
                link = f"[{rule.code} {rule.name}](#{rule.code.lower()}-{rule.name})"
                severity, fix = rule.severity, FIXED[rule.fixes]
                parts.append(f"| {link} | {markup(rule.page.title)} | {severity} | {fix} |")
        parts += ["", *(rule_section(rule) for rule in every if rule.family == family)]
    return "\n".join(parts)


CONFIGS = {
    "Map: terrainkit generate --config": MapConfig,
    "Sub-terrain of a map: [[terrains]]": SubTerrain,
    "Robot: robot.toml": RobotSpec,
    "Training: task.toml, terrainkit train --config": Task,
    "Lint settings: [check-robot] in terrainkit.toml": Settings,
}
"""Config class of each TOML file."""

SCHEMAS = {"map": MapConfig, "robot": RobotSpec, "task": Task}
"""Config class of each JSON schema."""

FIXED = {"safe": "`--fix`", "unsafe": "`--unsafe-fixes`", "no": ""}


def rule_section(rule: Rule) -> str:
    fixed = f"; fixed by {FIXED[rule.fixes]}" if FIXED[rule.fixes] else ""
    return (
        f"### {rule.code} {rule.name}\n\n"
        f"**{markup(rule.page.title)}** Severity: {rule.severity}{fixed}.\n\n"
        f"{markup(rule.page.why)}\n\n"
        f"*How to fix:* {markup(rule.page.how_to_fix)}\n\n"
        f"*Source:* {markup(rule.page.reference)}\n"
    )


def markup(text: str) -> str:
    """Return the text of a docstring as Markdown; `code` is unchanged."""
    parts = re.split(r"(`[^`]*`)", text)
    parts[::2] = [
        re.sub(r"([\\*\[\]|~]|\b_|_\b)", r"\\\1", part).replace("<", "&lt;").replace(">", "&gt;")
        for part in parts[::2]
    ]
    return "".join(parts)


def config_page() -> str:
    parts = [
        "# Configuration files\n",
        NOTE,
        "The keys of each TOML file. An unknown key or an invalid value is an error that names it.",
        'The string "none" stands for no value.',
        "Editors that know Taplo complete the keys from a JSON schema, which the first line of the",
        "file names: `#:schema PATH/docs/schemas/task.json`, or [map.json](schemas/map.json),",
        "[robot.json](schemas/robot.json), [task.json](schemas/task.json).",
        "[Names of legged_gym](legged_gym_names.md) compares the settings of a training, and",
        "`terrainkit import-config` translates a configuration of legged_gym.\n",
    ]
    for title, config in CONFIGS.items():
        parts += [f"## {title}\n", f"{inspect.getdoc(config).splitlines()[0]}\n"]
        parts += ["| key | value | default | |\n|---|---|---|---|", *config_rows(config), ""]
    return "\n".join(parts)


def config_rows(config: type[Config], prefix: str = "") -> Iterator[str]:
    annotations, docs = field_types(config), field_docs(config)
    fields = {field.name: field for field in dataclasses.fields(config)}
    for key, name in field_keys(config).items():
        field, kind = fields[name], parse_hint(annotations[name]).kind
        if is_table(kind):
            yield from config_rows(kind, f"{prefix}{key}.")
            continue
        default = "required" if is_required(field) else ""
        if field.default is not dataclasses.MISSING:
            default = f"`{value_text(NONE if field.default is None else field.default, 1000)}`"
        about = f"{describe(annotations[name])} | {default} | {docs.get(name, '')}"
        yield f"| `{prefix}{key}` | {about.replace('>=', '≥').replace('<=', '≤')} |"


def names_page() -> str:
    """Return the page with the table of names anew; its other text is written by hand."""
    header = "| legged_gym, LeggedGym-Ex | here | |\n|---|---|---|\n"
    before, _, rest = written("legged_gym_names.md").partition(header)
    rows = []
    # Settings in a row that are missing here for the same reason share a row.
    for reason, group in groupby(names().items(), lambda item: item[1].no):
        if reason:
            keys = ", ".join(f"`{key}`" for key, _ in group)
            rows.append(f"| {keys} | none | {reason} |\n")
        else:
            rows += (f"| `{key}` | {here_text(row)} | {row.about} |\n" for key, row in group)
    return "".join([before, header, *rows, rest[rest.find("\n\n") + 1 :]])


def here_text(row: Name) -> str:
    if row.off is not None:
        return f"`{place_of(row)}`; {value_text(row.off)} is off"
    name, *where = place_of(row).split(" ", 1)
    values = (f"{value_text(ours)} for {theirs}" for theirs, ours in row.values.items())
    return " ".join([f"`{name}`", *where]) + ("; " if row.values else "") + ", ".join(values)


def cli_page() -> str:
    parts = ["# The command line\n", NOTE]
    for arguments in ([], *([name] for name in COMMANDS)):
        title = " ".join(["terrainkit", *arguments])
        parts.append(f"## {title}\n\n```text\n{help_of(arguments)}\n```\n")
    return "\n".join(parts)


def help_of(arguments: list[str]) -> str:
    environment = os.environ | {"COLUMNS": "100", "NO_COLOR": "1", "TERM": "dumb"}
    command = [sys.executable, "-m", "terrainkit_cli.main", *arguments, "--help"]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return "\n".join(line.rstrip() for line in run.stdout.strip().splitlines())


def results_page() -> str:
    parts = ["# Policies on the suites\n", NOTE, RESULTS]
    cards = [json.loads(path.read_text()) for path in sorted(RESULT_FILES.glob("*.json"))]
    for suite, group in groupby(sorted(cards, key=suite_and_success), lambda card: card["map"]):
        rows = list(group)
        tests = [test["name"] for test in rows[0]["tests"]]
        parts.append(f"\n## {suite}\n\nThe share of the attempts that crossed, in percent:\n")
        header = ["policy", "speed [m/s]", "all tests", *tests]
        parts += ["| " + " | ".join(header) + " |", "|---" * len(header) + "|"]
        for card in rows:
            low, high = card["interval"]
            total = f"{100 * card['success']:.0f} ({100 * low:.0f} to {100 * high:.0f})"
            shares = [f"{100 * test['success']:.0f}" for test in card["tests"]]
            cells = [f"{card['policy']}: {card['source']}", f"{card['speed']:.2f}", total, *shares]
            parts.append("| " + " | ".join(cells) + " |")
    return "\n".join(parts) + "\n"


def suite_and_success(card: dict[str, Any]) -> tuple[str, float, str]:
    """Return the key by which results are sorted: by suite, the most successful first."""
    return card["map"], -card["success"], card["policy"]


RESULTS = """Results of `terrainkit evaluate --suite`, one JSON file each in
[benchmarks/results/policies](../benchmarks/results/policies). To add yours:

```sh
terrainkit evaluate quadruped --suite home-1 -o card   # or --policy FILE.onnx --robot ROBOT
```

Copy `card.json` to `benchmarks/results/policies/NAME-SUITE.json`, add the keys `policy` (its name),
`source` (where it is published) and `terrainkit` (the version), and run `python docs/build.py`. A
test compares the hash of the suite and recomputes the shares and the intervals, which are Wilson's
at 95 %. The attempts are at three quarters of the largest forward command of the policy.
"""


def examples_page() -> str:
    parts = ["# Examples\n", NOTE, EXAMPLES, "| example | | install |", "|---|---|---|"]
    for path in sorted((DOCS / "examples").glob("*.py")):
        summary, install = example_text(path)
        parts.append(f"| [{path.stem}](examples/{path.name}) | {summary} | {install} |")
    return "\n".join(parts) + "\n"


EXAMPLES = """Each example is a program of at most 90 lines. It runs as it is, in any folder, and
writes its files to that folder. In a clone: `python docs/examples/generate_map.py`.
The tests run the nine that need only terrainkit as they are, and the tasks of `gait_commands` and
`teacher_student`; `make integrations` runs those of frameworks, each in its framework.
[terrainkit.ipynb](examples/terrainkit.ipynb) is a notebook, in which a map is shown as a picture.
"""


def example_text(path: Path) -> tuple[str, str]:
    """Return the first paragraph of an example's docstring, and what to install."""
    docstring = ast.get_docstring(ast.parse(path.read_text())) or ""
    first, _, rest = docstring.partition("\n\n")
    command = re.search(r"pip install [^(,#\n]+", rest)
    if command is None:
        raise ConfigError(f"{path}: got a docstring without `pip install`; expected a command")
    return " ".join(first.split()), f"`{command[0].strip()}`"


def api_pages() -> dict[str, str]:
    """Return the pages of the API: the public names of each package, as its stub lists them."""
    pages: dict[str, str] = {}
    for package, page in (("terrainkit", "api"), ("terrainkit_robots", "api_robots")):
        names = public_names(package)
        modules = [name for name, module in names.items() if module == package]
        pages[f"{page}.md"] = api_page(package, [name for name in names if name not in modules])
        for name in modules:
            module = f"{package}.{name}"
            pages[f"{page}_{name}.md"] = api_page(module, module_names(module))
    return pages


def module_names(module: str) -> list[str]:
    """Return the names of `__all__` of a package, or of its modules without one."""
    package = importlib.import_module(module)
    modules = [name for _, name, _ in pkgutil.iter_modules(package.__path__) if name[0] != "_"]
    return getattr(package, "__all__", modules)


def api_page(module: str, names: list[str]) -> str:
    summary = inspect.getdoc(importlib.import_module(module)).partition("\n\n")[0]
    entries = [f"::: {module}.{name}" for name in names]
    return "\n".join([f"# {module}", "", NOTE, summary, "", *entries, ""])


def llms_text() -> str:
    """Return the pages of the site with a line each, in the format of llmstxt.org."""
    about = dict(re.findall(r"\[[^]]*\]\((\w+\.md)\): (.*)", written("index.md")))
    title, *sections = yaml.safe_load((DOCS.parent / "mkdocs.yml").read_text())["nav"]
    summary = " ".join(written("index.md").split("\n\n")[2].split())
    parts = [f"# {next(iter(title))}\n", f"> {summary}"]
    for section in sections:
        for name, pages in section.items():
            parts.append(f"\n## {name}\n")
            links = pages if isinstance(pages, list) else [{name: pages}]
            for page in links:
                ((text, file),) = page.items()
                parts.append(f"- [{text}]({file}): {about[file]}")
    return "\n".join(parts) + "\n"


def written(name: str) -> str:
    path = DOCS / name
    return path.read_text() if path.exists() else ""


def words(text: str) -> list[str]:
    # Ignore line breaks, and the metavar that argparse repeats before Python 3.13.
    return re.findall(r"[\w.:/*-]*\w", re.sub(r"^( +-[\w-]+) \w+(, --)", r"\1\2", text, flags=re.M))


def main() -> int:
    options, known = sys.argv[1:], pictures()
    names = [] if options in (["--check"], ["--pictures"]) else options
    if unknown := set(names) - set(known):
        expected = f"expected --check, --pictures or {listing(known)}"
        print(f"got {listing(sorted(unknown))}; {expected}", file=sys.stderr)
        return 2
    pages = {
        "terrains.md": terrains_page(),
        "papers.md": papers_page(),
        "rules.md": rules_page(),
        "config.md": config_page(),
        "legged_gym_names.md": names_page(),
        "cli.md": cli_page(),
        "examples.md": examples_page(),
        "policy_results.md": results_page(),
        "llms.txt": llms_text(),
        **{f"schemas/{name}.json": config_schema(kind) for name, kind in SCHEMAS.items()},
        **api_pages(),
    }
    missing = [name for name in known if not any(PICTURES.glob(f"{name}.*"))]
    if options == ["--check"]:
        stale = [n for n, text in pages.items() if words(written(n)) != words(text)]
        for problem, files in (
            ("out of date", stale),
            ("missing", [f"pictures/{name}" for name in missing]),
        ):
            if files:
                print(f"docs: {problem}: {', '.join(files)}; run python docs/build.py")
        return 1 if stale or missing else 0
    for name, text in pages.items():
        (DOCS / name).write_text(text)
    for name in known if options == ["--pictures"] else {*missing, *names}:
        known[name]()
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except ConfigError as error:
        sys.exit(str(error))
