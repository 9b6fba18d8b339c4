import numpy as np
import pytest

from mofit.data import Campaign, Experiment, Measurement, joined, read_joined, write_campaign
from mofit.data.join import specimen_name, varying_conditions
from mofit.errors import InputError


def campaign(title: str, load: float, tests=("run",), **more) -> Campaign:
    time = np.arange(50) / 100
    measurements = tuple(
        Measurement(
            Experiment(name, "free", time, {"displacement": np.sin(time)}),
            {"force": np.cos(time)},
            {"displacement": "m", "force": "N"},
        )
        for name in tests
    )
    given = {"source": "simulated", **more}
    return Campaign(
        title, conditions={"vertical_force": load, "temperature": 300.0}, measurements=measurements, **given
    )


def test_tests_of_several_campaigns_keep_their_conditions():
    whole = joined([campaign("one", 2e3, ("run", "only")), campaign("two", 3e3)], ["a", "b"])
    assert whole.tests == ("a run", "only", "b run")
    assert [m.experiment.conditions["vertical_force"] for m in whole.measurements] == [2e3, 2e3, 3e3]
    assert [m.experiment.conditions["specimen"] for m in whole.measurements] == [1, 1, 2]
    assert (whole.conditions, whole.title) == ({"temperature": 300.0}, "one · two")
    assert specimen_name(whole, 2.0) == "b"


def test_one_campaign_is_itself():
    one = campaign("one", 2e3)
    assert joined([one], ["a"]) is one


def test_files_are_joined_by_their_names(tmp_path):
    campaigns, files = [campaign("one", 2e3), campaign("two", 3e3)], [tmp_path / "a.nc", tmp_path / "b.nc"]
    for one, file in zip(campaigns, files, strict=True):
        write_campaign(one, file)
    assert read_joined(files).hash() == joined(campaigns, ["a", "b"]).hash()
    with pytest.raises(InputError, match=r"c\.nc"):
        read_joined([*files, tmp_path / "c.nc"])


def test_what_cannot_be_joined_is_refused():
    with pytest.raises(InputError, match="measured"):
        joined([campaign("one", 2e3), campaign("two", 3e3, source="measured")], ["a", "b"])
    with pytest.raises(InputError, match="twice"):
        joined([campaign("one", 2e3), campaign("two", 3e3)], ["a", "a"])


def test_conditions_that_vary_are_found_and_others_refused():
    whole = joined([campaign("one", 3e3), campaign("two", 2e3)], ["a", "b"])
    assert varying_conditions(whole, ["vertical_force"]) == {"vertical_force": (2e3, 3e3)}
    with pytest.raises(InputError, match=r"300 in all tests[\s\S]*does not state it"):
        varying_conditions(whole, ["temperature", "current"])
