"""The examples of docs/campaigns.md work as they stand."""

import re
from pathlib import Path

import numpy as np

from mofit.data import check_campaign, import_files

TEXT = (Path(__file__).parents[2] / "docs" / "campaigns.md").read_text(encoding="utf-8")


def example(language):
    return re.search(rf"```{language}\n(.*?)```", TEXT, flags=re.DOTALL).group(1)


def test_the_python_example_writes_a_campaign(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(example("python"), {})
    issues = check_campaign("tyre.nc")
    assert {issue.severity for issue in issues} <= {"warning"}
    assert len([issue for issue in issues if "no condition" in issue.message]) == 2


def test_the_map_example_imports(tmp_path):
    t = np.arange(5000) / 1000
    table = np.column_stack([t, 10 * np.sin(2 * np.pi * t), t, np.cos(2 * np.pi * t)])
    np.savetxt(tmp_path / "run7.csv", table, delimiter=",", header="t,stroke,x,F", comments="")
    np.savetxt(tmp_path / "10mm0x5Hz.txt", table, header="t stroke x F", comments="")
    (tmp_path / "map.toml").write_text(example("toml"), encoding="utf-8")
    campaign = import_files([], tmp_path / "map.toml")
    assert campaign.tests == ("sine_1Hz", "sine_0.5Hz")
    assert campaign.measurements[1].experiment.frequency == 0.5
