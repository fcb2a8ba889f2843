"""Damage the bytes of a file, or edit its content, at random.

A mutator takes bytes and a random generator, and returns other bytes.
"""

import io
import json
import math
import re
import zipfile
from collections.abc import Callable
from random import Random
from typing import Any

Mutator = Callable[[bytes, Random], bytes]

_SIZES = (0, 1, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**64 - 1)
_WORDS = b"0 -1 nan inf 1e308 1e-320 1e999 2147483648 -o \xc3\xa9 {} %s \xff \xed\xa0\x80".split(
    b" "
)
_WORDS += [b"", b"../../etc/passwd", b"\0", b"a\nb", b"x" * 5000]
_OPENINGS = (b"[", b"{", b"(", b'{"a":', b"<link>", b"<body>", b"${", b"a.", b"[[")
_VALUES: list[Any] = [None, True, 0, -1, 2**63, 1.5, math.nan, math.inf, 1e308, "", "\0", "../.."]
_VALUES += ["x" * 5000, [], {}, [[]], {"": 0}, [0] * 10_000, ["a"], {"name": {}}]


def flip_bit(data: bytes, rng: Random) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]


def truncate(data: bytes, rng: Random) -> bytes:
    return data[: rng.randrange(len(data))]


def splice(data: bytes, rng: Random) -> bytes:
    """Replace a part by another part; either may be empty."""
    (a, b), (c, d) = (sorted(rng.choices(range(len(data) + 1), k=2)) for _ in range(2))
    return data[:a] + data[c : min(d, c + 10_000)] + data[min(b, a + 10_000) :]


def replace_size(data: bytes, rng: Random) -> bytes:
    """Replace bytes by an extreme integer, half of the times in the header."""
    width, order = rng.choice((2, 4, 8)), rng.choice(("little", "big"))
    at = rng.randrange(rng.choice((min(len(data), 100), len(data))))
    size = rng.choice(_SIZES) % 2 ** (8 * width)
    return data[:at] + size.to_bytes(width, order) + data[at + width :]


def replace_word(data: bytes, rng: Random) -> bytes:
    """Replace a number or a name, half of the times by as many bytes, as binary formats need."""
    pattern = rng.choice((rb"-?\d[\d.]*(?:e[-+]?\d+)?", rb"[A-Za-z_][\w/.]*"))
    word = rng.choice(list(re.finditer(pattern, data[:100_000])))
    other = rng.choice((*_WORDS, *(byte * len(word[0]) for byte in (b"\xff", b"\0", b"9", b"/"))))
    return data[: word.start()] + other + data[word.end() :]


def edit_lines(data: bytes, rng: Random) -> bytes:
    """Delete, repeat or move a line."""
    lines = data.splitlines(keepends=True)
    line, at = lines.pop(rng.randrange(len(lines))), rng.randrange(len(lines) + 1)
    return b"".join([*lines[:at], line * rng.choice((0, 1, 2, 1000)), *lines[at:]])


def nest(data: bytes, rng: Random) -> bytes:
    """Insert many opening brackets or tags."""
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.choice(_OPENINGS) * rng.choice((3, 1000, 100_000)) + data[at:]


def edit_json(data: bytes, rng: Random) -> bytes:
    return json.dumps(edit_tree(json.loads(data), rng, _VALUES)).encode()


def edit_onnx(data: bytes, rng: Random) -> bytes:
    import onnx
    from google.protobuf.json_format import MessageToDict, ParseDict

    table = MessageToDict(onnx.load_from_string(data))
    return ParseDict(edit_tree(table, rng, _VALUES), onnx.ModelProto()).SerializeToString()


def edit_state(data: bytes, rng: Random) -> bytes:
    """Edit the values of a checkpoint."""
    import torch

    tensors = torch.full((3,), math.nan), torch.zeros(()), torch.empty(1).expand(10**6, 10**6)
    result = io.BytesIO()
    try:
        state = torch.load(io.BytesIO(data), weights_only=True)
    except RuntimeError:
        return edit_code(data, rng)
    torch.save(edit_tree(state, rng, [*_VALUES, *tensors, torch.zeros(0, 4) * 1j]), result)
    return result.getvalue()


def edit_archive(data: bytes, rng: Random) -> bytes:
    """Edit a member of a zip file, whose checksum is right again; or its name, or its storage."""
    with zipfile.ZipFile(io.BytesIO(data)) as file:
        members = [(name, file.read(name)) for name in file.namelist()]
    at = rng.randrange(len(members))
    name, content = members[at]
    edited = rng.choice((*DAMAGE, replace_word))(content or b"\0", rng)
    odd = rng.choice(("../x", "/tmp/x", "x" * 60_000, "a\0b", name + "/", ""))
    bomb = content + bytes(1 << 28)
    changes = [[(name, edited)]] * 4 + [[(odd, content)], [(name, content)] * 2, [], [(name, bomb)]]
    members[at : at + 1] = rng.choice(changes)
    result = io.BytesIO()
    method = rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))
    with zipfile.ZipFile(result, "w", method, compresslevel=1) as file:
        for member in members:
            file.writestr(*member)
    return result.getvalue()


def edit_code(data: bytes, rng: Random) -> bytes:
    """Write the code of a TorchScript archive, half of the times of an escape, in another way."""
    from fuzzing.escapes.torchscript import ESCAPES

    if rng.random() < 0.5:
        data = rng.choice(list(ESCAPES.values())).archive("../home/written", 141, 12)
    with zipfile.ZipFile(io.BytesIO(data)) as file:
        members = {name: file.read(name) for name in file.namelist()}
    name = rng.choice([path for path in members if path.lower().endswith(".py")])
    ends = [token.end() for token in re.finditer(rb"\w+|\.", members[name])]
    for at in sorted(rng.choices(ends, k=rng.choice((1, 3, 30))), reverse=True):
        spaces = rng.choice((b" ", b"\t", b"\\\n", b"  "))
        members[name] = members[name][:at] + spaces + members[name][at:]
    result = io.BytesIO()
    with zipfile.ZipFile(result, "w") as file:
        for member in members.items():
            file.writestr(*member)
    return result.getvalue()


def edit_tree(value: Any, rng: Random, values: list[Any]) -> Any:
    """Replace, delete or rename one value within dictionaries and lists."""
    if hasattr(value, "dtype") and rng.random() < 0.5:
        return rng.choice((value[:0], value[None], value.double(), value * math.nan, value + 2**40))
    if not isinstance(value, dict | list) or not value or rng.random() < 0.05:
        return rng.choice(values)
    keys = list(value) if isinstance(value, dict) else range(len(value))
    # Readers check the values at the top first.
    nested = [key for key in keys if isinstance(value[key], dict | list)]
    key = rng.choice(nested if nested and rng.random() < 0.7 else keys)
    kind = rng.random()
    if kind < 0.8:
        value[key] = edit_tree(value[key], rng, values)
    elif kind < 0.9 and isinstance(value, dict):
        value[rng.choice(("", "x", "é" * 300))] = value.pop(key)
    else:
        del value[key]
    return value


DAMAGE: tuple[Mutator, ...] = (flip_bit, truncate, splice, replace_size)
"""Mutators that do not restore the checksums of an archive."""

_TEXT = (replace_word, replace_word, edit_lines, nest)

EDITS: dict[str, tuple[Mutator, ...]] = {
    ".npz": (edit_archive,),
    ".pt": (edit_archive, *[edit_state] * 6),
    ".onnx": (edit_onnx, edit_onnx, replace_word),
    ".json": (edit_json, edit_json, edit_json, *_TEXT),
    **dict.fromkeys((".npy", ".stl", ".tif", ".png", ".glb"), (replace_word,)),
}
"""Mutators by suffix."""


def mutators(suffix: str) -> tuple[Mutator, ...]:
    """Return the mutators of a file; if its suffix is not known, the mutators of text."""
    return *DAMAGE, *EDITS.get(suffix, _TEXT) * 2
