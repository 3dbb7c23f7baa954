"""Test the one boundary for texts from outside: what comes in, and what goes out to each target.

What a target makes of a text is read by the target's own reader: Matplotlib, an HTML parser, ``csv``, PIL, ffmpeg.
"""

from __future__ import annotations

import csv
import io
import json
import os
import warnings
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from matplotlib.cbook import is_math_text
from PIL import Image
from small_results import driven_by_hand

from integrators import RungeKutta, html
from pendulum_env import SCENES, Recording, plots, rollout
from pendulum_env.common.provenance import provenance, write_csv
from pendulum_env.common.replacing import replacing
from pendulum_env.common.results import html_of
from pendulum_env.common.texts import Table, clean, for_csv, for_markdown, in_encoding, listed
from pendulum_env.lab.driven.log import DrivenLog
from pendulum_env.physics.scene import Scene
from pendulum_env.plots.swing import readings

NAMES = {
    "91 characters": "n" * 87 + ".txt",
    "as long as a file's name may be": "m" * 251 + ".txt",
    "not UTF-8": os.fsdecode(b"m\xfcll.txt"),
    "mathematics": "a$b$c.txt",
    "no mathematics": "$\\foo{$.txt",
    "lines": "two\nlines\r\n.txt",
    "terminal": "\x1b[31mred\x07\x9b2J.txt",
    "other way": "abc\u202etxt.exe",
    "markup": "<script>alert(1)</script> & |*x*_y_`.txt",
    "formula": "=cmd|' /C calc'!A0",
    "letters the font lacks": "\u6446\u7684\u8bb0\u5f55.txt",
    "hidden": "_run.txt",
    "empty": "",
}
"""Names of recordings that have ended a fit, or might."""
EACH = pytest.mark.parametrize("name", NAMES.values(), ids=NAMES)


def swing(name: str) -> Recording:
    time = np.linspace(0.0, 6.0, 121)
    return Recording(time, 0.2 * np.cos(5.0 * time), name, (f"workbook: sheet {name} is read",))


# --- in -------------------------------------------------------------------------------------------------------------


@EACH
def test_a_text_from_outside_becomes_one_printable_line(name: str) -> None:
    for text in (swing(name).source, *swing(name).notes, clean(name, None), Scene(clean(f"fitted to {name}")).name):
        assert text.isprintable()
        text.encode()
    assert len(swing(name).source) <= 100
    assert clean("plain name.txt") == "plain name.txt"
    assert clean("x" * 60 + "run12.txt", 40).endswith("run12.txt")


def test_names_of_many_logs_fit_a_title_and_the_scene() -> None:
    one = driven_by_hand()
    found = replace(one, logs=tuple(replace(one.logs[0], source="a" * 91 + f"{i}.csv") for i in range(4)))
    assert len(found.source) <= 100
    assert found.source.endswith("and 3 more")
    assert found.scene.name.startswith("fitted to aaa")
    assert listed(["a.csv", "b.csv"]) == "a.csv, b.csv"
    assert listed(["a" * 50, "b" * 30, "c" * 30]) == f"{'a' * 50}, {'b' * 30} and 1 more"
    assert listed([]) == ""


# --- out ------------------------------------------------------------------------------------------------------------


@pytest.mark.quick("mathematics")
@pytest.mark.parametrize("kind", ["not UTF-8", "mathematics", "no mathematics", "letters the font lacks"])
def test_figures_show_a_name_as_it_is(kind: str, tmp_path: Path) -> None:
    name = NAMES[kind]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        drawn = readings(swing(name))
        place = plots.save(drawn, tmp_path / "a.png", {"Title": f"fit of {name}", **provenance(notes=[name])})
    with Image.open(place) as image:
        assert image.info["Title"] == f"fit of {clean(name)}"
    shown = "".join("\N{WHITE SQUARE}" if "\u3000" < c < "\ufff0" else c for c in clean(name))
    assert drawn.get_suptitle().replace(r"\$", "$") == shown
    assert not is_math_text(drawn.get_suptitle())


def test_legends_and_titles_show_what_a_user_named(all_interpreted: None) -> None:
    """A recording whose name begins with "_", which Matplotlib leaves out of legends, and a method and a scene of $."""
    mine = RungeKutta(name="$a$", a=((0, 0), ("1/2", 0)), b=(0, 1), order=2, source="by hand", summary="a test")
    run = rollout(SCENES["vacuum"].replace(name="$s$"), integrator=mine, angle=0.2, duration=1.0, dt=0.1)
    axes = plots.angle({"$a$": run, "b": run}, recording=swing("_run.txt"))
    axes.figure.draw_without_rendering()
    shown = [text.get_text() for text in axes.get_legend().get_texts()]
    assert not any(map(is_math_text, (*shown, axes.get_title("left"))))
    assert {r"\$a\$", " _run.txt"} <= {*shown}


class Texts(HTMLParser):
    """The texts of an HTML page, each as long as no element begins or ends, which is how MathJax reads them."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.parts: list[str] = [""]
        self.tags: set[str] = set()
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.tags.add(tag)
        self.parts.append("")

    def handle_endtag(self, tag: str) -> None:
        self.parts.append("")

    def handle_data(self, data: str) -> None:
        self.parts[-1] += data


@pytest.mark.quick("markup", "mathematics")
@pytest.mark.parametrize("name", [
    pytest.param(name, id=kind, marks=() if kind in ("not UTF-8", "mathematics", "terminal", "markup") else
                 pytest.mark.slow) for kind, name in NAMES.items()])
def test_cards_hold_no_markup_and_no_mathematics_of_a_name(name: str) -> None:
    page = html_of(swing(name)).partition("<img")[0]
    page.encode()
    read = Texts(page)
    assert read.tags <= {"div", "b", "p", "span"}
    assert swing(name).source in "".join(read.parts)
    assert all(part.count("$") < 2 and (part == "\\" or "\\" not in part) for part in read.parts)


def test_html_replaces_bytes_that_are_not_utf8() -> None:
    assert html.text(os.fsdecode(b"m\xfcll \xc3\xa9")) == "m\ufffdll \u00e9"


@EACH
def test_tables_hold_a_name_as_one_cell_that_no_spreadsheet_runs(name: str, tmp_path: Path) -> None:
    name = swing(name).source
    write_csv(tmp_path / "a.csv", ("log", "x"), [(name, -1.5)], {"notes": NAMES["lines"] + NAMES["not UTF-8"]})
    first, *lines = (tmp_path / "a.csv").read_text(encoding="utf-8").splitlines()
    assert first.startswith("# notes: two lines .txt")
    (row,) = csv.DictReader(lines)
    assert row["log"] in (name, f"'{name}")
    assert row["log"][:1] not in ("=", "@")
    assert row["x"] == "-1.5"
    table = Table(("a", "b"), ((name, "1"),))
    (_, read) = csv.reader(io.StringIO(table.csv()))
    assert read == [row["log"], "1"]
    line = table.markdown().splitlines()[-1]
    assert line.replace("\\|", "").count("|") == 3
    assert "<script" not in line.replace("\\<", "")


@pytest.mark.parametrize(("text", "cell"), [
    ("=1+1", "'=1+1"), ("@SUM(A1)", "'@SUM(A1)"), ("+cmd|' /C calc'!A0", "'+cmd|' /C calc'!A0"),
    ("-HYPERLINK (A1)", "'-HYPERLINK (A1)"), ("-1.5e-3", "-1.5e-3"), ("-", "-"), ("", ""), ("a=b", "a=b"),
    ("+(omega0 h)^2/24", "+(omega0 h)^2/24"),
])
def test_formulas_of_spreadsheets(text: str, cell: str) -> None:
    assert for_csv(text) == cell


def test_markdown_keeps_names_and_units_as_they_are() -> None:
    for text in ("gamma [1/s], boundary_layer", "control * max_torque", "1 < Re < 2e5", "x <= 0.1"):
        assert for_markdown(text) == text
    assert for_markdown("a|b *c* $d$ `e` <f> [g](h) _i_\nj") == r"a\|b \*c\* \$d\$ \`e\` \<f> [g\](h) \_i\_ j"


def test_films_carry_any_text(tmp_path: Path) -> None:
    frames = [np.full((60, 60, 3), 255, np.uint8)] * 2
    from pendulum_env.render.film import write_film

    place = write_film(tmp_path / "a.mp4", frames, 25.0, {"title": NAMES["terminal"], "notes": NAMES["not UTF-8"]})
    data = place.read_bytes()
    assert b"\x1b[31m" not in data
    assert json.dumps("m\ufffdll.txt", ensure_ascii=False).encode() in data


@pytest.mark.parametrize("stem", ["n" * 250, "\u6446" * 80, "a"])
def test_files_of_the_longest_names_are_written(stem: str, tmp_path: Path) -> None:
    """The temporary file's name, which is longer, fits the file system, too."""
    place = tmp_path / f"{stem}.txt"
    with replacing(place) as temporary:
        temporary.write_text("new")
    assert [path.name for path in tmp_path.iterdir()] == [place.name]


def test_logs_are_cleaned_as_recordings_are() -> None:
    time = np.linspace(0.0, 3.0, 61)
    action = np.sign(np.sin(3.0 * time) + 0.1)
    log = DrivenLog(time, np.sin(time), action, "action", NAMES["lines"], (NAMES["terminal"],))
    assert log.source == "two lines .txt"
    assert log.notes[0].isprintable()


# --- encodings ------------------------------------------------------------------------------------------------------

SENTENCE = "1.5 ± 0.2 °, ω² → \N{MINUS SIGN}1 · χ, “ü”, ─┼│, \N{MULTIPLICATION SIGN}, \u6446"


@pytest.mark.parametrize("encoding", ["gbk", "cp932", "cp1250", "cp1251", "cp437", "ascii", "latin-1", "utf-8"])
def test_what_an_encoding_lacks_is_said_in_words(encoding: str) -> None:
    text = in_encoding(SENTENCE, encoding)
    text.encode(encoding)
    for had, word in (("±", "+-"), ("°", " deg"), ("ω", "omega"), ("²", "^2"), ("→", "->"), ("χ", "chi"), ("·", "*")):
        try:
            had.encode(encoding)
            assert had in text
        except UnicodeEncodeError:
            assert word in text
    assert (text == SENTENCE) == (encoding == "utf-8")


def test_ascii_has_a_word_for_everything() -> None:
    assert in_encoding(SENTENCE, "ascii") == '1.5 +- 0.2  deg, omega^2 -> -1 * chi, "u", -+|, x, ?'
    assert in_encoding("Ω λ", None) == in_encoding("Ω λ", "no such encoding") == "Omega lambda"
