"""Version of the package, which the build tool hatchling reads from this file, and digest of its sources."""

from functools import cache
from hashlib import sha256
from pathlib import Path

__version__ = "0.1.0"


@cache
def sources() -> str:
    """Return a digest of the packages' Python files, by which two installations of a version can be told apart."""
    digest = sha256()
    root = Path(__file__).parents[2]
    for path in sorted(path for name in ("integrators", "pendulum_env") for path in (root / name).rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes().replace(b"\r\n", b"\n"))
    return digest.hexdigest()[:12]
