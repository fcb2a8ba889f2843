from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

from terrainkit import TerrainkitError
from terrainkit_robots.description.fix import (
    InsertChild,
    RemoveAttribute,
    RemoveElement,
    ReplaceBytes,
    SetAttribute,
    WriteFile,
)
from terrainkit_robots.description.model import Source
from terrainkit_robots.lint.fixes.edits import EditedBytes, EditError

FILE = Path("robot.urdf")


def at(element):
    return Source(file=FILE, line=1, element=element)


def set_to(element, name, value):
    return SetAttribute(source=at(element), name=name, value=value)


def removed(element):
    return RemoveElement(source=at(element))


def without(element, name):
    return RemoveAttribute(source=at(element), name=name)


def child(element, xml, *, first=False):
    return InsertChild(source=at(element), xml=xml, first=first)


def edit_bytes(data, edits):
    edited = EditedBytes(data)
    edited.apply(edited.prepare(edits))
    return edited.result()


def edited(text, *edits):
    """Return text or bytes with the edits applied."""
    data = text if isinstance(text, bytes) else text.encode()
    result = edit_bytes(data, edits)
    return result if isinstance(text, bytes) else result.decode()


class TestSetAttribute:
    @pytest.mark.parametrize(
        ("before", "after"),
        [
            pytest.param('<a x="1"/>', '<a x="2"/>', id="plain"),
            pytest.param("<a  x =\n '1' ></a>", "<a  x =\n '2' ></a>", id="keeps quotes"),
            pytest.param('<a y="x" xx="x" x=""/>', '<a y="x" xx="x" x="2"/>', id="exact name"),
            pytest.param('<a y=">" x="/>"/>', '<a y=">" x="2"/>', id="brackets in quotes"),
            pytest.param('<a y="x=\'1\'" x="1"/>', '<a y="x=\'1\'" x="2"/>', id="quotes in quotes"),
            pytest.param('<a\r\n\tx="1"\r\n/>', '<a\r\n\tx="2"\r\n/>', id="line ends"),
        ],
    )
    def test_replaces_the_value(self, before, after):
        assert edited(before, set_to(0, "x", "2")) == after

    @pytest.mark.parametrize(
        ("before", "after"),
        [
            pytest.param("<a/>", '<a x="2"/>', id="no attributes"),
            pytest.param("<a />", '<a x="2" />', id="space before the end"),
            pytest.param("<a>t</a>", '<a x="2">t</a>', id="open tag"),
            pytest.param('<a y="1"/>', '<a y="1" x="2"/>', id="after the last"),
            pytest.param("<a y='1'/>", "<a y='1' x='2'/>", id="quotes of its neighbor"),
            pytest.param('<a\n   y="1" />', '<a\n   y="1"\n   x="2" />', id="one line each"),
            pytest.param(
                '<a y="1"\r\n   z="1"/>',
                '<a y="1"\r\n   z="1"\r\n   x="2"/>',
                id="all but the first",
            ),
            pytest.param(
                '<a\n  y="1" z="1">t</a>', '<a\n  y="1" z="1" x="2">t</a>', id="as the last"
            ),
            pytest.param(
                '<a y="1" w="1"\n z="1"/>', '<a y="1" w="1"\n z="1" x="2"/>', id="wrapped"
            ),
        ],
    )
    def test_adds_a_new_attribute(self, before, after):
        assert edited(before, set_to(0, "x", "2")) == after

    @pytest.mark.parametrize("before", ['<a x=""/>', "<a x=''/>", "<a/>"])
    def test_value_is_escaped(self, before):
        value = """<&>"' \t\n\r é ü 😀"""
        assert etree.fromstring(edited(before, set_to(0, "x", value))).get("x") == value

    def test_two_attributes_of_an_element(self):
        assert edited('<a x="1"/>', set_to(0, "x", "2"), set_to(0, "y", "3")) == '<a x="2" y="3"/>'
        assert edited("<a/>", set_to(0, "x", "2"), set_to(0, "y", "3")) == '<a x="2" y="3"/>'

    @pytest.mark.parametrize("name", ["", "1", "a b", 'a="', "é"])
    def test_invalid_name_is_rejected(self, name):
        with pytest.raises(EditError, match="not a valid attribute name"):
            edited("<a/>", set_to(0, name, "2"))

    @pytest.mark.parametrize("value", ["\0", "\x1b[0m", "\ud800", "\uffff"])
    def test_invalid_character_is_rejected(self, value):
        with pytest.raises(EditError, match="not allowed in XML"):
            edited("<a/>", set_to(0, "x", value))

    @given(
        st.text(st.characters(exclude_categories=["Cc", "Cs"], exclude_characters="\ufffe\uffff"))
    )
    @settings(max_examples=50)
    def test_any_text_is_escaped(self, value):
        assert etree.fromstring(edit_bytes(b"<a/>", [set_to(0, "x", value)])).get("x") == value


class TestRemoveAttribute:
    @pytest.mark.parametrize(
        ("before", "after"),
        [
            pytest.param('<a x="1"/>', "<a/>", id="the only one"),
            pytest.param('<a y="1"  x="1" z="1"/>', '<a y="1" z="1"/>', id="in the middle"),
            pytest.param('<a\n  y="1"\n  x="1" />', '<a\n  y="1" />', id="with its line"),
        ],
    )
    def test_removes_preceding_white_space(self, before, after):
        assert edited(before, without(0, "x")) == after

    def test_missing_one_is_rejected(self):
        with pytest.raises(EditError, match="attribute 'x' does not exist"):
            edited("<a y='1'/>", without(0, "x"))

    def test_can_be_combined_with_set(self):
        assert edited('<a x="1"/>', without(0, "x"), set_to(0, "y", "2")) == '<a y="2"/>'


class TestRemoveElement:
    @pytest.mark.parametrize(
        ("before", "after"),
        [
            pytest.param("<r><a/><b/></r>", "<r><b/></r>", id="in a line"),
            pytest.param("<r>\n  <a/>\n  <b/>\n</r>", "<r>\n  <b/>\n</r>", id="alone on its line"),
            pytest.param(
                "<r>\r\n\t<a>\r\n\t\t<c/>\r\n\t</a>\r\n</r>", "<r>\r\n</r>", id="on several lines"
            ),
            pytest.param("<r>\n  <a/> <b/>\n</r>", "<r>\n   <b/>\n</r>", id="first of two"),
            pytest.param(
                "<r>\n<!-- n -->\n<a/>\n</r>", "<r>\n<!-- n -->\n</r>", id="below a comment"
            ),
            pytest.param(
                "<r>\n  <b/><!-- a -->\n</r>", "<r>\n  <!-- a -->\n</r>", id="a comment beside"
            ),
            pytest.param("<r><a\n>x</a\n></r>", "<r></r>", id="white space in tags"),
            pytest.param("<r>x <a/>\n</r>", "<r>x\n</r>", id="no trailing white space"),
        ],
    )
    def test_removes_its_own_lines(self, before, after):
        assert edited(before, removed(1)) == after

    def test_root_is_rejected(self):
        with pytest.raises(EditError, match="root"):
            edited("<a/>", removed(0))


class TestInsertChild:
    @pytest.mark.parametrize(
        ("before", "first", "last"),
        [
            pytest.param(
                "<r>\n    <a/>\n    <b/>\n</r>",
                "<r>\n    <n/>\n    <a/>\n    <b/>\n</r>",
                "<r>\n    <a/>\n    <b/>\n    <n/>\n</r>",
                id="own line",
            ),
            pytest.param(
                "<r>\r\n\t<a/>\r\n</r>",
                "<r>\r\n\t<n/>\r\n\t<a/>\r\n</r>",
                "<r>\r\n\t<a/>\r\n\t<n/>\r\n</r>",
                id="line ends and tabs",
            ),
            pytest.param("<r><a/></r>", "<r><n/><a/></r>", "<r><a/><n/></r>", id="single line"),
            pytest.param("<r/>", "<r>\n  <n/>\n</r>", "<r>\n  <n/>\n</r>", id="opens the parent"),
            pytest.param(
                '<r x="1" />',
                '<r x="1">\n  <n/>\n</r>',
                '<r x="1">\n  <n/>\n</r>',
                id="no space left",
            ),
            pytest.param("<r></r>", "<r>\n  <n/>\n</r>", "<r>\n  <n/>\n</r>", id="an empty parent"),
            pytest.param(
                "<r>\n</r>", "<r>\n  <n/>\n</r>", "<r>\n  <n/>\n</r>", id="empty, two lines"
            ),
            pytest.param(
                "<r> <!-- b -->\n  <!-- c -->\n  <a/> <!-- d -->\n  <!-- e -->\n</r>",
                "<r> <!-- b -->\n  <n/>\n  <!-- c -->\n  <a/> <!-- d -->\n  <!-- e -->\n</r>",
                "<r> <!-- b -->\n  <!-- c -->\n  <a/> <!-- d -->\n  <!-- e -->\n  <n/>\n</r>",
                id="comments keep their place",
            ),
        ],
    )
    def test_inserts_first_or_last(self, before, first, last):
        assert edited(before, child(0, "<n/>", first=True)) == first
        assert edited(before, child(0, "<n/>")) == last

    def test_uses_indentation_of_file(self):
        before = "<r>\n   <a\n     x='1'\n   />\n</r>"
        after = "<r>\n   <a\n     x='1'>\n      <n/>\n   </a>\n</r>"
        assert edited(before, child(1, "<n/>")) == after
        assert edited("<r><a/></r>", child(1, "<n/>")) == "<r><a><n/></a></r>"

    def test_several_children_of_an_element(self):
        both = child(1, "<n/>"), child(1, "<m/>")
        assert edited("<r>\n  <a/>\n</r>", *both) == (
            "<r>\n  <a>\n    <n/>\n    <m/>\n  </a>\n</r>"
        )
        assert edited("<r><a>x</a></r>", *both) == "<r><a>x<n/><m/></a></r>"

    @pytest.mark.parametrize("xml", ["", "text", "<a>", "<a/><b/>", "<a x=1/>", "<a>\ud800</a>"])
    def test_invalid_xml_is_rejected(self, xml):
        with pytest.raises(EditError, match="is not a valid XML element"):
            edited("<r/>", child(0, xml))


class TestElements:
    def test_are_indexed_by_start_tag(self):
        before = (
            "<?xml version='1.0'?>\n<!-- <z/> --><r><a><b/></a><![CDATA[<z/>]]><?p <z/>?><c/></r>"
        )
        root = etree.fromstring(before)
        for index, element in enumerate(root.iter(etree.Element)):
            after = etree.fromstring(edited(before, set_to(index, "x", "1")))
            assert [e.tag for e in after.iter(etree.Element) if e.get("x")] == [element.tag]

    @pytest.mark.parametrize("ahead", [b"\xef\xbb\xbf", b"\n ", b"\n\xef\xbb\xbf "])
    def test_prefix_before_declaration_is_skipped(self, ahead):
        before = ahead + b"<?xml version='1.0'?><r><a/></r>"
        assert edited(before, set_to(1, "x", "1")) == before.replace(b"<a/>", b'<a x="1"/>')

    @pytest.mark.parametrize("element", [-1, 1, 10**9])
    def test_missing_one_is_rejected(self, element):
        with pytest.raises(EditError, match=f"element index: got {element}; expected less than 1"):
            edited("<a/>", set_to(element, "x", "1"))

    def test_source_without_element_is_rejected(self):
        with pytest.raises(EditError, match="cannot be edited"):
            edited("<a/>", set_to(None, "x", "1"))

    @pytest.mark.parametrize("broken", ["", "<a>", "<a x=1/>", "<a/><b/>", "<a></b>", "\0"])
    def test_malformed_file_is_rejected(self, broken):
        with pytest.raises(EditError, match="not well-formed"):
            edited(broken, set_to(0, "x", "1"))

    def test_entities_are_rejected(self):
        bomb = '<!DOCTYPE r [<!ENTITY e "<b/>">]><r>&e;<a/></r>'
        with pytest.raises(EditError, match="declare entities"):
            edited(bomb, set_to(1, "x", "1"))

    def test_edit_error_is_terrainkit_error(self):
        assert issubclass(EditError, TerrainkitError)


class TestEncodings:
    def test_declared_encoding_is_kept(self):
        before = '<?xml version="1.0" encoding="ISO-8859-1"?><a n="é" x="1"/>'.encode("latin-1")
        after = edited(before, set_to(0, "x", "ü€"))
        assert after == before.replace(b'x="1"', 'x="ü&#8364;"'.encode("latin-1"))
        assert etree.fromstring(after).get("x") == "ü€"

    @pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
    def test_utf_16_is_rejected(self, encoding):
        with pytest.raises(EditError, match=r"not supported|not well-formed"):
            edited("<a/>".encode(encoding), set_to(0, "x", "1"))

    @pytest.mark.parametrize("name", ["shift_jis", "no-such-encoding"])
    def test_unsupported_encoding_is_rejected(self, name):
        with pytest.raises(EditError, match="encoding cannot be edited"):
            edited(f'<?xml version="1.0" encoding="{name}"?><a/>', set_to(0, "x", "1"))


class TestReplaceBytes:
    def test_replaces_in_malformed_file(self):
        edit = ReplaceBytes(source=at(None), start=1, end=3, replacement=b"!")
        assert edited(b"<<<<", edit) == b"<!<"

    @pytest.mark.parametrize(("start", "end"), [(-1, 1), (2, 1), (0, 5)])
    def test_invalid_range_is_rejected(self, start, end):
        with pytest.raises(EditError, match="expected within 0 to 4"):
            edited(b"abcd", ReplaceBytes(source=at(0), start=start, end=end, replacement=b""))


def test_no_edits_change_nothing():
    assert edit_bytes(b"<broken", []) == b"<broken"


def test_write_file_is_rejected():
    with pytest.raises(EditError, match=r"foot\.stl is a new file"):
        edited("<a/>", WriteFile(path=Path("foot.stl"), content=lambda: b""))


@pytest.mark.parametrize(
    "edits",
    [
        pytest.param([set_to(1, "x", "1"), set_to(1, "x", "2")], id="one attribute twice"),
        pytest.param([set_to(1, "new", "1"), set_to(1, "new", "1")], id="new attribute twice"),
        pytest.param([set_to(1, "x", "1"), without(1, "x")], id="set and removed"),
        pytest.param([removed(1), set_to(2, "y", "1")], id="inside a removed one"),
        pytest.param([child(2, "<n/>"), removed(1)], id="inserted into a removed one"),
        pytest.param([removed(2), removed(1)], id="removed twice"),
    ],
)
def test_overlapping_edits_are_rejected(edits):
    with pytest.raises(EditError, match="two edits change"):
        edited('<r><a x="0"><b y="0"/></a></r>', *edits)


class TestSuccessiveFixes:
    TEXT = b'<r>\n  <a x="0" y="0"><b/></a>\n  <c/>\n</r>'

    @pytest.mark.parametrize(
        ("one", "other"),
        [
            pytest.param(set_to(1, "x", "1"), set_to(1, "y", "1"), id="two attributes of a tag"),
            pytest.param(set_to(1, "new", "1"), set_to(1, "new", "1"), id="new attribute twice"),
            pytest.param(removed(1), set_to(2, "x", "1"), id="inside a removed one"),
            pytest.param(set_to(2, "x", "1"), removed(1), id="around a changed one"),
            pytest.param(child(0, "<n/>"), child(0, "<n/>"), id="inserted at the same position"),
            pytest.param(child(3, "<n/>"), child(3, "<m/>"), id="opened twice"),
            pytest.param(child(0, "<n/>"), removed(3), id="inserted after a removed one"),
        ],
    )
    def test_later_overlapping_fix_is_rejected(self, one, other):
        text = EditedBytes(self.TEXT)
        text.apply(text.prepare([one]))
        alone = text.result()
        with pytest.raises(EditError, match="another fix"):
            text.apply(text.prepare([set_to(0, "unrelated", "1"), other]))
        assert text.result() == alone != self.TEXT

    def test_separate_fixes_are_applied(self):
        text = EditedBytes(self.TEXT)
        text.apply(text.prepare([set_to(1, "x", "1")]))
        text.apply(text.prepare([set_to(2, "z", "1")]))
        text.apply(text.prepare([removed(3)]))
        text.apply(text.prepare([child(0, "<n/>", first=True)]))
        assert text.result() == b'<r>\n  <n/>\n  <a x="1" y="0"><b z="1"/></a>\n</r>'

    def test_many_fixes_are_fast(self):
        count = 20_000
        text = EditedBytes(b"<r>" + b"<a/>\n" * count + b"</r>")
        for index in range(count, 0, -1):
            text.apply(text.prepare([set_to(index, "x", "1")]))
        assert text.result() == b"<r>" + b'<a x="1"/>\n' * count + b"</r>"


def test_long_tags_are_fast():
    attributes = "".join(f' a{k}="1"' for k in range(20_000))
    assert edited(f"<a{attributes}/>", set_to(0, "x", "1")) == f'<a{attributes} x="1"/>'
    blanks = " " * 100_000
    assert edited(f"<r>{blanks}<a{blanks}/></r>", set_to(1, "x", "1")) == (
        f'<r>{blanks}<a x="1"{blanks}/></r>'
    )


@st.composite
def documents(draw):
    """Return XML whose elements have unique tags, and their number."""
    blank = st.sampled_from(["", " ", "\n", "\r\n  ", "\t", "<!-- <x y='1'> -->", "text"])
    quote = st.sampled_from("\"'")
    names = iter(range(1000))

    def element(depth):
        tag, space = f"e{next(names)}", draw(st.sampled_from([" ", "\n   ", "  "]))
        q, value = draw(quote), draw(st.sampled_from(["", "1", ">", "/>", "&lt;", " x = 1 "]))
        attributes = draw(
            st.sampled_from(["", f"{space}x={q}{value}{q}", f"{space}y ={q}{value}{q} "])
        )
        children = draw(st.integers(0, 3)) if depth else 0
        if not children and draw(st.booleans()):
            return f"<{tag}{attributes}/>"
        inner = "".join(draw(blank) + element(depth - 1) + draw(blank) for _ in range(children))
        return f"<{tag}{attributes}>{inner}</{tag}>"

    return element(3), next(names)


@given(documents(), st.data())
@settings(max_examples=50, deadline=None)
def test_other_elements_are_unchanged(document, data):
    text, count = document
    index = data.draw(st.integers(0, count - 1))
    before = [dict(e.attrib) for e in etree.fromstring(text).iter(etree.Element)]
    before[index]["x"] = "new"
    after = edited(text, set_to(index, "x", "new"))
    elements = etree.fromstring(after).iter(etree.Element)
    assert [dict(e.attrib) for e in elements] == before
    tag = f"<e{index}"
    ahead, _, behind = text.partition(tag)
    assert after.startswith(ahead + tag)
    changed = after[len(ahead) :].partition(tag)[2]
    while changed[-1:] == behind[-1:] and changed and behind:
        changed, behind = changed[:-1], behind[:-1]
    assert "<" not in changed.replace("<!--", "")


@given(documents(), st.data())
@settings(max_examples=50, deadline=None)
def test_inserted_element_can_be_removed(document, data):
    text, count = document
    index = data.draw(st.integers(0, count - 1))
    inside = edited(text, child(index, "<new/>", first=data.draw(st.booleans())))
    root = etree.fromstring(inside)
    tags = [e.tag for e in root.iter(etree.Element)]
    place = tags.index("new")
    assert next(root.iter("new")).getparent().tag == f"e{index}"
    outside = etree.fromstring(edited(inside, removed(place)))
    assert [e.tag for e in outside.iter(etree.Element)] == [t for t in tags if t != "new"]
