"""Choose the names of exported files: valid on every file system, and one per content."""

import hashlib
import re

from terrainkit_robots.text import UniqueNames

_MAX_LENGTH = 80
"""Maximum length of a name; paths on Windows have at most 260 characters."""

_DEVICE_NAMES = re.compile(r"(?:con|prn|aux|nul|com\d|lpt\d)", re.IGNORECASE)
"""Device names on Windows, with any suffix."""


class FileNames:
    """Files of a folder by name."""

    def __init__(self, folder: str) -> None:
        """Create an empty set of files in `folder`."""
        self._folder = folder
        self._by_content: dict[tuple[str, bytes], str] = {}
        self._stems = UniqueNames()
        self.files: dict[str, bytes] = {}
        """Content by name, in the order of insertion."""

    def add(self, stem: str, suffix: str, data: bytes) -> str:
        """Add a file, and return its name; equal content shares one file.

        Names differ before their suffix and in more than letter case, because MuJoCo ignores the
        suffix and many file systems ignore case.

        Args:
            stem: Preferred name without suffix, with any characters.
            suffix: Suffix with its dot.
            data: Content.
        """
        key = suffix, hashlib.sha256(data).digest()
        if key not in self._by_content:
            plain = _sanitize(stem)
            number = self._stems.add(plain.lower()).removeprefix(plain.lower())
            name = f"{self._folder}/{plain}{number}{suffix}"
            self._by_content[key] = name
            self.files[name] = data
        return self._by_content[key]


def _sanitize(name: str) -> str:
    plain = re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_-")[:_MAX_LENGTH] or "mesh"
    return f"{plain}_mesh" if _DEVICE_NAMES.fullmatch(plain) else plain
