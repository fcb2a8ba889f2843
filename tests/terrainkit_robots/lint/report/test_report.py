import pytest

from terrainkit_robots.lint.report import FORMATS, to_text


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_lists_every_code(name, report):
    text = to_text([report], name)
    assert text.endswith("\n")
    for code in ("INR002", "JNT007", "LEG001"):
        assert code in text
