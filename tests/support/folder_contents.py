"""What a folder holds, to see that nothing was written."""

from __future__ import annotations

from pathlib import Path


def contents(place: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in place.rglob("*") if path.is_file()}
