"""FLIR's radiometric files of made-up cameras: block FFF, and JPEG around it.

`python -m tests.rendering.images.flir_files` writes `scenes/examples/photo.jpg`.
"""

import io
import struct
from math import exp, log, sqrt

import numpy as np
from PIL import Image

# Within 0.3 % proportional to Planck's law in 7.5-13 um, from 253 to 423 K
CURVE = {"R1": 15000.0, "B": 1421.74, "F": 2.5508, "O": -5000, "R2": 0.0125}
AIR = {"alpha1": 0.006569, "alpha2": 0.01262, "beta1": -0.002276, "beta2": -0.00667, "X": 1.9}
STATED = dict(
    zip(
        ("emissivity", "distance", "reflected", "air", "window_K", "window", "humidity"),
        (0.95, 2.0, 293.15, 293.15, 293.15, 1.0, 0.5),
    )
)
# Places in the record of a camera
AT = {"emissivity": 32, "distance": 36, "reflected": 40, "air": 44, "window_K": 48, "window": 52}
AT |= {"humidity": 60, "R1": 88, "B": 92, "F": 96, "O": 776, "R2": 780}
AT |= {"highest": 144, "lowest": 148}
AT |= {"alpha1": 112, "alpha2": 116, "beta1": 120, "beta2": 124, "X": 128}


def signal(kelvin, curve=CURVE):
    """Counts of a blackbody."""
    return curve["R1"] / (curve["R2"] * (exp(curve["B"] / kelvin) - curve["F"])) - curve["O"]


def air_transmittance(metres, humidity, kelvin, air=AIR):
    """Transmittance by Minkina and Dudzik (2009), Equation 3.29 with FLIR's coefficients."""
    c = kelvin - 273.15
    wet = sqrt(humidity * exp(1.5587 + 0.06939 * c - 0.00027816 * c * c + 6.8455e-7 * c**3))
    one = exp(-sqrt(metres) * (air["alpha1"] + air["beta1"] * wet))
    two = exp(-sqrt(metres) * (air["alpha2"] + air["beta2"] * wet))
    return air["X"] * one + (1 - air["X"]) * two


def counts_of(kelvin, stated=STATED, curve=CURVE):
    """Counts of an object of a temperature [K], as the makers' formula has them, unrounded."""
    e, window = stated["emissivity"], stated["window"]
    tau = air_transmittance(stated["distance"], stated["humidity"], stated["air"])
    arriving = e * tau * signal(kelvin, curve) + (1 - e) * tau * signal(stated["reflected"], curve)
    arriving += (1 - tau) * signal(stated["air"], curve)
    return window * arriving + (1 - window) * signal(stated["window_K"], curve)


def kelvin_of(counts, stated=STATED, curve=CURVE):
    """The inverse of `counts_of`: the makers' formula, step by step in counts."""
    e, window = stated["emissivity"], stated["window"]
    tau = air_transmittance(stated["distance"], stated["humidity"], stated["air"])
    before = (counts - (1 - window) * signal(stated["window_K"], curve)) / window
    own = before / (e * tau) - (1 - tau) / (e * tau) * signal(stated["air"], curve)
    own -= (1 - e) / e * signal(stated["reflected"], curve)
    return curve["B"] / log(curve["R1"] / (curve["R2"] * (own + curve["O"])) + curve["F"])


def raw_record(counts, kind="raw", order="<"):
    """Record of a raw image: "raw" numbers, a "png", or a "swapped" one as FLIR's."""
    counts = np.asarray(counts, np.uint16)
    if kind == "raw":
        data = counts.astype(f"{order}u2").tobytes()
    else:
        picture = Image.fromarray(counts.byteswap() if kind == "swapped" else counts)
        file = io.BytesIO()
        picture.save(file, format="PNG")
        data = file.getvalue()
    height, width = counts.shape
    return struct.pack(f"{order}3H26x", 2, width, height) + data


def camera_record(values, order="<", name=b"TEST 1"):
    """Record of a camera with `values` by their names in AT."""
    record = bytearray(2476)
    struct.pack_into(f"{order}H", record, 0, 2)
    for key, value in values.items():
        struct.pack_into(f"{order}{'i' if key == 'O' else 'f'}", record, AT[key], value)
    record[212 : 212 + len(name)] = name
    return bytes(record)


def block(records, order=">"):
    """Block FFF of pairs (type, record)."""
    start = 64 + 32 * (len(records) + 1)  # the last entry is empty
    entries, body = b"", b""
    for kind, record in records:
        entries += struct.pack(f"{order}HHIIII12x", kind, 1, 100, 0, start + len(body), len(record))
        body += record
    head = b"FFF\0" + b"TEST".ljust(16, b"\0")
    head += struct.pack(f"{order}III", 100, 64, len(records) + 1)
    return head.ljust(64, b"\0") + entries + bytes(32) + body


def fff(counts, kind="raw", header=">", order="<", **changed):
    """Block FFF of an image of counts. changed: other values of the camera."""
    values = CURVE | AIR | STATED | {"lowest": 253.15, "highest": 423.15} | changed
    camera = camera_record(values, order)
    return block([(0x21, b"other"), (1, raw_record(counts, kind, order)), (0x20, camera)], header)


def jpeg(content, piece=65_000, picture=None, shuffled=False):
    """A JPEG with the block in segments APP1."""
    file = io.BytesIO()
    (picture or Image.new("L", (8, 8))).save(file, format="JPEG")
    parts = [content[k : k + piece] for k in range(0, len(content), piece)]
    segments = [
        struct.pack(">HH", 0xFFE1, len(part) + 10)
        + b"FLIR\0\x01"
        + bytes([k, len(parts) - 1])
        + part
        for k, part in enumerate(parts)
    ]
    plain = file.getvalue()
    return plain[:2] + b"".join(segments[::-1] if shuffled else segments) + plain[2:]


def example() -> bytes:
    """The JPEG of three fuses before a wall, of 293 K at the top and 295 K at the bottom."""
    kelvin = np.linspace(293.0, 295.0, 60)[:, None] + np.zeros(80)
    for left, hot in ((14, 305.0), (34, 330.0), (54, 312.0)):
        kelvin[15:45, left : left + 12] = hot
    table = np.vectorize(counts_of)(kelvin)
    noise = 2.0 * np.random.default_rng(5).standard_normal(kelvin.shape)
    counts = np.round(table + noise)
    grey = np.clip((kelvin - 285) * 5.5, 0, 255).astype(np.uint8)
    picture = Image.fromarray(grey).resize((320, 240), Image.Resampling.NEAREST)
    return jpeg(fff(counts, "swapped"), picture=picture)


if __name__ == "__main__":
    from pathlib import Path

    Path("scenes/examples/photo.jpg").write_bytes(example())
