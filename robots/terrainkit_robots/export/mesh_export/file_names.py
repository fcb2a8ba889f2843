"""Names of files that are written: safe on every disk and in every format, each content once."""

import hashlib
import re

_MOST_LETTERS = 80
"""Longer names are cut: folders of robots are deep, and Windows takes 260 letters in all."""

_DEVICES = re.compile(r"(?:con|prn|aux|nul|com\d|lpt\d)", re.IGNORECASE)
"""Windows takes these for devices, whatever their suffix."""


class FileNames:
    """Files of one folder, by name."""

    def __init__(self, folder: str) -> None:
        """Start with nothing; `folder` goes before each name, with a slash."""
        self._folder = folder
        self._of_content: dict[tuple[str, bytes], str] = {}
        self._taken: set[str] = set()
        self.files: dict[str, bytes] = {}
        """Content by name, in the order in which it came."""

    def add(self, wanted: str, suffix: str, data: bytes) -> str:
        """Return the name of a file with this content, which is a new one or the one it has.

        Names differ before their suffix, and not only in capitals: MuJoCo goes by the one, many
        disks by the other.

        Args:
            wanted: What to call it, without suffix; it may be anything.
            suffix: With its dot.
            data: Content.
        """
        key = suffix, hashlib.sha256(data).digest()
        if key not in self._of_content:
            name = f"{self._folder}/{self._free(_plain(wanted))}{suffix}"
            self._of_content[key] = name
            self.files[name] = data
        return self._of_content[key]

    def _free(self, stem: str) -> str:
        free, number = stem, 1
        while free.lower() in self._taken:
            number += 1
            free = f"{stem}_{number}"
        self._taken.add(free.lower())
        return free


def _plain(name: str) -> str:
    plain = re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_-")[:_MOST_LETTERS] or "mesh"
    return f"{plain}_mesh" if _DEVICES.fullmatch(plain) else plain
