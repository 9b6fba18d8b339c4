from pathlib import Path

import pytest

from mofit import bundled
from mofit.errors import InputError


def test_finds_the_campaign_of_a_checkout() -> None:
    path = bundled.bundled_campaign()
    assert path.is_file()
    assert path.name == "paper_campaign.nc"


def test_prefers_the_file_inside_an_installed_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "site-packages" / "mofit"
    for folder in (package / "data", package.parent / "data"):
        folder.mkdir(parents=True)
        (folder / bundled.NAME).touch()
    monkeypatch.setattr(bundled, "__file__", str(package / "bundled.py"))
    assert bundled.bundled_campaign() == (package / "data" / bundled.NAME).resolve()


def test_says_so_where_there_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bundled, "__file__", str(tmp_path / "mofit" / "bundled.py"))
    with pytest.raises(InputError, match="Name a campaign FILE"):
        bundled.bundled_campaign()
