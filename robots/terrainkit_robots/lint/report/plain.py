"""Plain text: words from a file that nobody vouches for, made fit to be printed."""


def plain(text: str) -> str:
    """Return `text` on one line, with what a terminal would act on written out in hex.

    That is control characters, escape sequences, marks that turn the direction of writing, and
    bytes of file names that are no characters.
    """
    if text.isprintable():
        return text
    return "".join(_shown(character) for character in text)


def _shown(character: str) -> str:
    if character.isprintable():
        return character
    if character.isspace() and character not in "\x0b\x0c\x1c\x1d\x1e\x1f\x85\u2028\u2029":
        return " "
    return character.encode("unicode_escape").decode("ascii")


def encodable(text: str) -> str:
    """Return `text` with what no encoding can hold, halves of surrogate pairs, written out."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")
