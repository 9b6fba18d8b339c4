"""Compiled code is kept between processes, and a damaged file does no harm."""

import ctypes

import pytest

from mofit.simulation.compiler.machine import CACHE_VARIABLE, cache_folder, compile_entry, keep_code, load_code

SIGNATURE = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)
TWICE = """
define double @run(double %x) {
  %y = fadd double %x, %x
  ret double %y
}
"""


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "kept"))
    return tmp_path / "kept"


def twice(x):
    code = compile_entry("twice", lambda: TWICE, (), SIGNATURE)  # the code lives as long as this
    return code.entry(x)


def test_code_is_kept_and_used(place):
    assert twice(1.5) == 3.0
    (kept,) = place.iterdir()
    before = kept.stat().st_mtime_ns
    assert twice(2.0) == 4.0
    assert kept.stat().st_mtime_ns == before


def test_another_graph_has_a_file_of_its_own(place):
    assert twice(1.5) == 3.0
    thrice = TWICE.replace("fadd double %x, %x", "fmul double %x, 3.0")
    code = compile_entry("thrice", lambda: thrice, (), SIGNATURE)
    assert code.entry(1.5) == 4.5
    assert len(list(place.iterdir())) == 2


def test_a_kept_module_is_not_written_again(place):
    assert twice(1.5) == 3.0
    code = compile_entry("twice", lambda: pytest.fail("written again"), (), SIGNATURE)
    assert code.entry(2.0) == 4.0


@pytest.mark.parametrize("damage", [lambda b: b[: len(b) // 2], lambda b: b"", lambda b: b[:-1] + bytes([b[-1] ^ 1])])
def test_a_damaged_file_is_replaced(place, damage):
    twice(1.0)
    (kept,) = place.iterdir()
    whole = kept.read_bytes()
    kept.write_bytes(damage(whole))
    assert twice(1.5) == 3.0
    assert kept.read_bytes() == whole


def test_no_folder_no_cache(tmp_path, monkeypatch):
    monkeypatch.setenv(CACHE_VARIABLE, "")
    assert cache_folder() is None
    assert twice(1.5) == 3.0
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "file"))
    assert twice(1.5) == 3.0


def test_old_files_go(place):
    for number in range(6):
        keep_code(str(number), b"code", most_files=3)
    assert len(list(place.iterdir())) == 3
    assert load_code("5") == b"code"
