"""The generated pages of the docs have the defaults, names and limits of the code; links work."""

import importlib.util
import re
from pathlib import Path

import pytest
import yaml

import terrainkit
import terrainkit.curriculum
import terrainkit.feasibility
import terrainkit.perception
import terrainkit_robots

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [*ROOT.glob("*.md"), *DOCS.rglob("*.md"), *(ROOT / "benchmarks").rglob("*.md")]


@pytest.fixture(scope="module")
def build():
    """Return the module docs/build.py."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(DOCS)
        spec = importlib.util.spec_from_file_location("docs_build", DOCS / "build.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("page", ["config", "terrains", "rules", "cli"])
def test_generated_page_is_up_to_date(build, page):
    expected = getattr(build, f"{page}_page")()
    assert build.words((DOCS / f"{page}.md").read_text()) == build.words(expected)


def _anchors(page):
    """Return the anchors of the headings of a page, as GitHub and MkDocs make them."""
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
    titles = re.findall(r"^#+ (.*?) *$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files_and_headings(page):
    text = re.sub(r"```.*?```|`[^`\n]*`", "", page.read_text(), flags=re.DOTALL)
    for path, anchor in re.findall(r"\]\((?!\w+:)([^)#\s]*)#?([^)\s]*)\)", text):
        target = page.parent / path if path else page
        assert target.exists(), path
        assert not anchor or anchor in _anchors(target), f"{path}#{anchor}"


def _nav_pages(entry):
    """Yield the files in an entry of the navigation of the site."""
    for value in entry.values():
        if isinstance(value, str):
            yield value
        else:
            for child in value:
                yield from _nav_pages(child)


def test_site_has_a_link_to_each_page():
    nav = yaml.safe_load((ROOT / "mkdocs.yml").read_text())["nav"]
    linked = [page for entry in nav for page in _nav_pages(entry)]
    assert sorted(linked) == sorted(page.name for page in DOCS.glob("*.md"))


@pytest.mark.parametrize(
    "package",
    [
        terrainkit,
        terrainkit.curriculum,
        terrainkit.feasibility,
        terrainkit.perception,
        terrainkit_robots,
    ],
    ids=lambda package: package.__name__,
)
def test_api_pages_have_each_public_name(package):
    texts = [page.read_text() for page in DOCS.glob("api*.md")]
    documented = {line.rpartition(".")[2] for text in texts for line in text.splitlines()}
    assert package.__all__
    assert set(package.__all__) - documented == set()
