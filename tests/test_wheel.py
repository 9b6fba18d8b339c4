"""What an installed mofit consists of: a wheel is built from the checkout and used from elsewhere."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the unpacked wheel, as pip would leave it in site-packages."""
    pytest.importorskip("hatchling", reason="hatchling builds the wheel; it is in requirements.txt")
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    [wheel] = folder.glob("*.whl")
    zipfile.ZipFile(wheel).extractall(folder / "site")
    return folder / "site"


def test_carries_every_file_of_the_package(installed: Path) -> None:
    done = subprocess.run(["git", "ls-files", "mofit"], cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        pytest.skip("not a git checkout: which files belong to the package is unknown")
    assert [name for name in done.stdout.splitlines() if not (installed / name).is_file()] == []


def test_finds_its_bundled_campaign(installed: Path) -> None:
    script = "from mofit.bundled import bundled_campaign; print(bundled_campaign())"
    # the unpacked wheel goes before everything else, the checkout of an editable install too
    script = f"import sys; sys.path.insert(0, {str(installed)!r}); {script}"
    done = subprocess.run([sys.executable, "-P", "-c", script], cwd=installed, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert Path(done.stdout.strip()) == installed / "mofit" / "data" / "paper_campaign.nc"


def test_has_the_command(installed: Path) -> None:
    [entry_points] = installed.glob("mofit-*.dist-info/entry_points.txt")
    assert "mofit = mofit.cli:main" in entry_points.read_text()
