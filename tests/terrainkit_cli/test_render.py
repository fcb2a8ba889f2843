import warnings

from terrainkit import TerrainkitWarning
from terrainkit_cli import render


def test_warnings_are_one_line(capsys, monkeypatch):
    monkeypatch.setattr(warnings, "showwarning", render.show_warning)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.warn("cliffs", TerrainkitWarning, stacklevel=1)
        warnings.warn_explicit("two\nlines", RuntimeWarning, "dunes.py", 12)
    told = "terrainkit: warning: dunes.py:12: RuntimeWarning: two lines"
    assert capsys.readouterr().err.splitlines() == ["terrainkit: warning: cliffs", told]
