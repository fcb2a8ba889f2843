"""Xacro: expanded by the xacro package, in a process of its own.

Xacro evaluates Python expressions, and macros may call themselves. So it runs apart (see
`process`), with limits on time and memory, and gives back text. ROS is not needed: packages
are found by `Packages`.
"""

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from terrainkit.errors import TerrainkitError
from terrainkit_robots.description.xacro.process import ORIGIN

SECONDS = 8.0
"""How long an expansion may take [s]; large robots take half a second."""

_BYTES = 2**30
"""How much memory it may take."""

_SECRET = re.compile(r"TOKEN|SECRET|PASSW|CREDENTIAL|KEY|AUTH|COOKIE", re.IGNORECASE)
"""Environment variables called so are not for `$(env)` in a file that somebody else wrote."""


class XacroError(TerrainkitError):
    """A file that cannot be expanded; says what is missing, and how to give it."""

    def __init__(self, message: str, place: tuple[Path, int] | None = None) -> None:
        super().__init__(message)
        self.place = place
        """File and line of the element at which it failed, if that is known."""


@dataclass(frozen=True, kw_only=True)
class Expansion:
    """An expanded file."""

    data: bytes
    """The URDF; each element has its origin, for `pop_origin`."""

    files: tuple[Path, ...]
    """The file and all that it includes."""


def expand_xacro(
    file: Path,
    arguments: Mapping[str, str],
    packages: Mapping[str, Path],
    *,
    seconds: float = SECONDS,
    memory: int = _BYTES,
) -> Expansion:
    """Return what a xacro file expands to.

    Args:
        file: The file.
        arguments: Value of each xacro argument.
        packages: Folder of each ROS package, where a search would not find it.
        seconds: How long it may take.
        memory: How many bytes of memory it may take, where the system can tell.

    Raises:
        XacroError: if it cannot be expanded, or not within the limits.
    """
    wanted = {
        "file": str(file.absolute()),
        "arguments": dict(arguments),
        "packages": {name: str(folder.absolute()) for name, folder in packages.items()},
        "seconds": seconds,
        "memory": memory,
    }
    output = _run(json.dumps(wanted).encode(), seconds)
    try:
        answer = json.loads(output)
    except ValueError:
        raise XacroError(
            f"the xacro file could not be expanded: it needs more than {memory / 2**30:g} GiB of "
            "memory, or made the xacro package crash"
        ) from None
    if "error" in answer:
        place = answer["place"]
        raise XacroError(answer["error"], place and (Path(place[0]), int(place[1])))
    return Expansion(data=answer["xml"].encode(), files=tuple(map(Path, answer["files"])))


def _run(request: bytes, seconds: float) -> bytes:
    """Return what the other process answers.

    It inherits no open file, and finds modules where this one does: without the current folder,
    which may well be that of the robot.
    """
    environment = {name: text for name, text in os.environ.items() if not _SECRET.search(name)}
    environment["PYTHONPATH"] = os.pathsep.join(
        str(Path(entry).absolute()) for entry in sys.path if entry
    )
    with subprocess.Popen(
        [sys.executable, "-P", "-m", "terrainkit_robots.description.xacro.process"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=environment,
        start_new_session=True,
    ) as process:
        try:
            return process.communicate(request, timeout=seconds)[0]
        except subprocess.TimeoutExpired:
            _kill(process)
            raise XacroError(
                f"the xacro file did not expand within {seconds:g} s; a macro or an expression "
                "takes too long"
            ) from None
        except BaseException:
            _kill(process)
            raise


def _kill(process: "subprocess.Popen[bytes]") -> None:
    if hasattr(os, "killpg"):
        os.killpg(process.pid, signal.SIGKILL)  # and whatever it may have started
    else:
        process.kill()


def pop_origin(element: Any, files: tuple[Path, ...]) -> tuple[Path, int] | None:
    """Take the origin off an element of an expanded document: file and line, if it has one."""
    words = element.attrib.pop(ORIGIN, "").split(":")
    if len(words) != 2 or not all(word.isdecimal() for word in words):
        return None
    index, line = map(int, words)
    return (files[index], line) if index < len(files) else None
