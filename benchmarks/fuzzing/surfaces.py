"""The surfaces: the kinds of files that terrainkit reads, and the commands that read them."""

import io
import json
import os
import shlex
import shutil
import sys
import tomllib
import zipfile
from dataclasses import dataclass, field
from fnmatch import fnmatch
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

from fuzzing.calls import call, prepare_call
from fuzzing.forked import Command
from fuzzing.mutators import DAMAGE, mutators
from fuzzing.names import prepare_name
from fuzzing.words import prepare_words

FILE = Path(__file__).with_suffix(".toml")
CORPUS = FILE.with_name("corpus")
"""Inputs that failed once: folders of a surface with the `command` of an input and its file."""

_NUM_OBS, _NUM_ACTIONS = 141, 12
"""Sizes of the policy of `quadruped`."""

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

    files: list[dict[str, Any]] = field(default_factory=list)
    """Further valid files, written like hostile ones."""

    inputs: str = "files"
    """What is damaged: `files`; `words` of the command lines; arguments of `calls`, which are the
    commands then; or `names` of a robot."""

    check: str = ""
    """How a damaged file that a command accepts is judged: a name in CHECKS."""

    escapes: list[str] = field(default_factory=list)
    """Files in the folder `escapes` with further hostile inputs."""

    commands: dict[str, list[str]]
    """Commands that read a damaged file, by pattern of its name; `{}` is the file."""

    hostile: list[dict[str, Any]] = field(default_factory=list)
    """Inputs that are tried before random ones: `file`, `text`, `repeat`, which follows `times`
    times, and `end`. With `find`, the text replaces the first such part of the file. The text of an
    ONNX file is in the syntax of `onnx.parser`; what is found in it becomes bytes that are no text.
    `link` and `pipe` make a link or a named pipe, `escape` a TorchScript escape; `beside` has more
    files."""

    has_plugins: bool = False
    """Whether the folder is a folder of Python packages."""


def load_surfaces() -> list[Surface]:
    """Return all surfaces."""
    surfaces = [Surface(**table) for table in tomllib.loads(FILE.read_text())["surface"]]
    for surface in surfaces:
        for name in surface.escapes:
            table = tomllib.loads(FILE.with_name("escapes").joinpath(f"{name}.toml").read_text())
            scripts = [{"file": "policy/policy.pt", "escape": escape} for escape in table]
            names = [{"name": text} for text in table.get("names", [])]
            surface.hostile.extend(table.get("hostile", names or scripts))
    return surfaces


def corpus(surface: Surface) -> list[Path]:
    """Return the folders of the inputs that failed once."""
    return sorted(path.parent for path in (CORPUS / surface.name).glob("*/command"))


def num_listed(surface: Surface) -> int:
    """Return the number of inputs that are tried before random ones."""
    return len(corpus(surface)) + len(surface.hostile)


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
    rng, kept = Random(f"{seed} {surface.name} {index}"), corpus(surface)
    if seeds.is_dir():
        shutil.copytree(seeds, ".", dirs_exist_ok=True)
    for entry in surface.files:
        _write_hostile(Path(entry["file"]), entry)
    if surface.has_plugins:
        sys.path.insert(0, str(Path.cwd()))
    if index < len(kept):
        command = _prepare_kept(surface, kept[index])
    elif surface.inputs == "files":
        command = _prepare_file(surface, seeds, rng, index - len(kept))
    else:
        command = _prepare_other(surface, rng, index - len(kept))
    if data is not None:
        command.path.write_bytes(data)
    return command


def _prepare_kept(surface: Surface, folder: Path) -> Command:
    if (folder / "work").is_dir():
        shutil.copytree(folder / "work", ".", dirs_exist_ok=True)
    log = json.loads((folder / "command").read_text())
    path, run = Path(log["path"]), call if surface.inputs == "calls" else None
    check = partial(CHECKS[surface.check], path, path) if surface.check else str
    return Command(words=log["words"], path=path, run=run, check=check)


def _prepare_other(surface: Surface, rng: Random, index: int) -> Command:
    lines = [line for lines in surface.commands.values() for line in lines]
    if surface.inputs == "words":
        return prepare_words(lines, rng)
    if surface.inputs == "calls":
        return prepare_call(lines, rng)
    names = [entry["name"] for entry in surface.hostile]
    name = names[index] if index < len(names) else "".join(rng.choices(names, k=2))
    return prepare_name(rng.choice(lines), name, rng)


def _prepare_file(surface: Surface, seeds: Path, rng: Random, index: int) -> Command:
    hostile, check = surface.hostile[index : index + 1], surface.check
    if hostile:
        path = Path(hostile[0]["file"])
        pattern = next(key for key in surface.commands if fnmatch(path.name, key))
        _write_hostile(path, hostile[0])
    else:
        pattern = rng.choice(list(surface.commands))
        path = rng.choice(sorted(Path().rglob(pattern)))
        if rng.random() < 0.03:
            path = _replace_path(path, rng)
            check = ""
        elif not _mutate(path, rng) and check == "state":
            check = ""
    line = surface.commands[pattern][0] if hostile else rng.choice(surface.commands[pattern])
    words = [word.replace("{}", str(path)) for word in shlex.split(line)]
    judge: Any = partial(CHECKS[check], path, seeds / path) if check else str
    return Command(words=words, path=path, check=judge)


def _write_hostile(path: Path, entry: dict[str, Any]) -> None:
    path.parent.mkdir(exist_ok=True)
    for beside in entry.get("beside", []):
        _write_hostile(path.parent / beside["file"], beside)
    if "link" in entry or "pipe" in entry:
        path.unlink(missing_ok=True)
        make = os.mkfifo if "pipe" in entry else partial(os.symlink, entry["link"])
        make(path)
        return
    data, find = entry.get("text", "").encode(), entry.get("find", "").encode()
    if "escape" in entry:
        from fuzzing.escapes.torchscript import ESCAPES

        target = Path.cwd().parent / "home/written"
        data = ESCAPES[entry["escape"]].archive(target, _NUM_OBS, _NUM_ACTIONS)
    elif path.suffix == ".onnx":
        import onnx

        data = onnx.parser.parse_model(entry["text"]).SerializeToString()
        data = data.replace(find, b"\xff" * len(find)) if find else data
    elif find:
        data = path.read_bytes().replace(find, data, 1)
    with path.open("wb") as target:
        target.write(data)
        target.writelines(entry["repeat"].encode() for _ in range(entry.get("times", 0)))
        target.write(entry.get("end", "").encode())


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


def _checksums(path: Path, _: Path) -> str:
    """Return whether a part of an archive has another checksum than it states."""
    try:
        with zipfile.ZipFile(path) as archive:
            member = archive.testzip()
    except Exception as error:  # for damaged files
        member = repr(error)
    return f"{path.name}, whose checksums are wrong: {member}" if member else ""


def _state(path: Path, original: Path) -> str:
    """Return whether a damaged checkpoint is read as another state than the original."""
    if path.suffix != ".pt":
        return ""
    import torch

    from terrainkit_robots.checkpoint import read_checkpoint

    contents = io.BytesIO(), io.BytesIO()
    for file, content in zip((path, original), contents, strict=True):
        torch.save(read_checkpoint(file), content)
    damaged, expected = (content.getvalue() for content in contents)
    return "" if damaged == expected else f"a damaged {path.name}, whose content differs"


CHECKS = {"checksums": _checksums, "state": _state}
"""Functions of a damaged file and its original, which return why it should have been rejected."""
