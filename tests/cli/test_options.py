"""NAME=VALUE options."""

import pytest

from mofit.cli.app import by_name, range_by_name
from mofit.errors import InputError


def test_values_by_name():
    assert by_name("--fix", ["d_y=281", "c_M=2e4"]) == {"d_y": 281.0, "c_M": 2e4}
    assert range_by_name("--bounds", ["d_M=1e3:2e4", "p=-1:1"]) == {"d_M": (1e3, 2e4), "p": (-1.0, 1.0)}


def test_every_bad_entry_is_named():
    with pytest.raises(InputError) as caught:
        range_by_name("--bounds", ["a=1", "b=1:2", "c", "d=x:1"])
    assert [issue.where for issue in caught.value.issues] == ["--bounds a=1", "--bounds c", "--bounds d=x:1"]


def test_a_name_is_given_once():
    with pytest.raises(InputError, match=r"--fix d_y=…: the name is used twice"):
        by_name("--fix", ["d_y=281", "c_M=2e4", "d_y=300"])
