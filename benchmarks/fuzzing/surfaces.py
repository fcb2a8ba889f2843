"""The surfaces: the kinds of files that terrainkit reads, and the commands that read them."""

import io
import os
import shlex
import shutil
import sys
import tomllib
from dataclasses import dataclass, field
from fnmatch import fnmatch
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

from fuzzing.forked import Command
from fuzzing.mutators import DAMAGE, mutators

FILE = Path(__file__).with_suffix(".toml")

_ODD_NAMES = ("a\nb", "-o", "\udcff", "é" * 100, "a b{}", "x" * 240)


@dataclass(frozen=True, kw_only=True)
class Surface:
    """A kind of files."""

    name: str
    seconds: float
    """Share of the time."""

    imports: list[str]
    """Packages that are imported before processes are forked."""

    seeds: list[str] = field(default_factory=list)
    """Commands that write valid files, besides the files in the folder `seeds`."""

    commands: dict[str, list[str]]
    """Commands that read a damaged file, by pattern of its name; `{}` is the file."""

    hostile: list[dict[str, Any]] = field(default_factory=list)
    """Inputs that are always tried: `file`, `text`, and `repeat`, which follows `times` times. With
    `find`, the text replaces the first such part of the file. The text of an ONNX file is in the
    syntax of `onnx.parser`; what is found in it becomes bytes that are no text."""

    has_plugins: bool = False
    """Whether the folder is a folder of Python packages."""


def load_surfaces() -> list[Surface]:
    """Return all surfaces."""
    return [Surface(**table) for table in tomllib.loads(FILE.read_text())["surface"]]


def prepare_seed(previous: Path, line: str) -> Command:
    """Copy a folder with valid files to the current one, and return a command that writes more."""
    if previous.is_dir():
        shutil.copytree(previous, ".", dirs_exist_ok=True)
    return Command(words=shlex.split(line))


def prepare(
    surface: Surface, seeds: Path, seed: int, index: int, data: bytes | None = None
) -> Command:
    """Write an input to the current folder, and return the command that reads it.

    Args:
        surface: The surface.
        seeds: Folder of its valid files.
        seed: Seed of all inputs.
        index: Number of the input.
        data: Content that replaces the content of the damaged file.
    """
    rng, hostile = Random(f"{seed} {surface.name} {index}"), surface.hostile[index : index + 1]
    shutil.copytree(seeds, ".", dirs_exist_ok=True)
    if surface.has_plugins:
        sys.path.insert(0, str(Path.cwd()))
    check: Any = str
    if hostile:
        path = Path(hostile[0]["file"])
        pattern = next(key for key in surface.commands if fnmatch(path.name, key))
        _write_hostile(path, hostile[0])
    else:
        pattern = rng.choice(list(surface.commands))
        path = rng.choice(sorted(Path().rglob(pattern)))
        if rng.random() < 0.03:
            path = _replace_path(path, rng)
        elif _mutate(path, rng) and path.suffix == ".pt":
            check = partial(_compare, path, seeds / path)
    if data is not None:
        path.write_bytes(data)
    line = surface.commands[pattern][0] if hostile else rng.choice(surface.commands[pattern])
    words = [word.replace("{}", str(path)) for word in shlex.split(line)]
    return Command(words=words, path=path, check=check)


def _write_hostile(path: Path, entry: dict[str, Any]) -> None:
    data, find = entry["text"].encode(), entry.get("find", "").encode()
    if path.suffix == ".onnx":
        import onnx

        data = onnx.parser.parse_model(entry["text"]).SerializeToString()
        data = data.replace(find, b"\xff" * len(find)) if find else data
    elif find:
        data = path.read_bytes().replace(find, data, 1)
    with path.open("wb") as target:
        target.write(data)
        target.writelines(entry["repeat"].encode() for _ in range(entry.get("times", 0)))


def _mutate(path: Path, rng: Random) -> bool:
    """Damage or edit a file; return whether it was only damaged."""
    data, chosen = path.read_bytes(), rng.choices(mutators(path.suffix), k=rng.choice((1, 1, 2, 3)))
    for mutator in chosen:
        try:
            data = mutator(data, rng) or b"\0"
        except Exception:  # what is already damaged cannot be edited
            break
    path.write_bytes(data)
    return set(chosen) <= set(DAMAGE)


def _replace_path(path: Path, rng: Random) -> Path:
    """Rename a file, or replace it by something that is no file; return its path."""
    if rng.random() < 0.3:
        return path.rename(path.with_name(rng.choice(_ODD_NAMES) + path.suffix))
    path.unlink()
    links = (partial(path.symlink_to, target) for target in (path.name, "/dev/zero", "missing"))
    rng.choice((*links, partial(os.mkfifo, path), path.mkdir, path.touch))()
    return path


def _compare(path: Path, original: Path) -> str:
    """Return whether a damaged checkpoint is read as another state than the original."""
    import torch

    from terrainkit_robots.checkpoint import read_checkpoint

    contents = io.BytesIO(), io.BytesIO()
    for each, content in zip((path, original), contents, strict=True):
        torch.save(read_checkpoint(each), content)
    damaged, expected = (content.getvalue() for content in contents)
    return "" if damaged == expected else f"a damaged {path.name}, whose content differs"
