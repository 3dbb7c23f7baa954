"""Each change of the hard cases' expectations is in the list of the catalogue's README, with its reason."""

from __future__ import annotations

import re
import shutil
from itertools import pairwise
from pathlib import Path

import pytest
from expectations import FILES, FOLDER, digest, lacking, listed


def test_the_last_row_of_each_file_is_its_present_state() -> None:
    missing = "\n".join(lacking())
    assert not missing, (
        "Expectations of hard cases changed. Add these rows to 'List of changes' in pendulum_env/hard_cases/README.md, "
        f"each with the reason in place of the dots:\n{missing}")


def test_each_row_has_a_reason() -> None:
    rows = listed((FOLDER / "README.md").read_text(encoding="utf-8"))
    assert rows.keys() <= set(FILES)
    for name, entries in rows.items():
        assert all(len(reason) > 15 and "..." not in reason for _, reason in entries), name
        digests = [value for value, _ in entries]
        assert all(one != other for one, other in pairwise(digests)), name


def test_each_file_that_states_cases_has_a_digest() -> None:
    stating = {path.name for path in FOLDER.glob("*.py") if re.search("^CASES = ", path.read_text("utf-8"), re.M)}
    assert stating | {"case.py"} == set(FILES)


@pytest.mark.quick("COARSE = 0.5-COARSE = 0.6-True")
@pytest.mark.parametrize(("old", "new", "counts"), [
    ("always(ACCURATE)", "always(ACCURATE, STABLE)", True), ("else {ACCURATE}", "else {ACCURATE, WRONG}", True),
    ("COARSE = 0.5", "COARSE = 0.6", True),
    ('"""Hard case', '"""A hard case', False), ("\n\n\n", "\n\n\n# a comment\n", False),
])
def test_a_changed_bound_is_seen_and_changed_words_are_not(
    old: str, new: str, counts: bool, tmp_path: Path,
) -> None:
    folder = tmp_path / "hard_cases"
    shutil.copytree(FOLDER, folder)
    names = [name for name in FILES if old in (folder / name).read_text(encoding="utf-8")]
    assert names
    text = (folder / names[0]).read_text(encoding="utf-8")
    changed = text.replace(old, new, 1)
    assert (digest(changed) != digest(text)) == counts
    (folder / names[0]).write_text(changed, encoding="utf-8")
    assert {*lacking(folder)} - {*lacking()} == ({f"| {names[0]} | `{digest(changed)}` | ... |"} if counts else set())
