"""Escape text from untrusted files before it is printed."""


def escape_control(text: str) -> str:
    """Return `text` on one line, with characters that a terminal interprets as hex escapes.

    These are control characters, escape sequences, marks that change the writing direction, and
    bytes of file names that are not valid text.
    """
    if text.isprintable():
        return text
    return "".join(_escape_character(character) for character in text)


def _escape_character(character: str) -> str:
    if character.isprintable():
        return character
    if character.isspace() and character not in "\x0b\x0c\x1c\x1d\x1e\x1f\x85\u2028\u2029":
        return " "
    return character.encode("unicode_escape").decode("ascii")


def escape_surrogates(text: str) -> str:
    """Return `text` with lone surrogates escaped, so that it can be encoded as UTF-8."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")
