"""Read rasters of geodata with GDAL, through the package rasterio: the extra `geo`."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.importing.readers import asc
from terrainkit.importing.readers.georeference import Georeference
from terrainkit.importing.readers.height_source import Source, decode, require
from terrainkit.importing.readers.import_options import ReadOptions
from terrainkit.importing.readers.pixels import MAX_PIXELS, pixels_raster
from terrainkit.settings.toml_text import read_text

_DRIVERS = {".hgt": "SRTMHGT", ".dem": "USGSDEM", ".bil": "EHdr", ".img": "HFA"}
_DRIVERS |= dict.fromkeys((".dt0", ".dt1", ".dt2"), "DTED")
SUFFIXES = tuple(_DRIVERS)

_WEB_MERCATOR = 3857
_UNITS = {"ft": 0.3048, "foot": 0.3048, "feet": 0.3048, "us survey foot": 1200 / 3937}


def read(path: Path, options: ReadOptions) -> Source:
    """Return the heights of a raster of geodata: SRTM tiles, USGS DEM, DTED, ERDAS and others.

    Args:
        path: The file; the name of an SRTM tile, such as N44W072.hgt, states its position.
        options: How to read the file.

    Raises:
        HeightFileError: if rasterio is not installed, or the file cannot be read.
        ConfigError: if an option is missing.
    """
    if asc.is_grid(path):
        return asc.read(path, options)
    require(path, "rasterio", "geo")
    pixels, reference = read_gdal(path)
    return pixels_raster(path, pixels, reference, options)


def read_gdal(path: Path) -> tuple[NDArray[np.generic], Georeference]:
    """Return the pixels of a raster, shape (rows, cols, bands), and its cells.

    Pixels without data are masked.

    Args:
        path: The file: a TIFF file, or one of `SUFFIXES`.

    Raises:
        HeightFileError: if the file cannot be read.
    """
    with path.open("rb") as file:  # some programs write a TIFF file whatever the suffix
        is_tiff = file.read(2) in (b"II", b"MM")
    # One driver only: others, such as VRT, may name further files.
    driver = "GTiff" if is_tiff else _DRIVERS.get(path.suffix.lower(), "GTiff")
    header = path.with_suffix(".hdr")
    if driver == "EHdr" and header.is_file() and read_text(header).startswith("ENVI"):
        driver = "ENVI"
    found = decode(_read_gdal, path, driver)
    unit, height_unit, is_web_mercator = found["units"].tolist()
    return np.ma.masked_array(found["pixels"], found["mask"]), Georeference(
        transform=tuple(found["transform"].tolist()) or None,
        unit=unit or None,
        height_unit=height_unit,
        is_web_mercator=bool(is_web_mercator),
        num_bands=found["pixels"].shape[2],
    )


def _read_gdal(path: Path, driver: str) -> dict[str, Any]:
    import rasterio
    from rasterio.enums import ColorInterp

    warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
    with rasterio.open(path, driver=driver) as file:
        if file.width * file.height * file.count > MAX_PIXELS:
            raise ValueError(f"more than {MAX_PIXELS} pixels")
        if file.colorinterp[0] == ColorInterp.palette:
            raise ValueError("got a palette; expected a gray image")
        bands = [k for k in file.indexes if file.colorinterp[k - 1] != ColorInterp.alpha]
        pixels = np.moveaxis(file.read(bands, masked=True), 0, 2)
        if file.scales[0] != 1 or file.offsets[0] != 0:
            pixels = pixels * file.scales[0] + file.offsets[0]
        crs = file.crs
        unit = 1.0 if crs is None else 0.0 if crs.is_geographic else crs.units_factor[1]
        height_unit = _UNITS.get((file.units[0] or "").lower(), 1.0)
        return {
            "pixels": pixels.data,
            "mask": np.ma.getmaskarray(pixels),
            "transform": [] if file.transform.is_identity else list(file.transform)[:6],
            "units": [unit, height_unit, crs is not None and crs.to_epsg() == _WEB_MERCATOR],
        }
