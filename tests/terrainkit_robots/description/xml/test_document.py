import os
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

from terrainkit_robots.description.xml import document as xml_document
from terrainkit_robots.description.xml.document import (
    RobotFileError,
    leading_bytes_fix,
    parse_xml,
    read_bytes,
)


@pytest.fixture
def file(tmp_path):
    return tmp_path / "robot.urdf"


def parse(file, text):
    return parse_xml(file, text if isinstance(text, bytes) else text.encode())


def lines(document):
    """Return the line of each element, in the order in which they start."""
    return [document.source(e).line for e in document.root.iter(etree.Element)]


def codes(document):
    return [problem.code for problem in document.problems]


# Lines


def test_line_of_start_tag(file):
    document = parse(file, '<robot name="r">\n  <link name="a"/>\n\n  <link name="b"/>\n</robot>\n')
    assert lines(document) == [1, 2, 4]
    assert document.problems == ()


def test_line_with_multiline_attributes(file):
    text = '<robot\n  name="r"\n  >\n  <link\n     name="a"\n  ><inertial\n/></link>\n</robot>'
    assert lines(parse(file, text)) == [1, 4, 6]


def test_line_after_comments(file):
    text = (
        '<?xml version="1.0"?>\n<!-- <robot> <link/>\n -->\n<?pi <a>?>\n'
        "<robot>\n<!--\n<link/>\n--><link/>\n<![CDATA[ <link> ]]>\n<joint/></robot>\n<!-- end -->"
    )
    assert lines(parse(file, text)) == [5, 8, 10]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_line_endings(file, end):
    text = end.join(["<robot>", "<!-- a", "comment -->", "<link", 'name="a"/>', "<link/>"])
    assert lines(parse(file, text + "</robot>")) == [1, 4, 6]


def test_element_index(file):
    document = parse(file, "<robot><link><visual/></link><!-- a --><joint/></robot>")
    order = [(e.tag, document.source(e).element) for e in document.root.iter(etree.Element)]
    assert order == [("robot", 0), ("link", 1), ("visual", 2), ("joint", 3)]


def test_source_file(file):
    document = parse(file, "<robot><link/></robot>")
    assert {source.file for source in document.sources.values()} == {file}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "iso-8859-1"])
def test_declared_encoding(file, encoding):
    text = f'<?xml version="1.0" encoding="{encoding}"?>\n<robot name="Käfer">\n<link/>\n</robot>'
    document = parse(file, text.encode(encoding))
    assert document.root.get("name") == "Käfer"
    assert lines(document) == [2, 3]


@st.composite
def documents(draw):
    """Return a well-formed document, and the line on which each of its elements starts."""
    pieces, lines = [], []
    breaks = st.sampled_from(["", "\n", "\n\n", " ", "<!-- <x>\n -->", "&lt;", "text\n"])

    def element(depth):
        lines.append("".join(pieces).count("\n") + 1)
        tag = draw(st.sampled_from(["robot", "link", "joint", "a-b", "xacro:macro"]))
        pieces.extend(["<", tag, draw(st.sampled_from(["", " ", "\n"]))])
        if draw(st.booleans()):
            pieces.extend([" name=", draw(st.sampled_from(["\n", ""])), "'a\n>b'"])
        if draw(st.booleans()):
            pieces.append("/>")
            return
        pieces.append(">")
        for _ in range(draw(st.integers(0, 3 if depth < 3 else 0))):
            pieces.append(draw(breaks))
            element(depth + 1)
        pieces.append(draw(breaks))
        pieces.append(f"</{tag}\n>")

    pieces.append(draw(st.sampled_from(["", "<?xml version='1.0'?>\n", "\n\n", "<!--\n-->"])))
    element(0)
    return "".join(pieces), lines


@settings(max_examples=100, deadline=None)
@given(documents())
def test_lines_of_real_files(tmp_path_factory, document):
    text, wanted = document
    assert lines(parse(tmp_path_factory.getbasetemp() / "r.urdf", text)) == wanted


# What stands before the document


@pytest.mark.parametrize(
    "ahead", [b"\xef\xbb\xbf", b"\n \xef\xbb\xbf", b"\xef\xbb\xbf\xef\xbb\xbf\n"]
)
def test_byte_order_mark_is_reported(file, ahead):
    text = b'<?xml version="1.0"?>\n<robot>\n<link/></robot>'
    document = parse(file, ahead + text)
    assert codes(document) == ["XML009"]
    assert document.problems[0].source.line == 1
    above = ahead.count(b"\n")
    assert lines(document) == [2 + above, 3 + above]


def test_space_before_declaration_is_reported(file):
    assert codes(parse(file, "\n<?xml version='1.0'?><robot/>")) == ["XML009"]


def test_space_without_declaration_is_allowed(file):
    document = parse(file, "\n\n  <robot/>")
    assert codes(document) == []
    assert lines(document) == [3]


@pytest.mark.parametrize("ahead", [b"\xef\xbb\xbf", b" \n", b"\n\xef\xbb\xbf \xef\xbb\xbf"])
def test_leading_bytes_fix(file, ahead):
    text = b'<?xml version="1.0"?>\n<robot/>'
    problem = parse(file, ahead + text).problems[0]
    (edit,) = leading_bytes_fix(problem).edits
    assert (ahead + text)[: edit.start] + edit.replacement + (ahead + text)[edit.end :] == text
    assert parse(file, text).problems == ()


# Broken documents


def test_broken_document_is_recovered(file):
    document = parse(file, '<robot>\n<link name="a">\n</robot>\n')
    assert codes(document)[0] == "XML001"
    assert document.problems[0].source.line == 3
    assert "mismatch" in document.problems[0].message
    assert [link.get("name") for link in document.root.iter("link")] == ["a"]


def test_broken_document_cannot_be_edited(file):
    document = parse(file, "<robot>\n<link>\n<visual/>\n</robot>")
    assert lines(document) == [1, 2, 3]
    assert {source.element for source in document.sources.values()} == {None}


def test_lines_of_broken_document(file):
    assert lines(parse(file, b"\n\n\xef\xbb\xbf<robot>\n<link>\n</robot>")) == [3, 4]


def test_syntax_error_per_line(file):
    document = parse(file, '<robot>\n<link name=a b=c/>\n<link x="1" x="2"/>\n</robot>')
    assert [p.source.line for p in document.problems] == [2, 3]
    assert set(codes(document)) == {"XML001"}


def test_number_of_syntax_errors_is_limited(file):
    document = parse(file, "<robot>" + "\n<link name=a/>" * 500 + "</robot>")
    assert 1 < len(document.problems) <= 20


def test_ampersand_is_reported(file):
    document = parse(file, '<robot name="a & b">\n<link name="c"/></robot>')
    assert codes(document) == ["XML001"]
    assert len(document.root) == 1


def test_undeclared_prefix_is_allowed(file):
    document = parse(file, "<robot>\n<xacro:macro/>\n<link/></robot>")
    assert codes(document) == []
    assert lines(document) == [1, 2, 3]


@pytest.mark.parametrize("data", [b"", b" \n\t", b"\xef\xbb\xbf", b"\xef\xbb\xbf \n"])
def test_empty_file(file, data):
    document = parse(file, data)
    assert document.root is None
    assert codes(document) == ["XML001"]
    assert "empty" in document.problems[0].message


@pytest.mark.parametrize(
    "data",
    [b"just text", b"\x00" * 100, b"\x7fELF\x02\x01\x01", bytes(range(256)), b"{}", b"<", b"<<<"],
)
def test_not_xml(file, data):
    document = parse(file, data)
    assert document.root is None
    assert set(codes(document)) == {"XML001"}


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=60))
def test_any_bytes_raise_nothing(tmp_path_factory, data):
    document = parse(tmp_path_factory.getbasetemp() / "r.urdf", data)
    assert (document.root is None) <= bool(document.problems)


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 90), st.integers(0, 8), st.binary(max_size=4))))
def test_damage_is_reported_or_harmless(tmp_path_factory, cuts):
    data = b'<?xml version="1.0"?>\n<robot name="r">\n<link name="a">\n</link><!-- b --></robot>\n'
    for at, length, other in cuts:
        data = data[:at] + other + data[at + length :]
    document = parse(tmp_path_factory.getbasetemp() / "r.urdf", data)
    if document.root is not None:
        assert all(
            0 <= line <= data.count(b"\n") + data.count(b"\r") + 1 for line in lines(document)
        )
    try:
        etree.fromstring(data)
    except etree.XMLSyntaxError:
        assert document.problems


# Size


def test_large_file_is_not_parsed(file, monkeypatch):
    monkeypatch.setattr(xml_document, "MAX_BYTES", 2**20)
    document = parse(file, b"<robot>" + b" " * 2**20 + b"</robot>")
    assert document.root is None
    assert codes(document) == ["XML001"]
    assert "1 MiB" in document.problems[0].message


def test_too_many_elements_are_rejected(file, monkeypatch):
    monkeypatch.setattr(xml_document, "MAX_ELEMENTS", 1000)
    document = parse(file, "<robot>" + "<link/>" * 1000 + "</robot>")
    assert document.root is None
    assert "1000 elements" in document.problems[0].message
    assert parse(file, "<robot>" + "<link/>" * 999 + "</robot>").root is not None


def test_deep_document(file):
    document = parse(file, "<a>" * 100_000 + "</a>" * 100_000)
    assert "XML001" in codes(document)


def test_million_links(file):
    assert parse(file, b"<robot>" + b"<link/>\n" * 1_000_000 + b"</robot>").root is None


# Trust

BOMB = """<?xml version="1.0"?>
<!DOCTYPE robot [
<!ENTITY a "lollollollollollollollollollollol">
<!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">
<!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;">
<!ENTITY d "&c;&c;&c;&c;&c;&c;&c;&c;&c;&c;">
<!ENTITY e "&d;&d;&d;&d;&d;&d;&d;&d;&d;&d;">
<!ENTITY f "&e;&e;&e;&e;&e;&e;&e;&e;&e;&e;">
<!ENTITY g "&f;&f;&f;&f;&f;&f;&f;&f;&f;&f;">
<!ENTITY h "&g;&g;&g;&g;&g;&g;&g;&g;&g;&g;">
]>
"""


@pytest.mark.parametrize("body", ["<robot>&h;<link/></robot>", '<robot name="&h;"/>'])
def test_entity_bomb(file, body):
    document = parse(file, BOMB + body)
    assert "XML010" in codes(document)
    assert len(etree.tostring(document.root)) < 10_000 if document.root is not None else True


def test_entities_are_reported(file):
    document = parse(file, BOMB + "<robot/>")
    problem = next(p for p in document.problems if p.code == "XML010")
    assert problem.source.line == 2


def test_entities_are_not_expanded(file):
    text = '<!DOCTYPE robot [<!ENTITY a "<link/><link/>">]>\n<robot>&a;\n<joint/></robot>'
    document = parse(file, text)
    assert [e.tag for e in document.root.iter(etree.Element)] == ["robot", "joint"]
    assert lines(document)[1] == 3


def test_external_files_are_not_read(file, tmp_path):
    (tmp_path / "secret").write_text("a secret")
    (tmp_path / "secret.dtd").write_text('<!ENTITY b "a secret">')
    text = (
        f'<!DOCTYPE robot SYSTEM "{tmp_path}/secret.dtd" '
        f'[<!ENTITY a SYSTEM "file://{tmp_path}/secret">]>\n<robot>&a;&b;</robot>'
    )
    document = parse(file, text)
    assert "XML010" in codes(document)
    assert b"a secret" not in etree.tostring(document.root)


# Files


def test_read_bytes(file):
    file.write_bytes(b"\xef\xbb\xbf\r\n<robot/>")
    assert read_bytes(file) == b"\xef\xbb\xbf\r\n<robot/>"


def test_read_bytes_is_limited(file, monkeypatch):
    monkeypatch.setattr(xml_document, "MAX_BYTES", 1000)
    file.write_bytes(b" " * 5000)
    assert len(read_bytes(file)) == 1001


def test_missing_file(file):
    with pytest.raises(RobotFileError, match=r"there is no file .*robot\.urdf"):
        read_bytes(file)


def test_folder_is_rejected(tmp_path):
    with pytest.raises(RobotFileError, match="it is a folder"):
        read_bytes(tmp_path)


def test_pipe_is_rejected(file):
    os.mkfifo(file)
    with pytest.raises(RobotFileError, match="not a file"):
        read_bytes(file)


def test_device_is_rejected(file):
    file.symlink_to("/dev/zero")
    with pytest.raises(RobotFileError, match="not a file"):
        read_bytes(file)


def test_symbolic_link_cycle(file, tmp_path):
    file.symlink_to(tmp_path / "other")
    (tmp_path / "other").symlink_to(file)
    with pytest.raises(RobotFileError, match="cannot read"):
        read_bytes(file)


@pytest.mark.parametrize("name", ["a\0b", "a" * 5000])
def test_invalid_path(tmp_path, name):
    with pytest.raises(RobotFileError, match="cannot read"):
        read_bytes(tmp_path / name)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_no_permission(file):
    file.write_text("<robot/>")
    file.chmod(0)
    with pytest.raises(RobotFileError, match=r"cannot read .*ermission"):
        read_bytes(file)


@pytest.mark.parametrize("encoding", ["utf-16-be", "utf-16-le", "utf-32-be", "utf-32-le", "utf-16"])
def test_wide_encodings_are_read_in_their_byte_order(encoding):
    text = '<robot name="\u00e9"/>'
    data = text.encode(encoding)
    problem = parse_xml(Path("robot.urdf"), data).problems[0]
    assert (problem.code, problem.details["text"]) == ("XML009", text)
    assert problem.details["bytes"] == str(len(data))
    assert f"encoded as {encoding[:6].upper()}, " in problem.message
