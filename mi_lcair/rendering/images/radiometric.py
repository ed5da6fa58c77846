"""Radiometric files of thermographic cameras: temperatures, calibration, and stated conditions.

FLIR's block FFF is a header, a directory of records, and the records. It is a file of its own, or
lies in the APP1 segments of a JPEG. Sources: ExifTool's table of tags (FLIR); W. Minkina and S.
Dudzik, Infrared Thermography: Errors and Uncertainties, 2009, for the curve and the air.
"""

import io
import struct
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from mi_lcair.declared import Described, entry
from mi_lcair.errors import InputError, errors_of
from mi_lcair.extras import optional
from mi_lcair.files import read_bytes

SUFFIXES = (".jpg", ".jpeg", ".fff", ".seq", ".hcc")
JPEG, PNG = b"\xff\xd8", b"\x89PNG"  # first bytes of files
APP1, SCAN = 0xE1, 0xDA  # markers of a JPEG: a segment of data, the begin of the picture
RAW, CAMERA = 0x01, 0x20  # types of FLIR's records
LITTLE = b"\x02\x00"  # first bytes of a record whose numbers are little-endian
MOST_PIXELS = 2**26
ZERO_C = 273.15  # K


@dataclass(frozen=True)
class Calibration(Described, where="its calibration"):
    """A FLIR camera's signal of a blackbody, and the transmittance of air in its band.

    The signal of a blackbody of temperature T is r1 / (r2 (exp(b / T) - f)) - o. An `at` is the
    place of a number in the record of the camera.
    """

    r1: float = entry(is_positive=True)
    b: float = entry(is_positive=True, unit="K")
    f: float = entry(is_positive=True, upper=1000)
    o: float = entry(lower=-1e9, upper=1e9)
    r2: float = entry(is_positive=True)
    alpha1: float = entry(lower=-10, upper=10)
    alpha2: float = entry(lower=-10, upper=10)
    beta1: float = entry(lower=-10, upper=10)
    beta2: float = entry(lower=-10, upper=10)
    x: float = entry(lower=-100, upper=100)

    def radiance(self, temperature) -> np.ndarray:
        """Signal of a blackbody above that of none, proportional to its in-band radiance."""
        with np.errstate(divide="ignore", over="ignore"):
            return self.r1 / self.r2 / (np.exp(self.b / np.asarray(temperature, float)) - self.f)

    def kelvin(self, radiance) -> np.ndarray:
        """Temperature [K] of the blackbody of a `radiance`; NaN if there is none."""
        with np.errstate(invalid="ignore", divide="ignore"):
            kelvin = self.b / np.log(self.r1 / self.r2 / np.asarray(radiance, float) + self.f)
        return np.where(np.isfinite(kelvin) & (kelvin > 0), kelvin, np.nan)

    def transmittance(self, distance, humidity, air_temperature) -> np.ndarray:
        """Transmittance of a path [m] in air of a relative humidity 0..1 and a temperature [K]."""
        t = np.asarray(air_temperature, float) - ZERO_C
        vapour = humidity * np.exp(1.5587 + 0.06939 * t - 2.7816e-4 * t**2 + 6.8455e-7 * t**3)
        root, wet = np.sqrt(distance), np.sqrt(vapour)
        first, second = (
            np.exp(-root * (alpha + beta * wet))
            for alpha, beta in ((self.alpha1, self.beta1), (self.alpha2, self.beta2))
        )
        return np.clip(self.x * first + (1 - self.x) * second, 1e-6, 1.0)


# Places of numbers in FLIR's record of a camera, single precision but for `o`
PLACES = (
    {"r1": 0x58, "b": 0x5C, "f": 0x60, "o": 0x308, "r2": 0x30C}
    | {"alpha1": 0x70, "alpha2": 0x74, "beta1": 0x78, "beta2": 0x7C, "x": 0x80}
    | {"emissivity": 0x20, "distance": 0x24, "reflected": 0x28, "air_temperature": 0x2C}
    | {"window_temperature": 0x30, "window": 0x34, "humidity": 0x3C}
    | {"highest": 0x90, "lowest": 0x94}
)
MODEL = slice(0xD4, 0xF4)  # place of the camera's name


@dataclass(frozen=True, eq=False)
class RadiometricImage:
    """An image of a thermographic camera, with what its file states.

    Attributes
    ----------
    kelvin : ndarray, shape (H, W)
        Apparent temperatures of blackbodies [K], NaN for nothing.
    camera : str
        Name of the camera.
    band : str or None
        Usual band of such cameras, such as "7.5-14"; None if it is not known.
    conditions : dict of str to float
        Stated quantities of the measurement, by their names in `temperature`.
    calibration : Calibration or None
        Curve of the camera, and its air; None if the file has none.
    range_K : tuple of float
        Temperatures for which the camera was calibrated [K].
    """

    kelvin: np.ndarray
    camera: str
    band: str | None
    conditions: dict[str, float]
    calibration: Calibration | None = None
    range_K: tuple[float, float] = (0.0, np.inf)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What to say of pixels outside the camera's range."""
        low, high = self.range_K
        outside = np.sum((self.kelvin < low) | (self.kelvin > high))
        text = f"{outside} of {self.kelvin.size} pixels are outside the camera's range of "
        return (f"{text}{low:.4g} to {high:.4g} K; their errors are larger",) if outside else ()


def read(path: str | Path) -> RadiometricImage:
    """The image of a radiometric file; the first one of a sequence.

    Raises InputError for a file without radiometric data, and for one that is damaged.
    """
    if Path(path).suffix.lower() == ".hcc":
        return from_telops(path)
    content = read_bytes(path)
    with errors_of(str(path)):
        try:
            block = flir_block(content)
            if block or not content.startswith(JPEG):
                return from_flir(block)
            return from_dji(path, content)
        except (struct.error, IndexError):
            raise InputError(
                "its radiometric data are cut off; copy the camera's file anew"
            ) from None


def flir_block(content: bytes) -> bytes:
    """FLIR's block of a file: the file itself, or its segments of a JPEG; empty if it has none."""
    if not content.startswith(JPEG):
        return content
    at, parts, count = 2, {}, 0
    while content[at : at + 1] == b"\xff" and at + 4 <= len(content):
        marker, size = struct.unpack_from(">xBH", content, at)
        segment = content[at + 4 : at + 2 + size]
        if marker == 0xFF:  # a byte that fills
            at += 1
            continue
        if marker == SCAN:
            break
        if marker == APP1 and segment.startswith(b"FLIR\0"):
            parts[segment[6]], count = segment[8:], segment[7] + 1
        at += 2 + size
    if missing := set(range(count)) - parts.keys():
        raise InputError(
            f"{len(missing)} of {count} segments of its radiometric data are missing; copy the "
            "camera's file anew"
        )
    return b"".join(parts[k] for k in range(count))


def from_flir(block: bytes) -> RadiometricImage:
    """The image of FLIR's block. Raises struct.error if it is cut off."""
    if not block.startswith(b"FFF\0"):
        raise InputError("contains no radiometric data of FLIR (block FFF)")
    is_big = 100 <= struct.unpack_from(">I", block, 0x14)[0] < 200  # the version of the block
    order = ">" if is_big else "<"
    start, count = struct.unpack_from(f"{order}II", block, 0x18)
    records = {}
    for k in range(min(count, 1000)):
        kind, *_, at, size = struct.unpack_from(f"{order}HHIIII", block, start + 32 * k)
        if at + size > len(block):
            raise struct.error
        records.setdefault(kind, block[at : at + size])
    for kind, what in ((RAW, "raw image"), (CAMERA, "record of the camera")):
        if not records.get(kind):
            raise InputError(f"its radiometric data have no {what}; use the camera's own file")
    camera = records[CAMERA]
    order = "<" if camera.startswith(LITTLE) else ">"
    values = {
        name: struct.unpack_from(order + "fi"[name == "o"], camera, at)[0]
        for name, at in PLACES.items()
    }
    curve = Calibration(**{of.name: values.pop(of.name) for of in fields(Calibration)})
    name = camera[MODEL].partition(b"\0")[0].decode("latin-1").strip()
    kelvin = curve.kelvin(raw_image(records[RAW]) + curve.o)
    band = "7.5-14" if curve.b < 2200 else "3-5"  # b is c2 / wavelength
    low, high = values.pop("lowest"), values.pop("highest")
    range_K = (low, high) if low < high else RadiometricImage.range_K
    return RadiometricImage(kelvin, name, band, stated(values), curve, range_K)


def stated(values: dict[str, float]) -> dict[str, float]:
    """FLIR's conditions as those of `temperature`, without what does not count."""
    values = {name: float(f"{value:.6g}") for name, value in values.items()}  # of single precision
    values["humidity"] = min(values["humidity"] / (100 if values["humidity"] > 1 else 1), 0.98)
    without = {"window", "window_temperature"} if values["window"] in (0, 1) else set()
    without |= {"distance", "humidity", "air_temperature"} if values["distance"] == 0 else set()
    return {name: value for name, value in values.items() if name not in without}


@contextmanager
def opened(content: bytes, what: str):
    """Context manager that gives a picture, read by Pillow, which Matplotlib brings.

    what: begins the message for what cannot be read.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(io.BytesIO(content)) as picture:
            yield picture
    except UnidentifiedImageError:
        raise InputError(f"{what}: not an image") from None
    except (OSError, ValueError, SyntaxError, struct.error, Image.DecompressionBombError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{what}: {error}") from None


def raw_image(record: bytes) -> np.ndarray:
    """Counts (H, W) of FLIR's raw image, which is a PNG or 16-bit numbers."""
    order = "<" if record.startswith(LITTLE) else ">"
    width, height = struct.unpack_from(f"{order}HH", record, 2)
    data = record[32:]
    if data.startswith(JPEG):
        raise InputError("its raw image is JPEG-LS, which is not read; export a TIFF or .fff")
    if not data.startswith(PNG):
        if not 0 < width * height <= min(len(data) // 2, MOST_PIXELS):
            raise struct.error
        counts = np.frombuffer(data, f"{order}u2", width * height)
        return counts.reshape(height, width).astype(float)
    with opened(data, "its raw image cannot be read") as picture:
        counts = np.asarray(picture).astype(np.uint16)
    if counts.ndim != 2:
        raise InputError("its raw image is in colour; use the camera's own file")

    # Most cameras swap the bytes of a PNG. In the right order neighbours are alike
    def roughness(image):
        return np.abs(np.diff(image.astype(float))).sum()

    return min(counts.byteswap(), counts, key=roughness).astype(float)


# Files that other packages read
# ------------------------------


def from_dji(path: str | Path, content: bytes) -> RadiometricImage:
    """The image of DJI's R-JPEG, behind the air as its file states it.

    The temperatures are those of DJI's software for an emissivity of 1.
    """
    if b"DJI" not in content:
        raise InputError(
            "a picture without radiometric data; use the camera's own file, not an exported one"
        )
    package = optional("dji_thermal_cli", "an R-JPEG of DJI (from Python 3.12)")
    try:
        own = package.measure(path, unit="K").params
        measured = package.measure(path, package.Settings(emissivity=1.0), unit="K")
    except Exception as error:  # the package's own kinds
        raise InputError(f"cannot be read as an R-JPEG of DJI: {error}") from None
    kelvin = np.where(measured.temperature > 0, measured.temperature, np.nan).astype(float)
    conditions = {"emissivity": own["emissivity"], "reflected": own["reflection"] + ZERO_C}
    return RadiometricImage(kelvin, "DJI", "8-14", conditions)


def from_telops(path: str | Path) -> RadiometricImage:
    """The first frame of a Telops HCC file, whose calibration is in temperatures."""
    package = optional("fasthcc", "an HCC file of Telops")
    read_bytes(path)  # raises InputError for a file that is not there
    try:
        with package.HCCReader(path) as file:
            mode = file.calibration_mode
            kelvin = file.read_frames(0, 1)[0] * 2.0**file.data_exp + file.data_offset
    except (ValueError, OSError) as error:
        raise InputError(f"{path}: cannot be read as an HCC file: {error}") from None
    if mode != 2:
        raise InputError(f"{path}: is not calibrated in temperatures (RT, 2), but of mode {mode}")
    return RadiometricImage(kelvin, "Telops", None, {})
