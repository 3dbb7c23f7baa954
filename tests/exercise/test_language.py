"""The report's languages: every table of texts is complete, and a report has the words of its language alone."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from matplotlib.text import Text
from typer.testing import CliRunner

from pendulum_env.cli import app
from pendulum_env.common.languages import tables
from pendulum_env.exercise import language, report
from pendulum_env.exercise.figures import Labels, figures_of
from pendulum_env.exercise.given import Given, by_hand
from pendulum_env.exercise.language import LANGUAGES, Language, language_of
from pendulum_env.exercise.worked import Worked, work_out
from pendulum_env.lab.measures import Measurement

ENGLISH, GERMAN = language_of("en"), language_of("de")
OTHERS = [code for code in LANGUAGES if code != "en"]
ALIKE = {
    "figures": {"step", "series"},
    "report": {"name", "friction.law", "friction.name_gamma", "friction.name_c", "friction.name_rate",
               "friction.rest_linear"},
}
"""Names of texts that are the same in both languages: symbols, numbers, and words such as Simulation and linear."""
VALUE, EQUATION = re.compile(r"\{\w*\}"), re.compile(r"\$.*?\$")
FACTS = {"Software": "x", "Sources": "s", "Python": "y", "Command": "z"}


@pytest.fixture(scope="module")
def worked(tmp_path_factory: pytest.TempPathFactory) -> Worked:
    place = tmp_path_factory.mktemp("tables")
    (place / "lengths.csv").write_text("length (cm),10 T (s)\n30,11.02\n50,14.21\n70,16.80\n90,19.05\n")
    (place / "kater.csv").write_text("position (cm),T1 (s),T2 (s)\n10,2.0480,2.0120\n20,2.0250,2.0060\n"
                                     "30,2.0080,2.0020\n40,1.9970,1.9990\n50,1.9900,1.9970\n60,1.9890,1.9990\n")
    return work_out(by_hand(Given.of(period=1.19, length=0.353), lengths=place / "lengths.csv",
                            kater=place / "kater.csv", edges="0.9938"))


def rendered(worked: Worked, code: str) -> str:
    """The page with its answers and without its figures."""
    drawn = {draw.__name__: report.Drawing(i + 1, "") for i, draw in enumerate(figures_of(worked))}
    return report.page(worked, drawn, "", True, FACTS, language=code)


def words(page: str) -> str:
    """The visible text of a page, without its equations and its footer."""
    body = page[page.index("<body>"): page.index("<footer>")]
    return " ".join(re.sub(r"<[^>]*>", " ", re.sub(r"<math.*?</math>", " ", body, flags=re.S)).split())


@pytest.mark.parametrize("code", OTHERS)
@pytest.mark.parametrize("part", ["figures", "report"])
def test_every_language_has_every_text_with_its_values_and_equations(code: str, part: str) -> None:
    ours, theirs = getattr(ENGLISH, part), getattr(language_of(code), part)
    assert list(theirs) == list(ours)
    for name, text in ours.items():
        other = theirs[name]
        assert set(VALUE.findall(EQUATION.sub("", other))) == set(VALUE.findall(EQUATION.sub("", text))), name
        assert sorted(EQUATION.findall(other)) == sorted(EQUATION.findall(text)), name
        assert other.count("$") % 2 == 0
        assert (other == text) == (name in ALIKE[part]), f"{name}: {other}"


def test_the_templates_hold_no_sentence_and_use_every_sentence() -> None:
    pages = "".join((language.TEXTS / name).read_text(encoding="utf-8") for name in ("report.html.j2", "parts.html.j2"))
    assert set(re.findall(r'say\("([\w.]+)"', pages)) == set(ENGLISH.report)
    bare = re.sub(r"\{% call parts\.eq\(\) %\}.*?\{% endcall %\}", "", pages, flags=re.S)
    for tag in re.findall(r"\{[{%].*?[}%]\}", bare, re.S):
        for string in re.findall(r'"([^"]*)"(?!\|m|:)', tag.replace(r"\"", "")):
            assert not re.search(r"[A-Za-z]{2,} [A-Za-z]{2,}", string), string
    text = re.sub(r"\{#.*?#\}|\{%.*?%\}|\{\{.*?\}\}|<[^>]*>", " ", bare, flags=re.S)
    assert set(re.findall(r"[A-Za-z]{3,}", text)) <= {"Python"}


def test_a_german_report_is_german(worked: Worked) -> None:
    page, english = rendered(worked, "de"), rendered(worked, "en")
    assert '<html lang="de"' in page
    text = words(page)
    assert not re.search(r"\b(the|of|and|with|from|is|by)\b", text)
    assert not re.search(r"\d\.\d", re.sub(r"simulated\w*\.\w+|\b[1-3]\.\d ", "", text))
    assert "T0" not in re.findall(r"[A-Za-z]{4,}", text)
    spoken = re.findall(r"\d+[.,]\d+", words(english))
    assert [number.replace(",", ".") for number in re.findall(r"\d+[.,]\d+", text)][:40] == spoken[:40]
    assert len(re.findall("<math", page)) == len(re.findall("<math", english))
    assert "9,80 ± 0,03 m/s²" in text
    assert "<mn>1,01</mn>" in page


def test_numbers_have_the_decimal_sign_of_the_language() -> None:
    assert GERMAN.shown(Measurement(1.5, 0.02, "s")) == "1,500 ± 0,020 s"
    assert GERMAN.shown("swing1.2.txt") == "swing1.2.txt"
    assert GERMAN.numeral(r"$\mathdefault{2.05}$") == r"$\mathdefault{2{,}05}$"
    said = GERMAN.say("omega.answer_several", source="<T>", times="1,2", error=0.5)
    assert said.startswith("Der Wert aus &lt;T&gt; ")
    assert "(0,5 rad/s)" in said
    with pytest.raises(KeyError):
        GERMAN.say("omega.answer_several", source="T")
    assert ENGLISH.shown(Measurement(1.5, 0.02, "s")) == "1.500 ± 0.020 s"


def shown_in(worked: Worked, draw: report.Any, texts: Language) -> list[str]:
    """The texts in a figure as it is saved."""
    drawing = texts.localised(draw(worked, texts.figures))
    drawing.draw_without_rendering()
    return [found.get_text() for found in drawing.findobj(Text) if found.get_text()]


@pytest.mark.quick("halved")
@pytest.mark.parametrize("name", ["halved", "kater"])
def test_figures_have_the_words_and_numbers_of_the_language(worked: Worked, name: str) -> None:
    draw = next(one for one in figures_of(worked) if one.__name__ == name)
    theirs, ours = shown_in(worked, draw, GERMAN), shown_in(worked, draw, ENGLISH)
    assert len(theirs) == len(ours)
    assert [text.replace("{,}", ".").replace(",", ".") for text in theirs if re.fullmatch(r"\W*\d.*", text)] == [
        text for text in ours if re.fullmatch(r"\W*\d.*", text)]
    assert any("," in text for text in theirs)
    assert not any(re.search(r"\d\.\d", text) for text in theirs)
    foreign = {text for key, text in ENGLISH.figures.items() if key not in ALIKE["figures"]}
    assert not foreign & set(theirs)


@pytest.mark.slow
def test_all_german_figures_fit(worked: Worked) -> None:
    labels: Labels = GERMAN.figures
    for draw in figures_of(worked):
        figure = GERMAN.localised(draw(worked, labels))
        figure.draw_without_rendering()
        for at in figure.axes:
            legend = at.get_legend()
            for text in (at.xaxis.label, at.yaxis.label, at.title, *(legend.get_texts() if legend else ())):
                box = text.get_window_extent()
                inside = min(box.x0, box.y0, figure.bbox.width - box.x1, figure.bbox.height - box.y1) >= 0.0
                assert inside or not text.get_text(), (draw.__name__, text.get_text())


def test_a_third_language_is_one_file(worked: Worked, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    table = tables()["en"]
    table["report"] |= {"heading": "Les méthodes d'intégration numérique : le pendule"}
    (tmp_path / "fr.json").write_text(json.dumps({**table, "decimal": ","}), encoding="utf-8")
    monkeypatch.setattr(language, "WORDS", tmp_path)
    monkeypatch.setattr(language, "LANGUAGES", (*LANGUAGES, "fr"))
    page = rendered(worked, "fr")
    assert '<html lang="fr"' in page
    assert "<h1>Les méthodes d'intégration numérique : le pendule</h1>" in page


def test_an_unknown_language_is_refused_with_the_list(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["exercise", "--language", "fr", "--out", str(tmp_path / "x")])
    assert "There is no language of the report 'fr'; there are de, en" in str(result.exception)
    assert not (tmp_path / "x").exists()
