from terrainkit.errors import one_line


def test_one_line_keeps_printable_characters():
    assert one_line("a\n\t b\u202e \x1b[2J ") == "a b [2J"
