import os
from pathlib import Path

import pytest
from lxml import etree

from terrainkit_robots.description.xml import document as xml_document
from terrainkit_robots.description.xml.document import (
    RobotFileError,
    parse_xml,
    read_bytes,
)
from tests.tables import read_table
from tests.terrainkit_robots.description.made_robots import codes

FILE = Path("robot.urdf")


def parse(text):
    return parse_xml(FILE, text if isinstance(text, bytes) else text.encode())


def lines(document):
    """Return the line of each element, in the order in which they start."""
    return [document.source(each).line for each in document.root.iter(etree.Element)]


def fixed(data, fix):
    """Return the bytes of a file after a fix."""
    (edit,) = fix.edits
    return data[: edit.start] + edit.replacement + data[edit.end :]


@pytest.mark.parametrize(("text", "wanted"), read_table(__file__, "line_of_start_tag"))
def test_line_of_start_tag(text, wanted):
    document = parse(text)
    assert (lines(document), document.problems) == (wanted, ())
    sources = list(document.sources.values())
    assert [each.element for each in sources] == list(range(len(wanted)))
    assert {each.file for each in sources} == {FILE}


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_line_endings(end):
    text = end.join(["<robot>", "<!-- a", "comment -->", "<link", 'name="a"/>', "<link/>"])
    assert lines(parse(text + "</robot>")) == [1, 4, 6]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "iso-8859-1"])
def test_declared_encoding(encoding):
    text = f'<?xml version="1.0" encoding="{encoding}"?>\n<robot name="Käfer">\n<link/>\n</robot>'
    document = parse(text.encode(encoding))
    assert (document.root.get("name"), lines(document)) == ("Käfer", [2, 3])


# What stands before the document

DECLARED = b'<?xml version="1.0"?>\n<robot>\n<link/></robot>'


@pytest.mark.parametrize(
    ("ahead", "what"),
    [
        (b"\xef\xbb\xbf", "a byte order mark"),
        (b"\n\xef\xbb\xbf \xef\xbb\xbf\n", "a byte order mark"),
        (b" \n", "white space before the XML declaration"),
    ],
)
def test_leading_bytes_are_reported_and_removed(ahead, what):
    document = parse(ahead + DECLARED)
    (problem,) = document.problems
    assert (problem.code, problem.source.line, problem.subject) == ("XML009", 1, "robot.urdf")
    assert problem.message == f"the file starts with {what}, which some parsers reject"
    assert lines(document) == [2 + ahead.count(b"\n"), 3 + ahead.count(b"\n")]
    assert fixed(ahead + DECLARED, problem.fix) == DECLARED
    assert problem.fix.description == "Remove the leading bytes."


@pytest.mark.parametrize("encoding", ["utf-16-be", "utf-16-le", "utf-32-be", "utf-32-le", "utf-16"])
def test_wide_encodings_are_reported_and_written_as_utf8(encoding):
    text = f'<?xml version="1.0" encoding="{encoding}"?><robot name="é"/>'
    data = text.encode(encoding)
    problem = parse(data).problems[0]
    assert (problem.code, problem.source.line, problem.severity) == ("XML009", 1, "error")
    assert f"encoded as {encoding[:6].upper()}, " in problem.message
    utf8 = text.replace(encoding, "UTF-8").encode()
    assert fixed(data, problem.fix) == utf8
    assert problem.fix.description == "Write the file as UTF-8."


@pytest.mark.parametrize(("version", "is_valid"), [("1.0", True), ("1.1", True), ("2.0", False)])
def test_version_of_xml(version, is_valid):
    ahead = b"\xef\xbb\xbf"
    data = ahead + DECLARED.replace(b"1.0", version.encode())
    found = [problem for problem in parse(data).problems if problem.code != "XML009"]
    assert [problem.code for problem in found] == ([] if is_valid else ["XML001"])
    for problem in found:
        assert f"version in <?xml?>: got '{version}'; expected 1.0" in problem.message
        assert fixed(data, problem.fix) == ahead + DECLARED
        assert problem.severity == "warning"


def test_broken_document_is_recovered():
    document = parse(b'\n\xef\xbb\xbf<robot>\n<link name="a">\n</robot>\n')
    assert codes(document)[:2] == ["XML009", "XML001"]
    problem = document.problems[1]
    assert problem.source.line == 3
    assert problem.message.startswith("malformed XML: Opening and ending tag mismatch")
    assert [(each.line, each.element) for each in document.sources.values()] == [
        (2, None),
        (3, None),
    ]


def test_each_line_has_one_syntax_error():
    document = parse('<robot>\n<link name=a b=c/>\n<link x="1" x="2"/>\n<c d="a & b"/></robot>')
    assert [(each.code, each.source.line) for each in document.problems] == [
        ("XML001", line) for line in (2, 3, 4)
    ]
    assert len(parse("<robot>" + "\n<link name=a/>" * 50 + "</robot>").problems) == 20


@pytest.mark.parametrize("data", [b"", b" \n\t", b"\xef\xbb\xbf", b"\xef\xbb\xbf \n"])
def test_empty_file(data):
    document = parse(data)
    (problem,) = document.problems
    assert (document.root, problem.code, problem.source.line) == (None, "XML001", 0)
    assert problem.message == "the file is empty; expected a <robot> or <mujoco> element"


@pytest.mark.parametrize(
    "data", [b"just text", b"\x00" * 9, b"\x7fELF\x02\x01\x01", bytes(range(256)), b"{}", b"<<<"]
)
def test_not_xml(data):
    document = parse(data)
    assert (document.root, set(codes(document))) == (None, {"XML001"})


@pytest.mark.parametrize(
    ("name", "most", "text", "says"),
    [
        ("MAX_BYTES", 2**20, "<a>" + " " * (2**20 - 7) + "</a>", "more than 1 MiB;"),
        ("MAX_ELEMENTS", 9, "<a>" + "<b/>" * 8 + "</a>", "more than 9 elements;"),
        ("MAX_ATTRIBUTES", 3, "<a><b x='' y='' z=''/></a>", "more than 3 attributes;"),
    ],
)
def test_limits(name, most, text, says, monkeypatch):
    monkeypatch.setattr(xml_document, name, most)
    assert parse(text).problems == ()
    document = parse(text.replace("</a>", "<b/></a>").replace("x=''", "w='' x=''"))
    assert (document.root, codes(document)) == (None, ["XML001"])
    assert says in document.problems[0].message


def test_deep_document():
    assert "XML001" in codes(parse("<a>" * 100_000 + "</a>" * 100_000))


BOMB = "<?xml version='1.0'?>\n<!DOCTYPE r [<!ENTITY a 'aaaaaaaaaa'>{}]>\n".format(
    "".join(f"<!ENTITY {b} '{f'&{a};' * 10}'>" for a, b in zip("abcdefg", "bcdefgh", strict=True))
)


@pytest.mark.parametrize("body", ["<r>&h;<link/></r>", '<r name="&h;"/>', "<r/>"])
def test_entity_bomb(body):
    document = parse(BOMB + body)
    problem = next(each for each in document.problems if each.code == "XML010")
    assert problem.source.line == 2
    assert document.root is None or len(etree.tostring(document.root)) < 10_000


def test_entities_are_not_expanded():
    document = parse('<!DOCTYPE r [<!ENTITY a "<b/><b/>">]>\n<r>&a;\n<c/></r>')
    assert [each.tag for each in document.root.iter(etree.Element)] == ["r", "c"]
    assert lines(document) == [2, 3]


@pytest.mark.parametrize(
    ("doctype", "found"), [("SYSTEM 'x.dtd'", ["XML010"]), ("", []), ("[<!ELEMENT r ANY>]", [])]
)
def test_only_entities_and_external_files_are_reported(doctype, found):
    assert codes(parse(f"<!DOCTYPE r {doctype}><r/>")) == found
    assert codes(parse("<r>SYSTEM</r>")) == []


def test_external_files_are_not_read(tmp_path):
    (tmp_path / "secret").write_text("a secret")
    (tmp_path / "secret.dtd").write_text('<!ENTITY b "a secret">')
    document = parse(
        f'<!DOCTYPE r SYSTEM "{tmp_path}/secret.dtd" '
        f'[<!ENTITY a SYSTEM "file://{tmp_path}/secret">]>\n<r>&a;&b;</r>'
    )
    assert "XML010" in codes(document)
    assert b"a secret" not in etree.tostring(document.root)


def test_read_bytes(tmp_path, monkeypatch):
    file = tmp_path / "robot.urdf"
    file.write_bytes(b"\xef\xbb\xbf\r\n<robot/>")
    assert read_bytes(file) == b"\xef\xbb\xbf\r\n<robot/>"
    monkeypatch.setattr(xml_document, "MAX_BYTES", 5)
    assert read_bytes(file) == b"\xef\xbb\xbf\r\n<"


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("missing", "there is no file .*/missing$"),
        (".", "cannot read .*: it is a folder"),
        ("pipe", "cannot read .*: it is a pipe, not a file"),
        ("device", "not a file"),
        ("loop", "cannot read .*/loop: Too many levels"),
        ("a\0b", "cannot read "),
        ("a" * 5000, "cannot read "),
    ],
)
def test_unreadable_files(name, says, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "device").symlink_to("/dev/zero")
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(RobotFileError, match=says):
        read_bytes(tmp_path / name)
