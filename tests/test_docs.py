"""The generated pages of the docs have the defaults, names and limits of the code."""

import importlib.util
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"


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
