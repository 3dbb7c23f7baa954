"""PNG files of frames, with texts such as their origin, written without another package."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path

from pendulum_env.common.replacing import replacing
from pendulum_env.render.paint import Image

SIGNATURE = b"\x89PNG\r\n\x1a\n"


def write_png(path: Path, picture: Image, facts: Mapping[str, str]) -> None:
    """Write a frame (H, W, 3) as a PNG file with ``facts`` as its texts; no incomplete file is left on failure.

    Texts outside Latin-1 are written as UTF-8 (chunk iTXt). The format: ISO/IEC 15948 (2004).

    Raises OSError if the file cannot be written.
    """
    height, width = picture.shape[:2]
    rows = b"".join(b"\0" + row.tobytes() for row in picture)
    with replacing(path) as temporary, temporary.open("wb") as file:
        file.write(SIGNATURE)
        file.write(_chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)))
        file.writelines(_texts(facts))
        file.write(_chunk(b"IDAT", zlib.compress(rows)))
        file.write(_chunk(b"IEND", b""))


def _texts(facts: Mapping[str, str]) -> Iterator[bytes]:
    """Yield a chunk for every text; its name is shortened to the 79 characters that the format allows."""
    for name, text in facts.items():
        key = name[:79].encode("latin-1", "replace")
        try:
            yield _chunk(b"tEXt", key + b"\0" + text.encode("latin-1"))
        except UnicodeEncodeError:
            yield _chunk(b"iTXt", key + b"\0\0\0\0\0" + text.encode())


def _chunk(kind: bytes, data: bytes) -> bytes:
    """Return a chunk of a PNG file: length, kind, data and checksum."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
