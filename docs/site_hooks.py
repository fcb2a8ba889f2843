"""Put benchmarks/results on the site, so that links to it work there as they do on GitHub."""

from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files, InclusionLevel

RESULTS = Path(__file__).parents[1] / "benchmarks" / "results"


def on_files(files: Files, config: Any) -> Files:
    """Add the pages of results, which are not in the navigation."""
    for path in sorted(RESULTS.glob("*.md")):
        file = File.generated(config, f"results/{path.name}", abs_src_path=str(path))
        file.inclusion = InclusionLevel.NOT_IN_NAV
        files.append(file)
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Return the text of a page with the links between docs and results as on the site."""
    if page.file.src_uri.startswith("results/"):
        return markdown.replace("](../../docs/", "](../")
    return markdown.replace("](../benchmarks/results/", "](results/")
