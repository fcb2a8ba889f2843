"""The .npz file: arrays by name, written plainly, and read with suspicion.

Every array's dtype, shape and size is checked from its header, before any of it is decompressed,
and nothing is ever unpickled.
"""

import math
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import MapFileError, TerrainkitError
from terrainkit.memory import check_memory

MAX_HEADER_BYTES = 10_000
"""Most that a header may take [bytes]; those of numpy's own take a hundred."""

MAX_TEXT_BYTES = 64 << 20
"""Most that a text may take [bytes]."""


def write_arrays(path: Path, arrays: Mapping[str, Any]) -> None:
    """Write `arrays` by name to the .npz file `path`, as `numpy.savez` does.

    Not savez itself: it adds .npz to a name that ends in .NPZ, and on a full disk numpy 1 says more
    than the error.
    """
    with zipfile.ZipFile(path, "w", allowZip64=True) as file:
        for name, array in arrays.items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asanyarray(array), allow_pickle=False)


@contextmanager
def open_archive(name: str | Path) -> Iterator["Archive"]:
    """Yield the .npz file `name`.

    Raises:
        MapFileError: if the file is missing, foreign or truncated.
    """
    path = Path(name)
    try:
        # A FIFO would block, a device never end.
        if path.exists() and not path.is_file():
            raise MapFileError(f"{path} is not a file; wanted a map in .npz")
        file = zipfile.ZipFile(path)
    except FileNotFoundError:
        raise MapFileError(f"no file {path}") from None
    except OSError as error:
        raise MapFileError(f"cannot read {path}: {error.strerror or error}") from error
    except (zipfile.BadZipFile, ValueError, NotImplementedError) as error:
        raise MapFileError(f"{path} is not an .npz file, or not a whole one: {error}") from error
    with file:
        yield Archive(path, file)


class _Capped:
    """The start of a file: numpy reads a header whole, however long it says that it is."""

    def __init__(self, file: IO[bytes], most: int) -> None:
        self._file = file
        self._left = most

    def read(self, size: int) -> bytes:
        """Return the next `size` bytes, or raise ValueError if they reach too far."""
        if size > self._left:
            raise ValueError(f"its header is longer than {MAX_HEADER_BYTES} bytes")
        self._left -= size
        return self._file.read(size)


class Archive:
    """An open .npz, whose arrays are checked before they are read."""

    def __init__(self, path: Path, file: zipfile.ZipFile) -> None:
        self.path = path
        self._file = file

    def names(self) -> set[str]:
        """Return the names of the arrays."""
        return {name.removesuffix(".npy") for name in self._file.namelist()}

    def array(
        self, key: str, kind: str, shape: tuple[int | None, ...], *, limit: int | None = None
    ) -> NDArray[Any]:
        """Return the array `key`.

        Args:
            key: Its name.
            kind: What its dtype must be: numpy's letter, with the bytes of an item if they matter.
            shape: Shape that it must have; None for any length.
            limit: Most bytes that it may take.
        """
        try:
            with self._file.open(f"{key}.npy") as member:
                self._check_header(member, key, kind, shape, limit)
            with self._file.open(f"{key}.npy") as member:
                array: NDArray[Any] = np.lib.format.read_array(member, allow_pickle=False)
        except KeyError:
            raise MapFileError(f"{self.path} has no {key}") from None
        except TerrainkitError:
            raise
        # On damaged bytes, zipfile, its decompressors and numpy's parser raise whatever they meet.
        except Exception as error:
            said = " ".join(str(error).split()) or type(error).__name__
            raise MapFileError(f"{self.path}: {key} cannot be read: {said}") from error
        if kind == "U" and not _is_text(array):
            raise MapFileError(f"{self.path}: {key} contains invalid Unicode")
        return array

    def _check_header(
        self,
        member: IO[bytes],
        key: str,
        kind: str,
        shape: tuple[int | None, ...],
        limit: int | None,
    ) -> None:
        start: Any = _Capped(member, MAX_HEADER_BYTES)
        version = np.lib.format.read_magic(start)
        read = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }
        if version not in read:
            raise MapFileError(f"{self.path}: {key} has an unknown .npy version {version}")
        found, _, dtype = read[version](start)
        if (
            dtype.hasobject
            or not dtype.isnative
            or not f"{dtype.kind}{dtype.itemsize}".startswith(kind)
        ):
            wanted = {"U": "a text", "i": "whole numbers"}.get(kind) or np.dtype(kind)
            raise MapFileError(f"{self.path}: {key} has dtype {dtype}; wanted {wanted}")
        fits = len(found) == len(shape) and all(
            wanted in (n, None) for n, wanted in zip(found, shape, strict=True)
        )
        if not fits:
            raise MapFileError(f"{self.path}: {key} has shape {found}; wanted {_text(shape)}")
        needed = math.prod(found) * dtype.itemsize
        if limit is not None and needed > limit:
            raise MapFileError(f"{self.path}: {key} takes {needed} bytes; {limit} at most")
        check_memory(needed, f"{key} in {self.path}")

    def expect(self, key: str, wanted: float | tuple[float, ...]) -> None:
        """Raise MapFileError unless the numbers under `key` are those that the config says."""
        found = self.array(key, "f8", np.shape(wanted))
        if not np.allclose(found, wanted, rtol=1e-9, atol=1e-9):
            raise MapFileError(
                f"{self.path}: {key} is {found.tolist()}, but its config says {wanted}"
            )

    def text(self, key: str, *, limit: int = MAX_TEXT_BYTES) -> str:
        """Return the text under `key`, which may take `limit` bytes."""
        return str(self.array(key, "U", (), limit=limit))


def _is_text(array: NDArray[np.str_]) -> bool:
    """Return whether every character is one: within Unicode, and no half of a pair."""
    codes = np.frombuffer(array.tobytes(), dtype=np.uint32)
    return not ((codes > 0x10FFFF) | ((codes >= 0xD800) & (codes < 0xE000))).any()


def _text(shape: tuple[int | None, ...]) -> str:
    return f"({', '.join('any' if n is None else str(n) for n in shape)})"
