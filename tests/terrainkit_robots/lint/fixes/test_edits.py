import tomllib
from pathlib import Path

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from lxml import etree

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
EDITS = tomllib.loads(Path(__file__).with_name("edits.toml").read_text())


def at(element):
    return Source(file=FILE, line=1, element=element)


def set_to(element, name, value):
    return SetAttribute(source=at(element), name=name, value=value)


def removed(element):
    return RemoveElement(source=at(element))


def without(element, name):
    return RemoveAttribute(source=at(element), name=name)


def child(element, xml):
    return InsertChild(source=at(element), xml=xml)


def edit_bytes(data, edits):
    edited = EditedBytes(data)
    edited.apply(edited.prepare(edits))
    return edited.result()


def edited(text, *edits):
    """Return text or bytes with the edits applied."""
    data = text if isinstance(text, bytes) else text.encode()
    result = edit_bytes(data, edits)
    return result if isinstance(text, bytes) else result.decode()


@pytest.mark.parametrize(("before", "after"), EDITS["set"])
def test_attribute_is_set(before, after):
    assert edited(before, set_to(0, "x", "2")) == after


@pytest.mark.parametrize(("before", "after"), EDITS["without"])
def test_attribute_is_removed_with_preceding_white_space(before, after):
    assert edited(before, without(0, "x")) == after


def test_two_edits_of_an_element():
    assert edited('<a x="1"/>', set_to(0, "x", "2"), set_to(0, "y", "3")) == '<a x="2" y="3"/>'
    assert edited("<a/>", set_to(0, "x", "2"), set_to(0, "y", "3")) == '<a x="2" y="3"/>'
    assert edited('<a x="1"/>', without(0, "x"), set_to(0, "y", "2")) == '<a y="2"/>'


@pytest.mark.parametrize("before", ['<a x=""/>', "<a x=''/>", "<a/>"])
@given(st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\ufffe\uffff")))
@settings(max_examples=50)
def test_any_text_is_escaped(before, value):
    value = "".join(letter for letter in value if letter >= " " or letter in "\t\n\r")
    after = edit_bytes(before.encode(), [set_to(0, "x", value)])
    assert etree.fromstring(after).get("x") == value


@pytest.mark.parametrize(("before", "after"), EDITS["removed"])
def test_element_is_removed_with_its_own_lines(before, after):
    assert edited(before, removed(1)) == after


@pytest.mark.parametrize(("before", "after"), EDITS["inserted"])
def test_child_is_inserted_first(before, after):
    assert edited(before, child(0, "<n/>")) == after


SET = set_to(0, "x", "1")
REJECTED = {
    "not a valid attribute name": [("<a/>", set_to(0, n, "2")) for n in ("", "1", 'a="', "é")],
    "not allowed in XML": [
        ("<a/>", set_to(0, "x", value)) for value in ("\0", "\x1b[0m", "\ud800", "\uffff")
    ],
    "attribute 'x' does not exist": [("<a y='1'/>", without(0, "x"))],
    "root": [("<a/>", removed(0))],
    "without children": [(text, child(0, "<a/>")) for text in ("<r/>", "<r>x</r>")],
    "element index: got .*; expected less than 1": [
        ("<a/>", set_to(index, "x", "1")) for index in (-1, 1, 10**9)
    ],
    "cannot be edited": [("<a/>", set_to(None, "x", "1"))],
    "not well-formed": [
        (text, SET) for text in ("", "<a>", "<a x=1/>", "<a/><b/>", "<a></b>", "\0")
    ],
    "declare entities": [('<!DOCTYPE r [<!ENTITY e "<b/>">]><r>&e;</r>', SET)],
    "not supported|not well-formed": [
        ("<a/>".encode(name), SET) for name in ("utf-16", "utf-16-le", "utf-16-be")
    ],
    "encoding cannot": [
        (f'<?xml version="1.0" encoding="{name}"?><a/>', SET) for name in ("shift_jis", "other")
    ],
    "expected within 0 to 4": [
        ("abcd", ReplaceBytes(source=at(0), start=start, end=end, replacement=b""))
        for start, end in ((-1, 1), (2, 1), (0, 5))
    ],
    r"foot\.stl is a new file": [("<a/>", WriteFile(path=Path("foot.stl"), content=bytes))],
}


@pytest.mark.parametrize(("message", "cases"), REJECTED.items())
def test_impossible_edit_is_rejected(message, cases):
    for before, edit in cases:
        with pytest.raises(EditError, match=message):
            edited(before, edit)


def test_elements_are_indexed_by_start_tag():
    before = "<?xml version='1.0'?>\n<!-- <z/> --><r><a><b/></a><![CDATA[<z/>]]><?p <z/>?><c/></r>"
    root = etree.fromstring(before)
    for index, element in enumerate(root.iter(etree.Element)):
        after = etree.fromstring(edited(before, set_to(index, "x", "1")))
        assert [e.tag for e in after.iter(etree.Element) if e.get("x")] == [element.tag]


@pytest.mark.parametrize("ahead", [b"\xef\xbb\xbf", b"\n ", b"\n\xef\xbb\xbf "])
def test_prefix_before_declaration_is_skipped(ahead):
    before = ahead + b"<?xml version='1.0'?><r><a/></r>"
    assert edited(before, set_to(1, "x", "1")) == before.replace(b"<a/>", b'<a x="1"/>')


def test_declared_encoding_is_kept():
    before = '<?xml version="1.0" encoding="ISO-8859-1"?><a n="é" x="1"/>'.encode("latin-1")
    after = edited(before, set_to(0, "x", "ü€"))
    assert after == before.replace(b'x="1"', 'x="ü&#8364;"'.encode("latin-1"))


def test_malformed_file_can_be_replaced():
    edit = ReplaceBytes(source=at(None), start=1, end=3, replacement=b"!")
    assert edited(b"<<<<", edit) == b"<!<"
    assert edit_bytes(b"<broken", []) == b"<broken"


@pytest.mark.parametrize(
    "edits",
    [
        [set_to(1, "x", "1"), set_to(1, "x", "2")],
        [set_to(1, "new", "1"), set_to(1, "new", "1")],
        [set_to(1, "x", "1"), without(1, "x")],
        [removed(1), set_to(2, "y", "1")],
        [child(1, "<n/>"), removed(1)],
        [removed(2), removed(1)],
    ],
    ids=["attribute", "new attribute", "removed attribute", "inside", "inserted", "twice"],
)
def test_overlapping_edits_are_rejected(edits):
    with pytest.raises(EditError, match="two edits change"):
        edited('<r><a x="0"><b y="0"/></a></r>', *edits)


class TestSuccessiveFixes:
    TEXT = b'<r>\n  <a x="0" y="0"><b/></a>\n  <c/>\n</r>'

    @pytest.mark.parametrize(
        ("one", "other"),
        [
            (set_to(1, "x", "1"), set_to(1, "y", "1")),
            (set_to(1, "new", "1"), set_to(1, "new", "1")),
            (removed(1), set_to(2, "x", "1")),
            (set_to(2, "x", "1"), removed(1)),
            (child(0, "<n/>"), child(0, "<n/>")),
        ],
        ids=["tag", "attribute", "inside", "around", "position"],
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
        text.apply(text.prepare([child(0, "<n/>")]))
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
    assume(len(next(etree.fromstring(text).iter(f"e{index}"))))
    inside = edited(text, child(index, "<new/>"))
    root = etree.fromstring(inside)
    tags = [e.tag for e in root.iter(etree.Element)]
    place = tags.index("new")
    assert next(root.iter("new")).getparent().tag == f"e{index}"
    outside = etree.fromstring(edited(inside, removed(place)))
    assert [e.tag for e in outside.iter(etree.Element)] == [t for t in tags if t != "new"]
