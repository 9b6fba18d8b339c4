"""Damaged files of every format: refused with a clear message, or a valid campaign (scripts/studies/formats.py)."""

import gzip
import os
import signal
from importlib.util import find_spec
from pathlib import Path

import h5py
import numpy as np
import pytest
import rig_files
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mofit.cli import main
from mofit.data import import_files, propose_map, read_campaign, write_campaign
from mofit.data.importers.contained import Contained, ContainedLimits
from mofit.data.importers.formats.delimited_text import file_text
from mofit.data.importers.registry import ImportLimits
from mofit.data.importers.table import read_table
from mofit.errors import InputError

#: without the extras the others are damaged all the same
FORMATS = [name for name in rig_files.WRITERS if find_spec(rig_files.PACKAGES.get(name, "numpy"))]


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """The sound file and its map, by format."""
    folder = tmp_path_factory.mktemp("sound")
    found = {}
    for format in FORMATS:
        path = rig_files.write(folder, format)
        found[format] = (path.name, path.read_bytes(), rig_files.map_of(path, format))
    # a function, because hypothesis prints what a test is given
    return lambda format: found[format]


def import_one(folder, name, content, text, reader):
    """Import; either an `InputError` with a hint and nothing written, or a campaign that reads back."""
    (folder / name).write_bytes(content)
    (folder / "map.toml").write_text(text)
    target = folder / "out.nc"
    target.unlink(missing_ok=True)
    issues = []
    try:
        campaign = import_files([folder / name], folder / "map.toml", reader)
    except InputError as error:
        issues = error.issues
    else:
        write_campaign(campaign, target)
        assert read_campaign(target).tests == campaign.tests
    assert all(issue.message and issue.hint for issue in issues)
    assert bool(issues) != target.exists()
    target.unlink(missing_ok=True)
    assert {path.name for path in folder.iterdir()} == {name, "map.toml"}


FEW = settings(deadline=None, max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])


@FEW
@given(data=st.data())
def test_damaged_files(tmp_path, sound, reader, format, data):
    name, content, text = sound(format)
    changed = bytearray(content)
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(changed) - 1) | st.integers(0, min(400, len(changed) - 1)))
        match data.draw(st.sampled_from(["flip", "cut", "fill", "double", "swap"])):
            case "flip":
                changed[at] ^= data.draw(st.integers(1, 255))
            case "cut":
                del changed[max(at, 1) :]
            case "fill":
                changed[at : at + 8] = data.draw(st.binary(min_size=8, max_size=8))
            case "double":
                changed[at:at] = changed[at : at + 300]
            case "swap":
                other = sound(data.draw(st.sampled_from(FORMATS)))[1]
                changed[:at] = other[:at]
    import_one(tmp_path, name, bytes(changed), text, reader)


@FEW
@given(content=st.binary(max_size=600))
def test_garbage(tmp_path, sound, reader, format, content):
    name, _, text = sound(format)
    import_one(tmp_path, name, content, text, reader)


@FEW
@given(
    cells=st.lists(
        st.lists(st.sampled_from(["1", "-2e308", "nan", "", "x", "1e-320", "9" * 400]), min_size=5, max_size=5),
        min_size=1,
        max_size=30,
    )
)
def test_tables_of_adversarial_cells(tmp_path, sound, reader, cells):
    name, content, text = sound("csv")
    rows = [";".join(row).encode() for row in cells]
    import_one(tmp_path, name, b"\n".join([*content.splitlines()[:2], *rows]), text, reader)


@FEW
@given(
    stamps=st.lists(
        st.sampled_from(["0", "1", "1", "2", "2.5", "1e9", "-2e308", "nan", "", "x", "1e-320", "1e99"])
        | st.floats(0, 100).map(repr),
        min_size=1,
        max_size=60,
    ),
    ordered=st.booleans(),
    rate=st.sampled_from(["1 Hz", "3.3 Hz", "1e-9 Hz", "1e9 Hz", "50 Hz"]),
    values=st.lists(st.sampled_from(["1", "2", "-1e99", "1e-320", "nan", "", "1e308"]), min_size=60, max_size=60),
)
def test_resampling_of_adversarial_stamps_and_cells(tmp_path, sound, reader, stamps, ordered, rate, values):
    name, content, text = sound("csv")
    if ordered:
        stamps = sorted(stamps, key=lambda stamp: float(stamp) if stamp not in ("", "x", "nan") else 0.0)
    rows = [";".join([stamp, value, value, "1", "2"]).encode() for stamp, value in zip(stamps, values, strict=False)]
    text = text.replace('procedure = "sine"', f'procedure = "free"\nresample = "{rate}"')
    import_one(tmp_path, name, b"\n".join([*content.splitlines()[:2], *rows]), text, reader)


@pytest.mark.parametrize(
    "unit", ["m^9^9^9^9^9", "9**9**9**9", "(((m^99)^99)^99)^99", "m" * 10_000, "N)", "1/0", "\x00"]
)
def test_units_that_take_for_ever_to_parse_are_unknown(tmp_path, sound, unit):
    name, content, text = sound("csv")
    (tmp_path / name).write_bytes(content)
    (tmp_path / "map.toml").write_text(
        text.replace('column = "slip_angle"', f'column = "slip_angle", unit = {unit!r}'.replace("\\x00", ""))
    )
    with pytest.raises(InputError, match=r"unit|TOML"):
        import_files([tmp_path / name], tmp_path / "map.toml")


def test_a_circle_of_blocks_is_ended_in_time(tmp_path, sound):
    """The address of the next data group points back at the first one."""
    pytest.importorskip("asammdf", reason="the extra 'mdf' is not installed")
    name, content, _ = sound("mf4")
    first = content.index(b"##DG")
    (tmp_path / name).write_bytes(content[: first + 24] + first.to_bytes(8, "little") + content[first + 32 :])
    with Contained(ContainedLimits(seconds=2)) as reader:
        with pytest.raises(InputError, match=r"not a readable|crashed, or took more than 2 s|claims"):
            read_table(tmp_path / name, reader)
        assert reader.process is None


def test_a_reader_that_dies_is_started_anew(tmp_path, sound):
    name, content, _ = sound("mat73")
    (tmp_path / name).write_bytes(content)
    with Contained() as reader:
        before = reader.columns(tmp_path / name)
        reader.process.send_signal(signal.SIGSEGV)
        reader.process.wait()
        with pytest.raises(InputError, match="reading it crashed"):
            reader.columns(tmp_path / name)
        after = reader.columns(tmp_path / name)
        folder = Path(reader.folder.name)
        assert folder.is_dir()
    assert not folder.exists()
    assert list(before[0]) == list(after[0])


def test_a_hanging_reader_is_ended_by_its_alarm(tmp_path):
    """A pipe in place of a file: opening it waits for ever."""
    path = tmp_path / "endless.mat"
    os.mkfifo(path)
    with Contained(ContainedLimits(seconds=1)) as reader, pytest.raises(InputError, match="took more than 1 s"):
        reader.columns(path)


def test_names_that_are_no_text_can_be_printed(tmp_path, reader):
    with h5py.File(tmp_path / "bytes.mat", "w") as file:
        for name in (b"alpha\xff [deg]", b"Fy\xfe [N]", b"t"):
            file.create_dataset(name, data=np.arange(50.0))
    assert list(read_table(tmp_path / "bytes.mat", reader).columns) == ["Fy\ufffd [N]", "alpha\ufffd [deg]", "t"]
    # a lone surrogate could not be written
    assert propose_map([tmp_path / "bytes.mat"], reader).encode("utf-8")


def test_headers_and_rows_of_absurd_length_are_refused_at_once(tmp_path):
    (tmp_path / "wide.csv").write_text(",".join(["1"] * 30_000) + "\n")
    with pytest.raises(InputError, match="has 30000 columns"):
        read_table(tmp_path / "wide.csv")
    (tmp_path / "long.csv").write_text(f"t,Fy{' ' * 100_000}[{' ' * 100_000}x\n1,2\n2,3\n")
    with pytest.raises(InputError, match="no input and output found"):
        propose_map([tmp_path / "long.csv"])


def test_a_bomb_is_refused_by_its_size(tmp_path):
    (tmp_path / "a.csv.gz").write_bytes(gzip.compress(b"1,2\n" * 1000))
    with pytest.raises(InputError, match="unpacks to more than"):
        file_text(tmp_path / "a.csv.gz", ImportLimits(unpacked=1000))


def test_the_command_leaves_nothing_behind(tmp_path, sound, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name, content, text in map(sound, ("csv", "mat73")):
        (tmp_path / name).write_bytes(content[: len(content) // 2])
        (tmp_path / "map.toml").write_text(text)
        assert main(["import", name, "--map", "map.toml"]) == 2
        assert main(["import", name, "--guess", "--out", "guess.toml"]) in (0, 2)
        _, err = capsys.readouterr()
        assert "Traceback" not in err
        for made in ("guess.toml", "guess.png"):
            (tmp_path / made).unlink(missing_ok=True)
        assert {path.name for path in tmp_path.iterdir()} == {name, "map.toml"}
        (tmp_path / name).unlink()
