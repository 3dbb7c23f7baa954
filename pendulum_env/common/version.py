"""Version of the package, which is git's, and digest of its sources, which tells any two versions apart."""

import os
import re
import subprocess
from datetime import datetime, timezone
from functools import cache
from hashlib import sha256
from pathlib import Path

NAME = "lab-pendulum"
"""Name of the distribution."""
UNKNOWN = "0.0"
"""Version of files that are neither installed nor under git."""


@cache
def version() -> str:
    """Return the version: in a checkout what git says now, elsewhere what the package was built as.

    An editable installation keeps the version of the day it was made, and its files go on, so git is asked there. The
    form is that of setuptools-scm, which names builds: ``0.2.0`` at the tag v0.2.0; ``0.2.1.dev3+g1a2b3c4d5`` three
    commits later, with ``.d20261129`` where files were changed after the commit (the day in UTC); without a tag
    ``0.1.dev1993+g1a2b3c4d5``, where all commits count.
    """
    return of_checkout(Path(__file__).parents[2]) or built()


@cache
def built() -> str:
    """Return the version that these files were installed as; :data:`UNKNOWN` if they were not."""
    import json
    from importlib import metadata

    try:
        found = metadata.distribution(NAME)
    except metadata.PackageNotFoundError:
        return UNKNOWN
    own, there = Path(__file__), Path(str(found.locate_file("pendulum_env/common/version.py")))
    editable = json.loads(found.read_text("direct_url.json") or "{}").get("url") == own.parents[2].as_uri()
    return found.version if editable or (there.is_file() and there.samefile(own)) else UNKNOWN


@cache
def sources() -> str:
    """Return a digest of the packages' Python files, by which two installations of a version can be told apart."""
    digest = sha256()
    root = Path(__file__).parents[2]
    for path in sorted(path for name in ("integrators", "pendulum_env") for path in (root / name).rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes().replace(b"\r\n", b"\n"))
    return digest.hexdigest()[:12]


def software() -> str:
    """Return name, version and digest, for files whose form has one line for them."""
    return f"{NAME} {version()}, sources {sources()}"


def of_checkout(root: Path) -> str:
    """Return the version of a checkout in the folder ``root``; "" if it is none of this package, or git is missing."""
    project = root / "pyproject.toml"
    if not ((root / ".git").exists() and project.is_file() and f'\nname = "{NAME}"\n' in project.read_text("utf-8")):
        return ""
    kept = {key: value for key, value in os.environ.items() if not key.startswith("GIT_")}  # of a hook that calls us

    def git(*words: str) -> str:
        command = ["git", "--no-optional-locks", "-C", str(root), *words]  # a lock could stop a commit elsewhere
        return subprocess.run(command, capture_output=True, text=True, env=kept, check=True).stdout.strip()

    try:
        said = git("describe", "--tags", "--long", "--always", "--abbrev=9", "--match", "v[0-9]*")
        found = re.fullmatch(r"(?:v(.+)-(\d+)-g)?([0-9a-f]+)", said)
        if not found:
            return ""
        tag, ahead, commit = found.groups()
        ahead = ahead or git("rev-list", "--count", "HEAD")
        dirty = git("status", "--porcelain", "--untracked-files=no")
    except (OSError, subprocess.CalledProcessError):
        return ""
    if tag and ahead == "0" and not dirty:
        return tag
    base = re.sub(r"\d+$", lambda last: str(int(last[0]) + 1), tag) if tag else "0.1"
    return f"{base}.dev{ahead}+g{commit}" + (f".d{datetime.now(timezone.utc):%Y%m%d}" if dirty else "")
