"""Read and write .npz archives safely.

The dtype, shape and size of each array are checked from its header before it is decompressed.
Nothing is unpickled.
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
from terrainkit.files.memory import check_memory

MAX_TEXT_BYTES = 64 << 20
"""Largest string that is read [bytes]."""


def write_arrays(path: Path, arrays: Mapping[str, Any]) -> None:
    """Write `arrays` by name to the .npz file `path`, as `numpy.savez` does.

    `numpy.savez` itself appends .npz to a name that ends in .NPZ.
    """
    with zipfile.ZipFile(path, "w", allowZip64=True) as file:
        for name, array in arrays.items():
            # Opened by name, a member has the date 1980-01-01: equal maps have equal bytes.
            with file.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asanyarray(array), allow_pickle=False)


@contextmanager
def open_archive(path: str | Path) -> Iterator["Archive"]:
    """Open the .npz file `path`.

    Raises:
        MapFileError: if the file is missing, truncated, or not an .npz file.
    """
    path = Path(path)
    try:
        # Reading a FIFO would block, and a device may not end.
        if path.exists() and not path.is_file():
            raise MapFileError(f"{path}: got a special file or folder; expected an .npz file")
        file = zipfile.ZipFile(path)
    except FileNotFoundError:
        raise MapFileError(f"no file {path}") from None
    except OSError as error:
        raise MapFileError(f"cannot read {path}: {error.strerror or error}") from error
    except (zipfile.BadZipFile, ValueError, NotImplementedError) as error:
        raise MapFileError(f"{path}: not an .npz file, or truncated: {error}") from error
    with file:
        yield Archive(path, file)


class Archive:
    """An open .npz file whose arrays are checked before they are read."""

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
            key: Name of the array.
            kind: Required dtype as numpy's code, such as "f4", or "U" for strings of any length.
            shape: Required shape; None for any length.
            limit: Largest size [bytes].

        Raises:
            MapFileError: if the array is missing, damaged, too large, or of another dtype or shape.
            MemoryLimitError: if it does not fit in memory.
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
        # On damaged data, zipfile, its decompressors and numpy's parser raise various errors.
        except Exception as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            raise MapFileError(f"{self.path}: {key} cannot be read: {reason}") from error
        if kind == "U" and not _is_unicode(array):
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
        version = np.lib.format.read_magic(member)
        # Only longer headers than those of maps need version 2, whose headers can take gigabytes.
        if version != (1, 0):
            raise MapFileError(f"{self.path}: {key} has an unknown .npy version {version}")
        found, _, dtype = np.lib.format.read_array_header_1_0(member)
        if (
            dtype.hasobject
            or not dtype.isnative
            or not f"{dtype.kind}{dtype.itemsize}".startswith(kind)
        ):
            expected = {"U": "a string", "i": "integers"}.get(kind) or np.dtype(kind)
            raise MapFileError(f"{self.path}: {key}: got dtype {dtype}; expected {expected}")
        fits = len(found) == len(shape) and all(
            expected in (n, None) for n, expected in zip(found, shape, strict=True)
        )
        if not fits:
            raise MapFileError(
                f"{self.path}: {key}: got shape {found}; expected {_shape_text(shape)}"
            )
        needed = math.prod(found) * dtype.itemsize
        if limit is not None and needed > limit:
            raise MapFileError(f"{self.path}: {key}: got {needed} bytes; expected at most {limit}")
        check_memory(needed, f"{key} in {self.path}")

    def check_value(self, key: str, expected: float | tuple[float, ...]) -> None:
        """Check that the values of a key agree with the config.

        Args:
            key: Name of the array in the archive.
            expected: The value in the config, a number or a tuple.

        Raises:
            MapFileError: if the values differ.
        """
        found = self.array(key, "f8", np.shape(expected))
        if not np.allclose(found, expected, rtol=1e-9, atol=1e-9):
            raise MapFileError(
                f"{self.path}: {key}: got {found.tolist()}; expected {expected} by its config"
            )

    def text(self, key: str, *, limit: int = MAX_TEXT_BYTES) -> str:
        """Return the string `key` of at most `limit` bytes."""
        return str(self.array(key, "U", (), limit=limit))


def _is_unicode(array: NDArray[np.str_]) -> bool:
    """Return whether all code points are valid: in range, and not surrogates."""
    codes = np.frombuffer(array.tobytes(), dtype=np.uint32)
    return not ((codes > 0x10FFFF) | ((codes >= 0xD800) & (codes < 0xE000))).any()


def _shape_text(shape: tuple[int | None, ...]) -> str:
    return f"({', '.join('any' if n is None else str(n) for n in shape)})"
