"""The wheel and the source archive hold what they should, and the wheel alone is enough to work."""

import ast
import os
import re
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from email import message_from_string
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def build(target: str, folder: Path) -> Path:
    """Build the wheel or the source archive into a folder."""
    pytest.importorskip("hatchling", reason="hatchling builds the archives; it is in requirements.txt")
    command = [sys.executable, "-m", "hatchling", "build", "--target", target, "--directory", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    [archive] = folder.iterdir()
    return archive


def committed(*folders: str) -> list[str]:
    """Names of committed files that exist."""
    done = subprocess.run(["git", "ls-files", *folders], cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        pytest.skip("not a git checkout: which files are committed is unknown")
    return [name for name in done.stdout.splitlines() if (ROOT / name).is_file()]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel."""
    return build("wheel", tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module")
def installed(wheel: Path) -> Path:
    """A folder with the unpacked wheel, as pip would leave it in site-packages."""
    zipfile.ZipFile(wheel).extractall(wheel.parent / "site")
    return wheel.parent / "site"


def test_the_wheel_holds_every_file_of_the_package(installed: Path) -> None:
    assert [name for name in committed("mofit") if not (installed / name).is_file()] == []


def test_the_source_archive_holds_every_committed_file(tmp_path: Path) -> None:
    with tarfile.open(build("sdist", tmp_path)) as archive:
        held = {name.split("/", 1)[1] for name in archive.getnames()}
    assert [name for name in committed() if name not in held and not name.startswith(".ci/")] == []


def test_finds_its_bundled_campaign(installed: Path) -> None:
    script = "from mofit.data import bundled_campaign; print(bundled_campaign())"
    # the unpacked wheel goes before everything else, the checkout of an editable install too
    script = f"import sys; sys.path.insert(0, {str(installed)!r}); {script}"
    done = subprocess.run([sys.executable, "-P", "-c", script], cwd=installed, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert Path(done.stdout.strip()) == installed / "mofit" / "data" / "paper_campaign.nc"


def test_has_the_command(installed: Path) -> None:
    [entry_points] = installed.glob("mofit-*.dist-info/entry_points.txt")
    assert "mofit = mofit.cli:main" in entry_points.read_text()


def imported(folder: Path) -> set[str]:
    """Names of all packages that the modules of a folder import."""
    names: set[str] = set()
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                names.add(node.module.partition(".")[0])
    return names - set(sys.stdlib_module_names) - {"mofit"}


def provided(name: str) -> set[str]:
    """Names of the packages that an installed distribution brings; its own name where it is not installed."""
    try:
        record = distribution(name).read_text("RECORD") or ""
    except PackageNotFoundError:
        return {name}
    return {re.split(r"[/.,]", line, maxsplit=1)[0] for line in record.splitlines()}


def test_the_metadata_name_every_package_that_is_imported(installed: Path) -> None:
    [metadata] = installed.glob("mofit-*.dist-info/METADATA")
    required = message_from_string(metadata.read_text(encoding="utf-8")).get_all("Requires-Dist")
    named = {re.match(r"[\w.-]+", one)[0] for one in required}
    found = imported(installed / "mofit")
    assert len(found) > 20
    assert sorted(found - set().union(*map(provided, named))) == []


@pytest.mark.slow
def test_the_wheel_works_in_an_environment_of_its_own(wheel: Path, tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", tmp_path / "env"], check=True)
    python = tmp_path / "env" / "bin" / "python"
    pip = (sys.executable, "-m", "pip", "--python", python, "--disable-pip-version-check", "install", "--quiet")
    subprocess.run([*pip, "--no-deps", "--no-index", "--no-compile", wheel], check=True)
    # what mofit depends on, without a download; an editable mofit there is not reached, as its own .pth is not read
    site = Path(sysconfig.get_path("purelib", vars={"base": tmp_path / "env"}))
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    empty = tmp_path / "empty"
    empty.mkdir()
    alone = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}

    def done(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run([python, *words], cwd=empty, env=alone, capture_output=True, text=True, check=False)

    assert Path(done("-c", "import mofit; print(mofit.__file__)").stdout).is_relative_to(site)
    command = (str(python.with_name("mofit")), "identify", "--freq", "2", "--evaluations", "300", "--no-sample")
    ran = done(*command)
    assert ran.returncode == 3, ran.stderr  # not sampled
    assert "taking the bundled campaign, which is simulated" in ran.stderr
    [run] = (empty / "runs").iterdir()
    assert (run / "report.html").is_file()
