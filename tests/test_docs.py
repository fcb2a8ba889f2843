"""The generated pages of the docs have the defaults, names and limits of the code; links work.

test_docs_session.py runs the blocks of the pages.
"""

import importlib.util
import inspect
import re
from pathlib import Path

import pytest
import yaml

import terrainkit
import terrainkit_robots
from terrainkit_cli.main import main
from tests.frameworks.pages import DOCS, ROOT, page_blocks
from tests.robots import QUADRUPED

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


@pytest.mark.parametrize("package", [terrainkit, terrainkit_robots], ids=lambda p: p.__name__)
def test_api_has_a_page_for_each_module_and_an_entry_for_each_name(package):
    texts = {page.name: page.read_text() for page in DOCS.glob("api*.md")}
    for name in package.__all__:
        value = getattr(package, name)
        is_page = inspect.ismodule(value) and value.__name__ == f"{package.__name__}.{name}"
        entry = f"# {value.__name__}\n" if is_page else f"::: {package.__name__}.{name}\n"
        assert any(entry in text for text in texts.values()), name


def test_readme_is_short_and_has_two_setup_commands():
    text = (ROOT / "README.md").read_text()
    (part,) = re.findall(r"<!-- set-up -->(.*?)<!-- /set-up -->", text, re.DOTALL)
    assert re.findall(r"```sh\n(.*?)```", part, re.DOTALL) == [
        "pip install . && terrainkit generate --rows 10 --cols 10 -o map.npz\n",
        'pip install -e ".[dev]" && python -m pytest\n',
    ]
    assert len(text.splitlines()) <= 150


def test_handwritten_pages_are_short():
    pages = [path.read_text().partition("<!-- Written by docs/")[0] for path in DOCS.glob("*.md")]
    assert sum(len(page.split()) for page in pages) <= 33_000


def test_index_lists_all_pages():
    """The pages of packages of the API are listed on api.md."""
    pages = {path.name for path in DOCS.glob("*.md") if not path.name.startswith("api_")}
    listed = set(re.findall(r"\]\((\w+\.md)\)", (DOCS / "index.md").read_text()))
    assert listed | {"index.md"} >= pages


def test_suppressions_of_the_check_robot_page_work(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    blocks = dict(page_blocks("check_robot.md"))
    axis = '<axis xyz="0 2 0"/>\n'
    text = QUADRUPED.read_text().replace('<axis xyz="0 1 0"/>\n', axis, 1)
    asked = ["check-robot", "my_robot.urdf", "--select", "JNT005", "--strict"]
    Path("my_robot.urdf").write_text(text)
    assert main(asked) == 1
    Path("my_robot.urdf").write_text(text.replace(axis, blocks["xml"]))
    assert main(asked) == 0
    assert "the parser normalizes it" in capsys.readouterr().out
    Path("my_robot.urdf").write_text(text)
    Path("pyproject.toml").write_text(blocks["toml"])
    assert main(asked) == 0
    assert "our parser normalizes axes" in capsys.readouterr().out


def test_pictures_and_policies_are_small():
    """Each version of them stays in the history."""
    limits = {"*.png": 1e6, "*.svg": 1e6, "*.webp": 2e6, "*.pt": 1e6}
    files = {
        path: limit for name, limit in limits.items() for path in ROOT.glob(f"[dr]o*/**/{name}")
    }
    assert files
    assert [path for path, limit in files.items() if path.stat().st_size > limit] == []


def test_sources_have_no_sphinx_markup():
    """The site and editors show docstrings as Markdown, in which it is noise."""
    markup = re.compile(r":[a-z]+:`|\.\. [a-z]+::")
    folders = ("terrainkit", "robots", "cli", "docs")
    files = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    assert files
    assert [str(path) for path in files if markup.search(path.read_text(encoding="utf-8"))] == []
    assert all(markup.search(text) for text in (":func:`run`", ".. math:: x"))
