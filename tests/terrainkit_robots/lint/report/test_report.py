import pytest

from terrainkit_robots.lint.report import FORMATS, as_text


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_ends_its_lines_and_has_every_code(name, report):
    text = as_text([report], name)
    assert text.endswith("\n")
    for code in ("INR002", "JNT007", "LEG001"):
        assert code in text
