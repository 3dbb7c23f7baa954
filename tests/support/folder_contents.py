"""What a folder holds, to see that nothing was written."""

from __future__ import annotations

from pathlib import Path


def contents(place: Path) -> dict[str, bytes]:
    """Return the bytes of every file below a folder, and b"" for every folder, by path."""
    return {str(path): path.read_bytes() if path.is_file() else b"" for path in place.rglob("*")}
