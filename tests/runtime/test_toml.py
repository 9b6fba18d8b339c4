"""A TOML file against its schema: every issue is named with its place and a hint."""

import pytest
from pydantic import Field

from mofit.errors import InputError
from mofit.runtime.toml import Strict, read_toml


class Channel(Strict):
    """A table inside a test."""

    scale: float = 1.0


class OneTest(Strict):
    """One of the tests; a channel is a number or a table."""

    name: str
    rate: float
    channels: dict[str, float | Channel] = Field(default_factory=dict)


class Whole(Strict):
    """A file."""

    title: str = ""
    tests: tuple[OneTest, ...]


GOOD = """
[defaults]
rate = 1
[[tests]]
name = "a"
[[tests]]
name = "b"
rate = 2
channels = { force = { scale = 3 } }
"""


@pytest.fixture
def read(tmp_path):
    def read(text):
        path = tmp_path / "file.toml"
        path.write_bytes(text.encode("latin-1"))
        return read_toml(path, "file", Whole, "docs/some.md", lambda defaults, test: {**defaults, **test})

    return read


def test_tests_take_the_defaults_where_they_have_no_value_of_their_own(read):
    whole = read(GOOD)
    assert [test.rate for test in whole.tests] == [1, 2]
    assert whole.tests[1].channels == {"force": Channel(scale=3)}


@pytest.mark.parametrize(
    ("old", "new", "issue"),
    [
        ("[defaults]", "titel = 3\n[defaults]", "file 'file.toml', titel: unknown key. Did you mean 'title'?"),
        ("[defaults]", "[default]", "file 'file.toml', default: unknown key. Did you mean 'defaults'?"),
        ('name = "b"', 'nam = "b"', "file 'file.toml', tests.2.nam: unknown key. Did you mean 'name'?"),
        ('name = "b"', 'nam = "b"', "tests.2.name: missing. Add it; docs/some.md lists every key."),
        ("scale", "scalee", "channels.force.Channel.scalee: unknown key. Did you mean 'scale'?"),
        ("rate = 2", 'rate = "fast"', "Correct it; docs/some.md lists every key."),
        ("[defaults]\nrate = 1", "defaults = 1", "file 'file.toml', defaults: not a table."),
        ("[[tests]]", "[tests]", "no valid TOML"),
        ("[defaults]", "title = '\xff'\n[defaults]", "no valid TOML"),
    ],
)
def test_an_issue_has_its_place_and_a_hint(read, old, new, issue):
    with pytest.raises(InputError) as caught:
        read(GOOD.replace(old, new, 1))
    assert issue in str(caught.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match=r"there is no file .*none\.toml"):
        read_toml(tmp_path / "none.toml", "file", Whole, "docs/some.md", lambda defaults, test: test)
