"""The documentation builds without a warning and without the network, and says what the code does."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from docs_pictures import PICTURES
from mofit.optimize.searches.effa import EffaSettings
from mofit.sampling import SampleSettings

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
#: Pages that Sphinx does not build; it checks the links of those that it does.
LOOSE_PAGES = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("sphinx", reason="needs the packages of the development group")
    out = tmp_path_factory.mktemp("docs")
    places = ("-d", out / "cache", DOCS, out / "html")
    built = subprocess.run(
        [sys.executable, "-m", "sphinx", "-b", "html", "-W", "--keep-going", "-q", *places],
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    return out / "html"


def test_pages_fetch_nothing(site: Path) -> None:
    pages = list(site.glob("*.html"))
    assert len(pages) > 10
    for page in pages:
        fetched = re.findall(r"<(?:script|link|img)[^>]+(?:src|href)=\"(?:https?:)?//[^\"]+", page.read_text())
        assert not fetched, page.name


def test_the_help_of_every_command_is_there(site: Path) -> None:
    from mofit.cli.app import app

    text = (site / "commands.html").read_text()
    for name in app:
        if not name.startswith("-"):
            assert f"Usage: mofit {name}" in text


def test_every_public_name_is_described(site: Path) -> None:
    import mofit

    text = (site / "api.html").read_text(encoding="utf-8")
    places = {"open": "open_run"}
    names = [places.get(name, name) for name in mofit.__all__ if not name.startswith("_")]
    assert [name for name in names if not re.search(rf'id="mofit\.[\w.]+\.{name}"', text)] == []


def test_a_notebook_is_shown_with_its_outputs(site: Path) -> None:
    pages = sorted((site / "examples" / "notebooks").glob("*.html"))
    assert len(pages) == 5
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert "<table" in text
        assert ">mofit</span>" in text
        assert "base64," in text or page.stem in ("diagnose", "own_data_and_model")


def test_every_model_and_effect_is_described(site: Path) -> None:
    from mofit.models import effect_names, find_effect, find_model, model_names

    text = (site / "models.html").read_text(encoding="utf-8")
    for item in (*map(find_model, model_names()), *map(find_effect, effect_names())):
        for name in (item.name, *(parameter.name for parameter in item.parameters)):
            assert f">{name}</span>" in text, name


def test_formulas_are_drawn_by_the_browser(site: Path) -> None:
    assert (site / "models.html").read_text().count("<math") > 10


@pytest.mark.parametrize("name", LOOSE_PAGES)
def test_links_to_files_lead_somewhere(name: str) -> None:
    links = re.findall(r"\]\((?!https?:|#)([^)#]+)", (ROOT / name).read_text(encoding="utf-8"))
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_scripts_that_are_named_exist() -> None:
    pages = [*(ROOT / name for name in LOOSE_PAGES), *DOCS.glob("*.md")]
    text = "".join(page.read_text(encoding="utf-8") for page in pages)
    named = set(re.findall(r"\bscripts/[a-z_/0-9]+\.py", text))
    assert len(named) > 3
    assert [name for name in named if not (ROOT / name).is_file()] == []


def test_every_command_of_the_recipes_is_understood() -> None:
    from mofit.cli.app import app

    blocks = re.findall(r"^```sh\n(.*?)^```", (DOCS / "howto.md").read_text(encoding="utf-8"), re.S | re.M)
    commands = [line for block in blocks for line in block.splitlines()]
    assert len(commands) > 25
    for line in commands:
        app.parse_args(shlex.split(line)[1:], exit_on_error=False, print_error=False)


def test_the_glossary_is_in_alphabetical_order() -> None:
    terms = re.findall(r"^## (.+)$", (DOCS / "glossary.md").read_text(encoding="utf-8"), re.M)
    assert len(terms) > 40
    assert terms == sorted(terms, key=str.casefold)


def test_modules_that_are_named_exist() -> None:
    text = "".join((DOCS / f"{page}.md").read_text(encoding="utf-8") for page in ("glossary", "method", "diagnosis"))
    named = [name for name in re.findall(r"`([a-z_/0-9]+\.py)`", text) if not name.startswith("scripts/")]
    assert len(named) > 10
    assert [name for name in named if not (ROOT / "mofit" / name).is_file()] == []


def test_pictures_are_small_used_and_made_by_the_script() -> None:
    script = (ROOT / "scripts" / "architecture.py").read_text(encoding="utf-8")
    pages = "".join(page.read_text(encoding="utf-8") for page in [*DOCS.glob("*.md"), ROOT / "CONTRIBUTING.md"])
    pictures = [*(DOCS / "images").iterdir()]
    assert pictures
    for picture in pictures:
        assert picture.stat().st_size < 100_000, picture.name
        assert f"images/{picture.name}" in pages, picture.name
        assert picture.stem in PICTURES or picture.stem in script, picture.name


def test_numbers_of_the_method_are_those_of_the_code() -> None:
    text = " ".join((DOCS / "method.md").read_text(encoding="utf-8").split())
    sampling, search = SampleSettings(), EffaSettings()
    swarm, completion = search.swarm, search.completion
    for sentence in (
        f"The first {swarm.most * swarm.candidates} points",
        f"Each of {swarm.most} fireflies",
        rf"$\beta = {swarm.beta:g}$, $\gamma = {swarm.gamma:g}$",
        rf"$\alpha = {swarm.alpha:g}$, $\delta = {swarm.delta:g}$",
        r"the $\ln n$ nearest",
        f"The budget is {completion.evaluations:,} evaluations",
        f"falls below {completion.undiscovered:g}",
        f"After {completion.late:,} evaluations only the better tenth",
        f"at least {search.rough.least:,} evaluations per parameter",
        f"at most {completion.single_most} evaluations. At most {completion.front_most} more",
        f"longer than {sampling.tau_multiple:g} autocorrelation times",
        rf"$\tau$ grows by at most {100 * sampling.tau_growth:g} %",
        f"R-hat is at most {sampling.max_r_hat:g}",
        f"effective sample size is at least {sampling.min_ess:,.0f}",
        f"{100 * sampling.independence:g} % propose",
    ):
        assert sentence in text


def test_the_diagnosis_lists_every_class_of_lines() -> None:
    from mofit.diagnosis.spectral_classes import SPECTRAL_CLASSES

    text = (DOCS / "diagnosis.md").read_text(encoding="utf-8")
    table = text.split("### 2 Classes of lines")[1].split("### 3")[0]
    listed = re.findall(r"`([a-z]+)`", table.split("| class | lines |")[1].split("\n\n")[0])
    assert listed == [one.name for one in SPECTRAL_CLASSES]


def test_numbers_of_the_diagnosis_are_those_of_the_code() -> None:
    from mofit.diagnosis.settings import DiagnosisSettings

    text = " ".join((DOCS / "diagnosis.md").read_text(encoding="utf-8").split())
    rules = DiagnosisSettings()
    following = rules.next_experiment
    for sentence in (
        f"score test has p < {rules.gap_p_value:g}",
        f"({rules.most_refits} at most)",
        f"EBIC differs by less than {rules.indistinguishable:g}",
        f"the limit is {rules.indistinguishable_of_several:g},",
        f"is left (p < {rules.one_more_p_value:g})",
        f"residual tests have p < {rules.residual_p_value:g}",
        f"p < {rules.gap_p_value:g} where it leaves more than {100 * (1 - rules.partly):g} % of the gap",
        f"exceeds {100 * rules.residual_of_peak:g} % of the output's peak",
        f"at most {100 * rules.residual_share:g} % of the gap of the baseline",
        f"({100 * rules.residual_share_of_several:g} % where several effects were needed)",
        f"leaves at least {rules.dominance:g} times as much",
        f"explains at least {100 * rules.partly:g} % of the gap",
        f"from {following.shortest:g} s to {following.longest:g} s long",
        f"the power is at least {100 * following.power:g} %",
    ):
        assert sentence in text
