from pathlib import Path

import pytest

from mofit.data.campaign_file import BUNDLED, bundled_campaign
from mofit.errors import InputError


def test_finds_the_campaign_of_a_checkout() -> None:
    path = bundled_campaign()
    assert path.is_file()
    assert path.name == BUNDLED


def test_prefers_the_first_place(tmp_path: Path) -> None:
    places = (tmp_path / "installed", tmp_path / "checkout")
    for folder in places:
        folder.mkdir()
        (folder / BUNDLED).touch()
    assert bundled_campaign(places) == places[0] / BUNDLED
    places[0].joinpath(BUNDLED).unlink()
    assert bundled_campaign(places) == places[1] / BUNDLED


def test_says_so_where_there_is_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="Name a campaign FILE"):
        bundled_campaign([tmp_path])
