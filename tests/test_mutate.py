import os
import sys
import time
from pathlib import Path
from unittest.mock import MagicMock

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(autouse=True)
def benchmarks_on_path(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "benchmarks")


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("a < b", {"a <= b", "a >= b"}),
        ("a is not b", {"a is b"}),
        ("(a) not in (b)", {"(a) in (b)"}),
        ("a and (b) and c", {"a or (b) and c", "a and (b) or c"}),
        ("x = -n", {"x = n"}),
        ("x = 3", {"x = 4", "x = 0", "x = 6"}),
        ("x = True", {"x = False"}),
        ("x = a // b", {"x = a * b"}),
        ("x = 'a' + b", set()),
        ("x = f(a, b)", {"x = f(b, a)"}),
        ("x = np.max(a)", {"x = np.min(a)"}),
        ("x = d['k']", {"x = d['k_']"}),
        ("x = [a for a in b if a]", {"x = [a for a in b if True]"}),
        ("f()", {"pass"}),
        ("x.y = z", {"pass"}),
        ("x += n", {"pass"}),
        ("if a: b", {"if True: b", "if False: b"}),
        ("def f(): return a", {"def f(): return None"}),
        ("def f(a: Literal[2]) -> T[1]: '''1 < 2'''", set()),
        ("x = 'ä', a < b", {"x = 'ä', a <= b", "x = 'ä', a >= b"}),
    ],
)
def test_changes_of_a_line(line, expected):
    from mutation.changes import find_changes

    source = line.encode()
    changes = [each for each in find_changes(source) if each.is_valid(source)]
    assert {each.apply(source).decode() for each in changes} == expected


def test_lines_of_changes_are_those_of_the_statement():
    from mutation.changes import find_changes

    source = "x = 1\ndef f(a=1):\n  if (a <\n      b):\n    g(\n      True,\n    )\n  return c\n"
    changes = {(each.line, each.kind): each.lines for each in find_changes(source.encode())}
    assert changes == {
        (1, "constant"): range(0),  # executed on import
        (2, "constant"): range(0),
        (3, "comparison"): range(3, 5),
        (3, "condition"): range(3, 5),
        (5, "removed"): range(5, 8),
        (6, "constant"): range(5, 8),
        (8, "return"): range(8, 9),
    }


@pytest.mark.parametrize(
    ("covered", "runs"),
    [
        ("test_files", [("test_files", {"test"})]),
        ("test_policy", [("test_files", None), ("test_wide", None), ("test_policy", {"test"})]),
        ("", [("test_files", None), ("test_wide", None), ("test_policy", None)]),
    ],
)
def test_statement_that_coverage_does_not_see_is_tested_by_its_package(tmp_path, covered, runs):
    """Beyond the package, only `test_policy` names the file."""
    import mutate

    tests = tmp_path / "tests/terrainkit_robots"
    for name in ("export/test_files", "export/wide/test_wide", "policy/test_policy", "rl/test_rl"):
        (tests / name).parent.mkdir(parents=True, exist_ok=True)
        (tests / f"{name}.py").write_text("COPY = 'program.py'" * ("policy" in name))
    tree = MagicMock(folder=tmp_path)
    tree.test_files = lambda folder: [
        file.relative_to(tmp_path) for file in (tmp_path / folder).rglob("*.py")
    ]
    tree.covering = lambda file, *_: {"test"} if file.stem == covered else set()
    tree.run.return_value.noticed = ""
    path = "robots/terrainkit_robots/export/program.py"
    planted = mutate.Planted(path=path, line=1, kind="", before="", after="", digest="")
    found = mutate.try_change(tree, planted, b"", MagicMock(), mutate.STAGES)
    assert (found.noticed_by, found.stage) == ("", "suite")
    assert [(call.args[0].stem, call.args[1]) for call in tree.run.call_args_list] == runs


@pytest.mark.skipif(sys.platform != "linux", reason="Linux only")
def test_endless_runs_are_ended_with_their_children(monkeypatch, tmp_path):
    from mutation import runner

    # The pages of this process, which the children share, count for each of them.
    monkeypatch.setattr(runner, "_MEMORY", 1 << 50)
    child = os.fork()
    if not child:
        os.setsid()
        other = os.fork()
        if other:
            (tmp_path / "other").write_text(str(other))
        else:
            os.setsid()
        while True:
            time.sleep(1)
    assert runner.wait(child, time.monotonic() + 2) == "time"
    with pytest.raises(ProcessLookupError):
        os.kill(child, 0)
    other = int((tmp_path / "other").read_text())
    status = Path(f"/proc/{other}/status")
    assert not status.exists() or "zombie" in status.read_text()
