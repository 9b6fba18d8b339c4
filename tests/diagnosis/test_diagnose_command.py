"""The command and its page."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from damper_rig import damper_campaign
from damper_with_offsets import damper_with_offsets
from published_schemas import violations

from mofit.cli import main
from mofit.data import read_campaign, write_campaign
from mofit.diagnosis.page_beside import reader_beside
from mofit.errors import InputError

FRICTION = (("dry_friction", (("F_d", 30.0),)),)
OWN = """
from mofit.models import Applied, Effect
from mofit.parameters import Parameter


class Stiction(Effect):
    name = "own_effect"
    title = "an effect of my own"
    on = ("damper_force",)
    needs = ("velocity",)
    parameters = (Parameter("own_size", "N s^3/m^3", -1e6, 1e6, 1e3, neutral=0.0),)

    def apply(self, s, value):
        return Applied(value + s.own_size * s.velocity**3)
"""


@pytest.fixture(scope="module")
def campaign_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("campaign") / "damper.nc"
    write_campaign(damper_campaign(FRICTION), file)
    return file


def test_command_prints_json_and_writes_a_page(campaign_file: Path, tmp_path: Path, capsys) -> None:
    own = tmp_path / "own.py"
    own.write_text(OWN)
    out = tmp_path / "diagnosis"
    arguments = ["diagnose", str(campaign_file), "--model", "kelvin_voigt_damper", "--json", "--jobs", "1"]
    for name in ("dry_friction", "delay", "cubic_stiffness", str(own)):
        arguments += ["--effects", name]
    assert main([*arguments, "--out", str(out)]) == 0
    found = json.loads(capsys.readouterr().out)
    assert not violations(found)
    assert found["verdict"] == "effect"
    assert [effect["name"] for effect in found["effects"]] == ["dry_friction"]
    assert [family["name"] for family in found["families"]] == ["friction"]
    families = {one["name"]: one["family"] for one in found["candidates"]}
    # one that states no family is one by its title
    assert families["own_effect"] == "an effect of my own"
    page = (out / "diagnosis.html").read_text()
    assert (
        page.index("Friction causes the gap (best law: dry friction (Dahl))")
        < page.index('id="where"')
        < page.index('id="which"')
    )
    assert not re.findall(r'(?:src|href)="(?!data:|#)', page)
    assert json.loads((out / "diagnosis.json").read_text())["verdict"] == "effect"
    # the folder is there now
    assert main([*arguments, "--out", str(out)]) == 2


def test_bad_input_writes_nothing(campaign_file: Path, tmp_path: Path, capsys) -> None:
    out = tmp_path / "never"
    assert main(["diagnose", str(campaign_file), "--effects", "no_such", "--out", str(out)]) == 2
    assert "no_such" in capsys.readouterr().err
    assert not out.exists()
    assert main(["diagnose", str(tmp_path / "absent.nc"), "--out", str(out)]) == 2
    assert "there is no file" in capsys.readouterr().err
    assert not out.exists()


def test_the_process_beside_reads_as_this_one(campaign_file: Path, tmp_path: Path) -> None:
    with reader_beside([campaign_file]) as (read, _):
        assert read().hash() == read_campaign(campaign_file).hash()
    with reader_beside([]) as (read, _):  # the bundled campaign is for the job to find
        assert read() == ()
    with reader_beside([tmp_path / "absent.nc"]) as (read, _), pytest.raises(InputError, match="there is no file"):
        read()


def test_a_diagnosis_begins_without_what_it_does_not_need() -> None:
    unneeded = ("xarray", "pandas", "netCDF4", "h5py", "pydantic", "emcee", "matplotlib")
    script = "import sys, mofit.cli.diagnosis_shown, mofit.workflows.jobs, mofit.diagnosis.diagnose\n"
    script += f"print([name for name in {unneeded} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.slow
def test_two_at_the_same_moment_both_end_well(campaign_file: Path, tmp_path: Path) -> None:
    """Each in a folder of its own; neither leaves anything beside it."""
    command = [sys.executable, "-m", "mofit", "diagnose", str(campaign_file), "--model", "kelvin_voigt_damper"]
    command += ["--effects", "dry_friction", "--json", "--jobs", "1"]
    started = [subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE) for _ in "ab"]
    for one in started:
        printed, errors = one.communicate(timeout=300)
        assert one.returncode == 0, errors.decode()
        assert json.loads(printed)["verdict"] == "effect"
    folders = sorted((tmp_path / "runs").iterdir())
    assert [folder.name for folder in folders] == [f"diagnosis-kelvin_voigt_damper{end}" for end in ("", "-2")]
    for folder in folders:
        assert sorted(path.name for path in folder.iterdir()) == ["diagnosis.html", "diagnosis.json"]


@pytest.mark.slow
def test_values_per_test_on_the_command_line(tmp_path: Path, capsys) -> None:
    write_campaign(damper_with_offsets(), tmp_path / "offsets.nc")
    arguments = ["diagnose", str(tmp_path / "offsets.nc"), "--model", "kelvin_voigt_damper", "--json", "--jobs", "1"]
    arguments += ["--effects", "dry_friction", "--effects", "test_offset", "--out"]
    assert main([*arguments, str(tmp_path / "without")]) == 0
    assert json.loads(capsys.readouterr().out)["verdict"] == "effect"
    more = ["--per-test", "F_0", "--include", "cubic_stiffness", "--per-test", "k_c"]
    assert main([*arguments, str(tmp_path / "with"), *more]) == 0
    assert json.loads(capsys.readouterr().out)["verdict"] == "none"
    assert "F_0 [2 Hz]" not in (tmp_path / "without" / "diagnosis.html").read_text()
