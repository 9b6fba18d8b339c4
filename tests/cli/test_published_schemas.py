"""The schemas themselves. That what the commands print fits them is tested where the commands are."""

import pytest
from jsonschema import Draft202012Validator
from published_schemas import FOLDER, published, violations

from mofit.cli.tools import TOOLS

CHECKED = {
    "schema": "mofit.check/1",
    "issues": [{"where": "file 'a.nc'", "message": "is empty", "hint": "Check the file", "severity": "error"}],
}


@pytest.mark.parametrize("name", published())
def test_a_schema_is_valid_and_listed_in_the_docs(name):
    schema = published()[name]
    Draft202012Validator.check_schema(schema)
    assert schema["properties"]["schema"] == {"const": name}
    assert schema["description"].startswith("What mofit ")
    listed = (FOLDER.parent / "programs.md").read_text(encoding="utf-8")
    assert f"`{name}`" in listed
    assert f"(schemas/{name.removeprefix('mofit.').replace('/', '-')}.json)" in listed


def test_the_docs_tell_every_tool():
    listed = (FOLDER.parent / "programs.md").read_text(encoding="utf-8")
    assert all(f"`{tool}`" in listed for tool in TOOLS)


def test_an_output_that_fits_is_told_from_one_that_does_not():
    assert not violations(CHECKED)
    assert violations({"schema": "mofit.check/1"}) == ["$: 'issues' is a required property"]
    assert violations({**CHECKED, "more": 1})
    (issue,) = CHECKED["issues"]
    assert violations({**CHECKED, "issues": [{**issue, "severity": "grave"}]})
