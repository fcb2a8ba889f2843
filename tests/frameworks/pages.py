"""The code blocks of the pages of the documentation. It runs under Python 3.8 as well."""

import re
import textwrap
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


def page_blocks(page):
    """Return the blocks of a page, in order, as pairs of language and text.

    Args:
        page: Name of a page in docs, such as `importing.md`, or `README.md`.
    """
    text = ((ROOT if page == "README.md" else DOCS) / page).read_text(encoding="utf-8")
    found = re.findall(r"^( *)```(\w*)\n(.*?)^\1```$", text, re.MULTILINE | re.DOTALL)
    return [(language, textwrap.dedent(block)) for _, language, block in found]


def page_block(page, text):
    """Return the block of a page that contains a text; no other may."""
    (found,) = (block for _, block in page_blocks(page) if text in block)
    return found
