"""Images of depths and masks as arrays: PNG, TIFF, NPY and NPZ."""

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scanweld.errors import ReadError
from scanweld.geometry.arrays import BoolArray
from scanweld.io.scan_formats.numpy_array import read_arrays

IMAGE_SUFFIXES = (".png", ".tif", ".tiff")
SUFFIXES = (*IMAGE_SUFFIXES, ".npy", ".npz")
_DEPTH_MODES = ("I;16", "I;16B", "I;16L", "I;16N", "I", "F")
"""Pillow's names of one number a pixel with more than eight bits."""


def read_pixels(path: Path) -> NDArray:
    """Values (H, W) of a depth image, whole numbers or floating point, as they stand there.

    Raises:
        ReadError: If it is no image, or one that cannot hold depths.
    """
    values = _array(path) if path.suffix.lower() not in IMAGE_SUFFIXES else _image(path)
    if values.ndim == 3 and 1 in (values.shape[0], values.shape[2]):
        values = values.reshape([size for size in values.shape if size > 1] or [1])
    if values.ndim != 2 or not values.size or values.dtype.kind not in "uif":
        raise ReadError(
            f"{path}: holds {values.dtype} of shape {values.shape}, not one depth a pixel; name "
            "the depth images"
        )
    return values


def read_mask(path: Path) -> BoolArray:
    """Which pixels (H, W) of a mask are not black, or zero.

    Raises:
        ReadError: If it cannot be read.
    """
    is_image = path.suffix.lower() in IMAGE_SUFFIXES
    values = _image(path, depths=False) if is_image else _array(path)
    return np.asarray((values != 0).any(axis=-1) if values.ndim == 3 else values != 0)


def _image(path: Path, *, depths: bool = True) -> NDArray:
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of odd tags; the picture decodes or does not
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(path) as image:
                if depths and image.mode not in _DEPTH_MODES:
                    raise ReadError(
                        f"{path}: a picture ({image.mode}, 8 bits a pixel), not depths; name the "
                        "16-bit depth images"
                    )
                with_colors = image.mode in ("P", "RGBA", "LA")  # whose opacity says nothing
                return np.asarray(image.convert("RGB") if with_colors else image)
    except ReadError:
        raise
    except Exception as error:  # whatever Pillow's decoders throw at a damaged file
        raise ReadError(
            f"{path}: cannot be read as an image ({' '.join(str(error).split())[:100]}); copy it "
            "again or leave it out"
        ) from error


def _array(path: Path) -> NDArray:
    try:
        arrays = read_arrays(path, path.read_bytes())
    except OSError as error:
        raise ReadError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    if len(arrays) != 1:
        raise ReadError(
            f"{path}: is not one NumPy array of numbers; save the depths alone with numpy.save"
        )
    return next(iter(arrays.values()))
