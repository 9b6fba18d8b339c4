import numpy as np
import pytest

from mofit.data import import_files
from mofit.data.importers.import_map import read_map
from mofit.errors import InputError

MAP = """
title = "A damper"
[attributes]
origin = "test rig"
[conditions]
temperature = "20 degC"
preload = "0.5 kN"
[defaults]
procedure = "sine"
time = { column = "t", unit = "ms" }
[defaults.channels]
displacement = { column = "s", unit = "mm" }
force = { column = 3, unit = "kN", scale = -2.0, offset = 0.5 }
[[tests]]
name = "a"
file = "a.csv"
frequency = "1 Hz"
amplitude = "10 mm"
[[tests]]
name = "b"
file = "a.csv"
rows = [101, 400]
frequency = 1.0
start_time = "2 min"
transient = 0.5
interpolation = "linear"
conditions.temperature = "30 degC"
[[tests]]
name = "c"
file = "a.csv"
sample_rate = "0.2 kHz"
"""


@pytest.fixture
def rig(tmp_path):
    t = np.arange(500) * 10.0
    rows = np.column_stack([t, 10 * np.sin(2 * np.pi * t / 1000), np.cos(2 * np.pi * t / 1000)])
    (tmp_path / "data").mkdir()
    lines = ["t;s;F", *(";".join(repr(float(v)) for v in row) for row in rows)]
    (tmp_path / "data" / "a.csv").write_text("\n".join(lines))
    (tmp_path / "map.toml").write_text(MAP)
    return tmp_path, rows


def test_columns_become_channels_in_si(rig):
    folder, rows = rig
    campaign = import_files([folder / "data"], folder / "map.toml")
    assert (campaign.title, campaign.source, campaign.tests) == ("A damper", "measured", ("a", "b", "c"))
    assert campaign.conditions == pytest.approx({"temperature": 293.15, "preload": 500.0})
    assert campaign.units["preload"] == "N"
    assert dict(campaign.attributes) == {"origin": "test rig"}
    a, b, c = campaign.measurements
    np.testing.assert_allclose(a.time, rows[:, 0] / 1000)
    np.testing.assert_allclose(a.channel("displacement"), rows[:, 1] / 1000)
    np.testing.assert_allclose(a.channel("force"), 1000 * (0.5 - 2 * rows[:, 2]))
    assert list(a.experiment.inputs) == ["displacement"]
    assert (a.experiment.frequency, a.experiment.amplitude) == (1.0, pytest.approx(0.01))
    # rows count from 1 and include the last; time starts at 0
    np.testing.assert_allclose(b.channel("displacement"), rows[100:400, 1] / 1000)
    assert b.time[0] == 0
    assert (b.experiment.start_time, b.experiment.transient, b.experiment.interpolation) == (120.0, 0.5, "linear")
    assert b.experiment.conditions["temperature"] == pytest.approx(303.15)
    assert c.experiment.step == pytest.approx(0.005)


def test_sources_may_be_files_and_default_to_the_folder_of_the_map(rig):
    folder, _ = rig
    by_folder = import_files([folder / "data"], folder / "map.toml")
    by_file = import_files([folder / "data" / "a.csv"], folder / "map.toml")
    (folder / "data" / "map.toml").write_text(MAP)
    assert by_folder.hash() == by_file.hash() == import_files([], folder / "data" / "map.toml").hash()


def test_a_pattern_makes_a_test_of_every_file_by_frequency(rig):
    folder, _ = rig
    content = (folder / "data" / "a.csv").read_text()
    for name in ("12mm2Hz.csv", "5mm0x5Hz.csv", "5mm10Hz.csv", "notes.txt"):
        (folder / "data" / name).write_text(content)
    (folder / "map.toml").write_text(
        MAP.split("[[tests]]")[0]
        + """[[tests]]
pattern = '(?P<a>\\d+)mm(?P<f>[\\dx]+)Hz\\.csv'
decimal = "x"
name = "sine_{f}Hz"
frequency = "{f} Hz"
amplitude = "{a} mm"
"""
    )
    campaign = import_files([folder / "data"], folder / "map.toml")
    assert campaign.tests == ("sine_0.5Hz", "sine_2Hz", "sine_10Hz")
    assert [m.experiment.amplitude for m in campaign.measurements] == pytest.approx([0.005, 0.012, 0.005])


BAD = {
    "unknown key": ('file = "a.csv"', 'file = "a.csv"\nprocedur = "sine"', r"tests\.1\.procedur: unknown.*'procedure'"),
    "old name of a key": ("interpolation = ", "hold = ", r"tests\.2\.hold: unknown.*called 'interpolation' now"),
    "unknown column key": ('unit = "mm"', 'units = "mm"', r"displacement\.units: unknown key. .*'unit'"),
    "unknown root key": ('title = "A damper"', 'title = "A"\ncondition = 1', r"condition: unknown key. .*'conditions'"),
    "missing title": ('title = "A damper"', "", r"map\.toml', title: missing"),
    "no TOML": ("[attributes]", "[attributes", r"no valid TOML"),
    "unknown file": ('file = "a.csv"', 'file = "b.csv"', r"test 'a': there is no file 'b\.csv'. Did you mean 'a\.csv'"),
    "two ways to a file": ('name = "a"', 'name = "a"\npattern = "x"', r"give either 'file' or 'pattern'"),
    "unknown column": ('column = "s"', 'column = "x"', r"no column 'x'"),
    "unknown scale": ("scale = -2.0", 'scale = "gain"', r"no column 'gain'"),
    "scale that varies": ("scale = -2.0", 'scale = "s"', r"channel 'force': scale 's' has 500 values"),
    "wrong unit": ('unit = "mm"', 'unit = "N"', r"channel 'displacement': unit 'N' does not fit 'm'"),
    "unknown unit": ('unit = "kN"', 'unit = "kNn"', r"channel 'force': unknown unit 'kNn'"),
    "unknown channel": ("displacement = {", "displacment = {", r"'displacment': has no role.*'displacement'"),
    "rows beyond the file": ("[101, 400]", "[101, 501]", r"test 'b': rows 101 to 501 of file 'a\.csv', which has 500"),
    "rows backwards": ("[101, 400]", "[400, 101]", r"rows \[400, 101\] are not"),
    "amplitude of another kind": ('"10 mm"', '"10 N"', r"test 'a', amplitude: '10 N': unit 'N' does not fit 'm'"),
    "amplitude without a number": ('"10 mm"', '"ten mm"', r"test 'a', amplitude: 'ten mm'"),
    "unknown procedure": ('procedure = "sine"', 'procedure = "sinus"', r"unknown procedure 'sinus'.*'sine'"),
    "condition of another kind": ('"20 degC"', '"20 m"', r"condition 'temperature': '20 m': unit 'm' does not fit 'K'"),
    "no whole period": ('frequency = "1 Hz"', 'frequency = "0.01 Hz"', r"test 'a': no whole period"),
    "name used twice": ('name = "b"', 'name = "a"', r"'a' is used twice"),
    "no test": ("[[tests]]", "[[test]]", r"unknown key. Did you mean 'tests'"),
}  # fmt: skip


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_map_names_the_place_and_a_hint(rig, kind):
    folder, _ = rig
    old, new, message = BAD[kind]
    assert old in MAP
    (folder / "map.toml").write_text(MAP.replace(old, new))
    with pytest.raises(InputError, match=message) as caught:
        import_files([folder / "data"], folder / "map.toml")
    assert all(issue.hint for issue in caught.value.issues)


def test_all_issues_of_an_import_come_together(rig):
    folder, _ = rig
    spoilt = MAP.replace('"10 mm"', '"10 N"').replace("[101, 400]", "[101, 501]").replace('"20 degC"', '"20 m"')
    (folder / "map.toml").write_text(spoilt)
    with pytest.raises(InputError) as caught:
        import_files([folder / "data"], folder / "map.toml")
    assert len({issue.where for issue in caught.value.issues}) == 3


def test_damaged_numbers_are_counted_not_invented(rig):
    folder, _ = rig
    path = folder / "data" / "a.csv"
    lines = path.read_text().splitlines()
    lines[50] = lines[50].replace(";", ";x", 1)
    path.write_text("\n".join(lines))
    with pytest.raises(InputError, match="variable 'displacement': 1 of 500 samples are NaN"):
        import_files([path], folder / "map.toml")


def test_sources_and_maps_that_are_not_there(rig):
    folder, _ = rig
    with pytest.raises(InputError, match="there is no such file or folder"):
        import_files([folder / "nowhere"], folder / "map.toml")
    with pytest.raises(InputError, match=r"map 'none\.toml': there is no file"):
        read_map(folder / "none.toml")
