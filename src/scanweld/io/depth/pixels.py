"""Images of depths, masks and colours as arrays: PNG, TIFF, JPEG, EXR, NPY and NPZ."""

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scanweld.errors import ReadError
from scanweld.geometry.arrays import BoolArray, ByteArray
from scanweld.io.scan_formats.numpy_array import read_arrays
from scanweld.io.scan_formats.records import needed

IMAGE_SUFFIXES = (".png", ".tif", ".tiff")
SUFFIXES = (*IMAGE_SUFFIXES, ".exr", ".npy", ".npz")
COLOR_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp")
_DEPTH_MODES = ("I;16", "I;16B", "I;16L", "I;16N", "I", "F")
"""Pillow's names of one number a pixel with more than eight bits."""


def read_pixels(path: Path) -> NDArray:
    """Values (H, W) of a depth image, whole numbers or floating point, as they stand there.

    Raises:
        ReadError: If it is no image, or one that cannot hold depths.
    """
    suffix = path.suffix.lower()
    read = _image if suffix in IMAGE_SUFFIXES else _channel if suffix == ".exr" else _array
    values = read(path)
    if values.ndim == 3 and 1 in (values.shape[0], values.shape[2]):
        values = values.reshape([size for size in values.shape if size > 1] or [1])
    is_deep = values.dtype.kind in "uif" and values.dtype.itemsize > 1
    if values.ndim != 2 or not values.size or not is_deep:
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


def read_colors(path: Path) -> ByteArray:
    """Red, green and blue (H, W, 3) of an image.

    Raises:
        ReadError: If it cannot be read.
    """
    values = _image(path, depths=False)
    if values.dtype == np.bool_:
        values = values.astype(np.uint8) * np.uint8(255)
    if values.ndim == 2:
        values = np.repeat(values[..., None], 3, axis=2)
    if values.dtype != np.uint8:
        raise ReadError(f"{path}: holds {values.dtype}, no colours of 8 bits; give --color none")
    return np.ascontiguousarray(values[..., :3])


def holds_depths(path: Path) -> bool:
    """Whether a file is an image of more than eight bits a pixel; only its head is read."""
    from PIL import Image

    try:
        with Image.open(path) as image:
            return image.mode in _DEPTH_MODES
    except Exception:  # whoever reads it says what is wrong
        return False


def _channel(path: Path) -> NDArray:
    """The depths of an EXR image: its only channel, or that of a usual name."""
    library = needed(path, "OpenEXR", "exr")
    try:
        with library.File(str(path), separate_channels=True) as file:
            channels = {name: np.array(each.pixels) for name, each in file.channels().items()}
    except Exception as error:  # whatever the library throws at a damaged file
        raise ReadError(
            f"{path}: cannot be read as EXR ({' '.join(str(error).split())[:100]}); copy it again "
            "or leave it out"
        ) from error
    name = next((n for n in ("Z", "Y", "V", "depth", "R") if n in channels), min(channels))
    return channels[name].astype(np.float32)


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
                if depths and (count := getattr(image, "n_frames", 1)) > 1:
                    raise ReadError(f"{path}: holds {count} images; save each in its own file")
                with_colors = image.mode in ("P", "RGBA", "LA", "CMYK", "YCbCr")  # opacity is none
                return np.asarray(image.convert("RGB") if with_colors else image)
    except ReadError:
        raise
    except Exception as error:  # whatever Pillow's decoders throw at a damaged file
        remedy = "save it as 16-bit PNG" if depths else "leave it out"
        raise ReadError(
            f"{path}: cannot be read as an image ({' '.join(str(error).split())[:100]}); copy it "
            f"again or {remedy}"
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
