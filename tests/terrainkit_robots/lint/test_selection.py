import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.check import Suppressed, lint_selected, select_rules
from terrainkit_robots.lint.rule import rules
from terrainkit_robots.lint.settings import Settings, matching
from tests.small_robots import link
from tests.tables import read_table


def codes(found):
    return {each.code for each in found}


def check(path, text, **settings):
    """Return the report of INR002, negative-mass, on `text`."""
    path.write_text(text)
    wanted = Settings(**{"select": ("INR002",)} | settings)
    return lint_selected(Facts(load_robot(path)), wanted)


@pytest.fixture
def file(tmp_path):
    return tmp_path / "robot.urdf"


def test_all_rules_are_selected_by_default():
    chosen, left_out = select_rules(Settings())
    assert chosen == rules()
    assert left_out == ()


def test_ignored_rules_are_listed_with_reason():
    settings = Settings(select=("INR",), ignore={"INR002": "a balloon", "JNT": "no joints"})
    chosen, left_out = select_rules(settings)
    assert codes(chosen) == codes(matching("INR")) - {"INR002"}
    assert [(s.code, s.reason) for s in left_out] == [("INR002", "ignored: a balloon")]


def test_unknown_ignored_rule_is_rejected():
    with pytest.raises(ConfigError, match="no rule 'NOPE1'"):
        select_rules(Settings(ignore={"NOPE1": "why"}))


NOTE = "<!-- terrainkit: ignore INR002 a balloon -->"
MASS = "<inertial>\n<mass value='-1'/>"
A, B = link("a", mass=-1), link("b", mass=-1)


@pytest.mark.parametrize(("text", "left"), read_table(__file__, "suppressed"))
def test_comment_suppresses_its_element(file, text, left):
    text = text.format(A=A, B=B, NOTE=NOTE, MASS=MASS)
    report = check(file, f'<robot name="r">\n{text}\n</robot>\n')
    assert [finding.subject for finding in report.findings] == left
    ignored = [skipped for skipped in report.skipped if isinstance(skipped, Suppressed)]
    assert len(ignored) + len(left) == text.count("-1")
    assert {each.comment.reason for each in ignored} <= {"a balloon"}


def test_comment_suppresses_only_its_rule_and_has_a_reason(file):
    text = f"<robot>\n{NOTE.replace('INR002', 'XML003')}\n{A}\n</robot>"
    assert codes(check(file, text).findings) == {"INR002"}
    assert codes(check(file, f"<robot>{A}</robot>", select=("XML003",)).findings) == {"XML003"}
    report = check(file, f'<robot name="r">\n<link name="x"/>\n{NOTE}\n{A}\n</robot>')
    (ignored,) = report.skipped
    assert ignored.reason == "suppressed for a (robot.urdf:4): a balloon"
    assert (ignored.finding.subject, report.verdict) == ("a", "pass")


def test_comment_above_root_applies_to_robot_only(file):
    comment = "<!-- terrainkit: ignore XML003, INR002 a test -->"
    for start in (f"{comment}\n<robot>", f"<robot> {comment}"):
        text = f"{start}\n<link name='x'/>\n{A}\n</robot>"
        report = check(file, text, select=("INR002", "XML003"))
        assert codes(report.findings) == {"INR002"}
        assert codes(s for s in report.skipped if isinstance(s, Suppressed)) == {"XML003"}


def test_comment_in_malformed_file_and_other_encodings_is_read(file):
    text = f'<robot name="r">\n{NOTE}\n{A}\n{B}\n'
    for data in (
        f"{text}<oops>\n</robot>".encode(),
        f"{text}</robot>".encode("utf-16"),
        f"{text}</robot>".encode("utf-8-sig"),
    ):
        file.write_bytes(data)
        report = lint_selected(Facts(load_robot(file)), Settings(select=("INR002",)))
        assert [finding.subject for finding in report.findings] == ["b"]


def test_replaced_contents_have_own_comments(file):
    text = f'<robot name="r">\n{A}\n</robot>'
    file.write_text(text)
    contents = {file: text.replace("\n<link", f"\n{NOTE} <link").encode()}
    facts = Facts(load_robot(file, contents=contents))
    assert lint_selected(facts, Settings(select=("INR002",)), contents).findings == ()
    assert len(lint_selected(facts, Settings(select=("INR002",))).findings) == 1


@pytest.mark.parametrize(("comment", "said"), read_table(__file__, "invalid_comment_is_reported"))
def test_invalid_comment_is_reported(file, comment, said):
    report = check(file, f'<robot name="r">\n<!-- terrainkit: {comment} -->\n{A}\n</robot>')
    assert codes(report.findings) == {"INR002"}
    (idle,) = report.skipped
    assert idle.kind == "unused"
    assert idle.reason.startswith(f"comment at {file}:2: ")
    assert said in idle.reason


def test_unused_comment_of_a_selected_rule_is_reported(file):
    text = f'<robot name="r">\n{NOTE}\n<link name="a"/>\n</robot>'
    (idle,) = check(file, text).skipped
    assert idle.reason == f"comment at {file}:2: unused suppression: INR002 has no finding here"
    assert check(file, text, select=("XML003",)).skipped == ()
    ignoring = check(file, text, ignore={"INR002": "here"})
    assert [s.kind for s in ignoring.skipped] == ["ignored"]


def test_file_without_comments_is_not_parsed_again(file, monkeypatch):
    import terrainkit_robots.description.xml.document as xml_document

    file.write_text(f'<robot name="r">{A}</robot>')
    facts = Facts(load_robot(file))
    monkeypatch.setattr(xml_document, "parse_xml", lambda *_: pytest.fail("parsed"))
    assert codes(lint_selected(facts, Settings(select=("INR002",))).findings) == {"INR002"}


def test_long_words_are_cut(file):
    long = "X" * 10**6
    report = check(file, f"<robot><!-- terrainkit: ignore {long} {long} -->{A}</robot>")
    assert len(report.skipped[0].reason) < 1000


def test_comment_in_xacro_macro_applies_to_each_use(tmp_path):
    part = A.replace('"a"', '"${n}"').replace("<inertial>", f" {NOTE}\n<inertial>")
    text = f"""<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r">
      <xacro:macro name="part" params="n">{part}</xacro:macro>
      <xacro:part n="a"/>
      <xacro:part n="b"/>
      {B.replace('"b"', '"c"')}
    </robot>"""
    report = check(tmp_path / "robot.xacro", text)
    assert [finding.subject for finding in report.findings] == ["c"]
    assert [s.finding.subject for s in report.skipped if isinstance(s, Suppressed)] == ["a", "b"]
