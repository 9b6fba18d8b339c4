"""Compiled code is kept between processes, and a damaged file does no harm."""

import ctypes
import os

import numpy as np
import pytest
from casadi import OP_ADD, OP_CONST, OP_INPUT
from hypothesis import given
from hypothesis import strategies as st
from kernel_models import RELAXATION, sine_experiment

from mofit.simulation import Simulator
from mofit.simulation.compiler.loop import compile_loop
from mofit.simulation.compiler.machine import CACHE_VARIABLE, cache_folder, compile_entry, keep_code, load_code
from mofit.simulation.compiler.program import Node, Program

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
    code = compile_entry("twice", lambda: TWICE, SIGNATURE)  # the code lives as long as this
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
    code = compile_entry("thrice", lambda: thrice, SIGNATURE)
    assert code.entry(1.5) == 4.5
    assert len(list(place.iterdir())) == 2


def test_a_kept_module_is_not_written_again(place):
    assert twice(1.5) == 3.0
    code = compile_entry("twice", lambda: pytest.fail("written again"), SIGNATURE)
    assert code.entry(2.0) == 4.0


def test_what_an_earlier_run_needed_is_made_well(place):
    def quickly():
        code = compile_entry("twice", lambda: TWICE, SIGNATURE, quick=True)
        return code.entry(1.5)

    assert [quickly(), quickly()] == [3.0, 3.0]
    (quick,) = place.iterdir()
    os.utime(quick, (1e9, 1e9))  # an earlier run has kept it
    assert quickly() == 3.0
    assert len(list(place.iterdir())) == 2
    before = {file: file.stat().st_mtime_ns for file in place.iterdir()}
    assert [quickly(), twice(1.5)] == [3.0, 3.0]  # the one that is made well serves both
    assert {file: file.stat().st_mtime_ns for file in place.iterdir()} == before


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


def test_what_is_used_stays(place):
    for number in range(10):
        keep_code(str(number), b"code", most_files=5)
        assert load_code("0") == b"code"
    assert load_code("5") is None


def simulated():
    simulator = Simulator(RELAXATION, [sine_experiment(RELAXATION)], steps=2)
    return simulator.sensitivities([[0.3, 2.0, 0.5]])[0]


def test_a_loop_is_made_well_once_it_has_run_for_long(place):
    simulator = Simulator(RELAXATION, [sine_experiment(RELAXATION)], steps=2)
    sets = np.array([[0.3, 2.0, 0.5], [0.4, 1.0, 0.2]])
    compile_loop.cache_clear()  # of this process
    (few,) = simulator.sensitivities(sets)
    simulator.without_tables().sensitivities(np.resize(sets, (64, 3)))  # the loop for many sets, too
    made = len(list(place.iterdir()))
    (many,) = simulator.without_tables().sensitivities(np.resize(sets, (50_000, 3)))
    for quick, well in zip(few, many, strict=True):
        np.testing.assert_array_equal(well[:2], quick)
    assert len(list(place.iterdir())) == made + 1


def test_a_kept_program_gives_the_same_numbers(place):
    compile_loop.cache_clear()  # of this process
    first = simulated()
    before = {file.name: file.stat().st_mtime_ns for file in place.iterdir()}
    compile_loop.cache_clear()
    for new, old in zip(simulated(), first, strict=True):
        np.testing.assert_array_equal(new, old)
    assert {file.name: file.stat().st_mtime_ns for file in place.iterdir()} == before


@given(st.lists(st.floats(), min_size=1, max_size=4))
def test_a_program_comes_back_as_it_was(values):
    nodes = [Node(OP_CONST, value=value) for value in values]
    program = Program((*nodes, Node(OP_INPUT, value=(0, 1)), Node(OP_ADD, (0, len(nodes)))), ((len(nodes) + 1,),))
    again = Program.deserialized(program.serialized)
    assert repr(again) == repr(program)  # nan and -0.0, too
    assert again.digest == program.digest
    assert again.digest != Program(program.nodes, ((0,),)).digest
