"""The wheel and the source archive hold what they should."""

import subprocess
import sys
import tarfile
import zipfile
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
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the unpacked wheel, as pip would leave it in site-packages."""
    wheel = build("wheel", tmp_path_factory.mktemp("wheel"))
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
