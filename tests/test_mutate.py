import os
import sys
import time
from pathlib import Path

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
