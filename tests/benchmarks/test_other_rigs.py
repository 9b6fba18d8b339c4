"""The study of rigs of other kinds: its simulators against known answers, its strength, its scorer, and one run."""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import other_rigs
from mofit import read_campaign
from mofit.diagnosis.baseline import baseline_in_wide_ranges
from mofit.identification.settings import Settings
from mofit.models import find_model
from other_rigs_cases import noise as noises
from other_rigs_cases.campaign import make, name_of
from other_rigs_cases.cases import CASES, NOISES, RIGS, Cell, cells
from other_rigs_cases.element import Element, Reach
from other_rigs_cases.excitation import COUNT, SAMPLE, STEP, lead, planned
from other_rigs_cases.excitation import make as make_test
from other_rigs_cases.page import page
from other_rigs_cases.rig import drive_of
from other_rigs_cases.score import intervals, right, row_of
from other_rigs_cases.sensor import recorded, with_play
from other_rigs_cases.strength import Specimen, strengthened

UNIT, TIME = Reach(1.0, 1.0, 1.0, 1.0, 1.0), np.arange(COUNT) * SAMPLE
RNG = np.random.default_rng(0)


def case_number(name):
    return next(k for k, case in enumerate(CASES) if case.name == name)


def settled_sine(cycles=20, amplitude=1.0):
    return replace(make_test(RNG, "sine", "sine", amplitude, cycles), settled=True)


def response(name, values, knobs, test):
    motion = RIGS[name].respond(values, Element(knobs, UNIT), drive_of([test]), knobs)
    return recorded(motion.output, [test], knobs, UNIT, RNG)[:, 0]


@pytest.mark.parametrize("module", sorted(Path(other_rigs.CHILD.parent).glob("*.py")), ids=lambda path: path.stem)
def test_the_generator_uses_neither_models_nor_simulation(module):
    if module.name == other_rigs.CHILD.name:
        return
    for node in ast.walk(ast.parse(module.read_text())):
        if isinstance(node, ast.ImportFrom):
            assert (node.module or "").partition(".")[2] == "" or not (node.module or "").startswith("mofit.m")
            assert not (node.module or "").startswith("mofit.s")


def test_an_oscillator_follows_its_closed_form():
    values = {"m": 1.0, "k": 1.0, "d": 0.3, "offset": 0.05}
    omega = 30 / 20
    expected = np.imag(np.exp(1j * omega * TIME) / (1 - omega**2 + 0.3j * omega)) + 0.05
    assert response("oscillator", values, {}, settled_sine(30)) == pytest.approx(expected, abs=1e-4)


def test_a_joint_follows_its_closed_form():
    omega = 1.5
    joint = {"J": 1.0, "J_l": 1.5, "k": 0.6, "b": 0.3, "d": 0.1}
    gear = joint["k"] + 1j * omega * joint["d"]
    dynamic = np.array([[-(omega**2) + 0.3j * omega + gear, -gear], [-gear, -1.5 * omega**2 + gear]])
    speed = 1j * omega * np.linalg.solve(dynamic, [1, 0])[0]
    assert response("joint", joint, {}, settled_sine(30)) == pytest.approx(
        np.imag(speed * np.exp(1j * omega * TIME)), abs=1e-3
    )


def test_a_structure_follows_its_closed_form():
    omega = 1.5
    structure = {"m_1": 1.0, "k_1": 1.0, "d_1": 0.2, "m_2": 0.5, "k_2": 0.8, "d_2": 0.1}
    between = 0.8 + 0.1j * omega
    dynamic = np.array([[-(omega**2) + 1 + 0.2j * omega + between, -between], [-between, -0.5 * omega**2 + between]])
    acceleration = -(omega**2) * np.linalg.solve(dynamic, [1, 0])[0]
    assert response("structure", structure, {}, settled_sine(30)) == pytest.approx(
        np.imag(acceleration * np.exp(1j * omega * TIME)), abs=5e-3
    )


@pytest.mark.parametrize(
    ("knobs", "law"),
    [
        ({"cubic": 0.2}, lambda x, v: 0.2 * x**3),
        ({"quadratic": 0.2}, lambda x, v: 0.2 * v * abs(v)),
        ({"power": 0.2}, lambda x, v: 0.2 * v * np.sqrt(abs(v))),
        ({"bump": 0.2}, lambda x, v: 0.5 * np.maximum(x - 0.6, 0)),
        ({"film": 0.2}, lambda x, v: 0.2 * x**2 * v),
        ({"crosstalk": 0.2}, lambda x, v: 0.2 * abs(v)),
    ],
)
def test_a_damper_has_the_laws_of_its_cases(knobs, law):
    values = {"c": 1.0, "p": 0.1, "d": 0.4, "offset": 0.0}
    x, v = np.sin(TIME), np.cos(TIME)
    expected = (1 + 0.1 * abs(x)) * x + 0.4 * v + law(x, v)
    assert response("damper", values, knobs, settled_sine()) == pytest.approx(expected, abs=1e-9)


def test_branch_delay_and_filters_turn_a_sine_as_their_transfer_functions_do():
    values, test = {"c": 1.0, "p": 0.0, "d": 0.4, "offset": 0.0}, settled_sine()
    plain = 1 + 0.4j
    transfer = {
        "branch": (0.2, plain + 0.2 * 0.6j / (1 + 0.6j)),
        "delay": (0.2, plain * np.exp(-0.2j)),
        "lowpass": (0.2, plain / (1 + 0.2j)),
        "butterworth_2": (0.2, plain / (1 + np.sqrt(2) * 0.2j + (0.2j) ** 2)),
    }
    for knob, (size, gain) in transfer.items():
        expected = np.imag(gain * np.exp(1j * TIME))
        assert response("damper", values, {knob: size}, test) == pytest.approx(expected, abs=2e-3), knob


def test_friction_has_two_levels_and_a_play_its_width():
    values, test = {"c": 1e-9, "p": 0.0, "d": 0.0, "offset": 0.0}, settled_sine()
    friction = response("damper", values, {"dahl": 0.3}, test)
    assert np.abs(friction).max() == pytest.approx(0.3, rel=1e-3)
    drive = drive_of([test])
    behind, _ = with_play(drive.u, {"play": 0.25})
    late = behind[lead([test]) * 2 * round(SAMPLE / STEP) :]
    assert (late.max(), late.min()) == pytest.approx((0.75, -0.75), abs=1e-3)


@pytest.mark.parametrize("kind", NOISES)
def test_noise_has_unit_power(kind):
    rng = np.random.default_rng(1)
    power = np.mean([np.mean(noises.noise(rng, kind, COUNT) ** 2) for _ in range(60)])
    assert power == pytest.approx(1.0, rel=0.1)


def test_an_effect_is_as_strong_as_asked():
    rng = np.random.default_rng(2)
    rig = RIGS["damper"]
    specimen = Specimen(rig, rig.draw(rng), planned(rng, "sine", rolling=False, settled=False))
    found = strengthened(specimen, CASES[case_number("dry friction")], 5.0, 0)
    assert found.visible
    assert found.gap / found.noise == pytest.approx(5.0, rel=0.2)
    with_twice = specimen.gap({"dahl": 2 * found.size}, 0)
    assert with_twice == pytest.approx(2 * found.gap, rel=1e-6)


@pytest.mark.parametrize("knob", ["knee", "dead_band", "one_sided", "subharmonic", "load_lag"])
def test_a_law_does_not_depend_on_the_records_beside(knob):
    rng = np.random.default_rng(3)
    rig, tests = RIGS["damper"], planned(rng, "sine", rolling=False, settled=False)
    specimen, larger = Specimen(rig, rig.draw(rng), tests), replace(tests[0], name="larger", amplitude=3.0)
    alone, beside = (specimen.records({knob: 0.3}, some, rng) for some in (tests, [*tests, larger]))
    assert np.array_equal(alone, beside[:, :-1])
    assert np.max(np.abs(alone - specimen.records({}, tests, rng))) > 0.02 * specimen.reach.output


def test_few_descents_of_a_structure_that_rings_up_end_at_the_rig(tmp_path):
    cell, seed = Cell("structure", "sine", "AR(0.8)", case_number("none"), 0), 12503
    model = find_model(make(cell, seed, tmp_path))
    campaign = read_campaign(tmp_path / "campaigns" / f"{name_of(cell, seed)}.nc")
    fitted, _ = baseline_in_wide_ranges(model, campaign, Settings(seed=seed))
    true = RIGS["structure"].draw(np.random.default_rng([seed, *cell.numbers]))
    for second, first in (("m_2", "m_1"), ("k_2", "k_1"), ("d_2", "d_1")):
        assert fitted.values[second] / fitted.values[first] == pytest.approx(true[second] / true[first], rel=0.05)


def test_every_cell_has_its_own_numbers_and_names():
    every = cells(1, 2)
    assert len({cell.numbers for cell in every}) == len({name_of(cell, 0) for cell in every}) == len(every)
    assert len({CASES[cell.case].family for cell in every if CASES[cell.case].kind == "own law"}) >= 6


@pytest.mark.parametrize(
    ("verdict", "effects", "families", "what"),
    [
        ("effect", ["delay"], ["lag or delay"], {"first", "named", "family"}),
        ("group", ["second_branch", "delay"], ["relaxation", "lag or delay"], {"named", "family"}),
        ("effect", ["second_branch"], ["relaxation"], set()),
        ("partly", ["sensor_lowpass"], ["lag or delay"], {"family", "refused"}),
        ("partly", ["second_branch", "sensor_lowpass"], ["relaxation", "lag or delay"], {"family", "refused"}),
        ("partly", ["drift"], ["drift"], {"akin", "refused"}),
        ("unknown", [], [], {"akin", "refused", "unknown"}),
        ("none", [], [], {"quiet"}),
    ],
)
def test_what_is_right(verdict, effects, families, what):
    label = {"effect": "delay", "family": "lag or delay", "akin": "drift"}
    found = right(label, {"verdict": verdict, "effects": effects, "families": families})
    assert {key for key, value in found.items() if value} == what


def test_intervals_by_kind_of_hold_out():
    plain = {"refitted": 0.9, "low": 0.8, "high": 0.95}
    assert intervals(plain) == {"headline": [0.8, 0.95]}
    kinds = [{"kind": "test", "low": 0.9, "high": 0.99}, {"kind": "records", "low": 0.5, "high": 0.7}]
    told = intervals({"low": 0.5, "high": 0.7, "kinds": kinds})
    assert told == {"headline": [0.5, 0.7], "same": [0.9, 0.99], "other": [0.5, 0.7]}


def test_a_run_that_failed_is_a_row(tmp_path):
    cell = Cell("damper", "free", "white", case_number("delay"), 0)
    make(cell, 0, tmp_path)
    name = name_of(cell, 0)
    (tmp_path / "answers" / name).mkdir(parents=True)
    (tmp_path / "answers" / name / "errors.txt").write_text("Traceback\nValueError: no\n")
    row = row_of(tmp_path, name, 1, 2.0)
    assert (row["verdict"], row["message"]) == ("no result", "ValueError: no")
    assert not any(row["right"].values())


@pytest.mark.slow
def test_a_delay_of_a_damper_is_diagnosed_blindly_and_kept(tmp_path):
    (cell,) = other_rigs.chosen(cells(1, 1), ("damper", "sine", "white", "delay"), None, 0)
    row = other_rigs.run(cell, 0, tmp_path, 300.0, "code")
    assert row["right"]["family"]
    assert set(row["measured"]) == {"same", "group", "other"}
    (tmp_path / "campaigns" / f"{row['name']}.nc").unlink()  # what exists is not made anew
    assert other_rigs.run(cell, 0, tmp_path, 300.0, "code") == row
    text = page([row], 1, "other_rigs.py", other_rigs.__doc__)
    assert "| delay | library | lag or delay | 1 | 1 |" in text
