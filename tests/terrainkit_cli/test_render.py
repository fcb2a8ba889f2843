import warnings
from types import SimpleNamespace

import pytest

from terrainkit import TerrainkitWarning
from terrainkit_cli import render


def test_warnings_are_one_line(capsys, monkeypatch):
    monkeypatch.setattr(warnings, "showwarning", render.show_warning)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.warn("cliffs", TerrainkitWarning, stacklevel=1)
        warnings.warn_explicit("two\nlines", RuntimeWarning, "dunes.py", 12)
        warnings.warn_explicit("one", UserWarning, "dunes.py", 13)
    assert capsys.readouterr().err.splitlines() == [
        "terrainkit: warning: cliffs",
        "terrainkit: warning: dunes.py:12: RuntimeWarning: two lines",
        "terrainkit: warning: dunes.py:13: UserWarning: one",
    ]


@pytest.mark.parametrize(("columns", "width"), [(59, 60), (61, 61), (119, 119), (121, 120)])
def test_reports_are_60_to_120_columns_wide(monkeypatch, columns, width):
    monkeypatch.setenv("COLUMNS", str(columns))
    assert render.width() == width


def test_steps_in_a_file_are_lines_from_time_to_time(capsys, monkeypatch):
    times = iter([0.0, 9.9, 10.0, 10.0, 19.9, 20.1, 20.1])
    monkeypatch.setattr(render, "time", SimpleNamespace(monotonic=times.__next__))
    with render.steps() as steps:
        for share in ("1%", "2%", "3%", "4%"):
            steps.update(share)
    assert capsys.readouterr().err == "terrainkit: 2%\nterrainkit: 4%\n"
