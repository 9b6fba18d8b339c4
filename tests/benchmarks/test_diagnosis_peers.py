"""The study of peers: what each says of residuals whose cause is known, the choice that all share, and the page."""

import json
from collections import Counter

import numpy as np
import pytest

import diagnosis_peers
from diagnosis_peers_cases import by_lisdd, by_resid, measured
from diagnosis_peers_cases.answer import Choice, chosen
from diagnosis_peers_cases.baseline import driven, fitted, inputs, prepared
from diagnosis_peers_cases.page import page
from diagnosis_peers_cases.peer import PEERS
from diagnosis_peers_cases.records import Records, distinct, load, rms, save
from diagnosis_peers_cases.score import holds, peer_row, proposed, right
from diagnosis_peers_cases.terms import families
from mofit import read_campaign
from mofit.models import find_model
from other_rigs_cases.campaign import make, name_of
from other_rigs_cases.cases import CASES, cells
from other_rigs_cases.excitation import COUNT
from other_rigs_cases.score import measured_shares
from other_rigs_cases.score import right as right_of_study

TIME = np.arange(400) * 0.1
SIZES = np.array([1.0, 0.7, 0.4, 0.9])


def records(cause=None, noise=0.05, seed=0):
    """Random strokes of a damper and the residual that a cause leaves in its force."""
    rng = np.random.default_rng(seed)
    lines, phases = 0.2 + 1.8 * rng.random((4, 6)), rng.uniform(0, 6, (4, 6))
    turned = lines[..., None] * TIME + phases[..., None]
    x, v = SIZES[:, None] * np.sin(turned).sum(axis=1), SIZES[:, None] * (lines[..., None] * np.cos(turned)).sum(axis=1)
    x, v = x / rms(x), v / rms(v)
    residual = noise * rng.normal(size=x.shape) + (0.0 if cause is None else cause(x, v))
    return Records(x, x + 0.5 * v, x, v, np.empty((0, 0, 0)), np.stack([x, v]), residual / rms(residual))


def test_families_are_ordered_by_what_their_terms_contribute():
    assert families({"x³": 0.5, "|v|v": 0.4, "v³": 0.4, "x": 9.0}) == ["non-linear damping", "non-linear stiffness"]
    assert families({"1": 1.0, "v": 1.0}) == []


def test_coloured_noise_is_not_white_but_independent_of_the_input():
    given = records()
    assert not by_resid.whiteness(given, given).gap
    assert not by_resid.independence(given, given).gap
    noise = np.random.default_rng(1).normal(size=given.residual.shape)
    for k in range(1, noise.shape[1]):
        noise[:, k] += 0.8 * noise[:, k - 1]
    coloured = Records(**{**vars(given), "residual": noise})
    assert by_resid.whiteness(coloured, coloured).gap
    assert not by_resid.independence(coloured, coloured).gap
    caused = Records(**{**vars(given), "residual": noise + np.roll(given.input, 3, axis=1)})
    assert by_resid.independence(caused, caused).gap


def test_the_simplest_choice_within_one_standard_error_is_taken():
    given = records(lambda x, v: x**3)
    cube = Choice(2, _cube)
    nothing = Choice(1, lambda known, new: np.zeros_like(new.deflection))
    number, told = chosen(given, [nothing, Choice(3, _cube), cube])
    assert (number, told > 0.95) == (2, True)
    assert chosen(records(), [cube]) == (None, 0.0)


def _cube(known, new):
    cubes = known.deflection.ravel() ** 3
    return cubes @ known.residual.ravel() / (cubes @ cubes) * new.deflection**3


def test_a_term_is_confirmed_where_it_acts():
    """A stiffness that grows beyond a deflection leaves the regions below alone, and the parameters from there."""

    def stop(x, v):
        return np.maximum(x - 0.8, 0.0) ** 3

    given, unseen = records(stop), records(stop, noise=0.0, seed=1)
    found = by_lisdd.discovered(given)
    flagged = found.flagged.reshape(by_lisdd.BANDS, by_lisdd.BANDS)
    assert flagged[-1].all()
    assert not flagged[:-1].any()
    said = by_lisdd.lisdd(given, unseen)
    assert said.families[0] == "non-linear stiffness"
    assert said.where.startswith("in 25% of the regions")
    # in units of the residual of the campaign
    truth = unseen.residual * rms(stop(unseen.deflection, 0.0)) / rms(stop(given.deflection, 0.0))
    assert np.mean((truth - said.correction) ** 2) < 0.2 * np.mean(truth**2)


def test_noise_has_no_discrepant_region():
    assert sum(by_lisdd.lisdd(records(seed=seed), records(seed=seed)).gap for seed in range(20)) <= 3


def test_signals_that_are_proportional_count_once():
    x = np.sin(TIME)
    assert distinct({"x": x, "s": -3 * x, "v": np.cos(TIME)}) == ["x", "v"]


def test_records_are_kept(tmp_path):
    given = records()
    save(tmp_path / "records.npz", {"campaign": given})
    again = load(tmp_path / "records.npz")["campaign"]
    assert all(np.array_equal(value, getattr(again, key)) for key, value in vars(given).items())


def answered(peer, given, unseen):
    module = pytest.importorskip(f"diagnosis_peers_cases.{PEERS[peer].module}", exc_type=ImportError)
    return getattr(module, PEERS[peer].function)(given, unseen)


@pytest.mark.parametrize("peer", ["pysindy", "sysidentpy", "gaussian_process", "lisdd"])
def test_a_peer_corrects_a_cubic_spring_and_removes_next_to_nothing_of_noise(peer):
    given = records(lambda x, v: x**3)
    unseen = records(seed=1)
    found = answered(peer, given, unseen)
    target = unseen.deflection**3
    factor = np.sum(found.correction * target) / np.sum(target**2)
    assert found.gap
    assert found.told > 0.7
    assert rms(found.correction / factor - target) < 0.5 * rms(target)
    if PEERS[peer].cause != "no":
        assert found.families[0] == "non-linear stiffness"
    quiet = answered(peer, records(), unseen)
    assert quiet.told < 0.02  # one standard error lets a little noise through


def test_sparse_regression_names_friction():
    found = answered("pysindy", records(lambda x, v: np.sign(v)), records(seed=1))
    assert found.families[0] == "friction"


def test_campaigns_are_drawn_by_kind_with_cases_in_turn():
    numbers = {"none": 3, "library": 10, "stranger": 5}
    found = diagnosis_peers.drawn(numbers, 0)
    assert found == diagnosis_peers.drawn(numbers, 0)
    assert Counter(CASES[cell.case].kind for cell in found) == numbers
    assert {cell.rig for cell in found} <= set(diagnosis_peers.RIGS)
    counts = Counter(cell.case for cell in found if CASES[cell.case].kind == "library")
    assert max(counts.values()) - min(counts.values()) <= 1
    assert len(set(found)) == len(found)


def test_what_is_handed_to_the_user_counts():
    row = {"verdict": "unknown", "families": ["drift"], "family": "", "measured": {"same": 0.5}, "share": 0.9}
    assert proposed(row) == {"same": 0.0, "group": 0.0, "other": 0.0}
    assert right(row) == {"gap": True, "first": False, "named": False, "nameless": True, "refused": True}
    assert holds(row) == []
    assert holds({**row, "verdict": "gap", "measured": {"same": 0.85, "other": 0.7}}) == [True, False]
    named = {**row, "verdict": "gap", "families": ["play", "friction"], "family": "friction"}
    assert (right(named)["first"], right(named)["named"]) == (False, True)
    assert right({**named, "verdict": "group"})["first"]


def test_a_peer_is_scored_on_noise_free_records_and_shown(tmp_path):
    clean = {test: np.sin(np.arange(COUNT) / 9) for test in ("same_1", "group_1", "other_1")}
    label = {
        "rig": "damper", "excitation": "sine", "noise": "white", "case": "none", "kind": "library",
        "family": "friction", "visible": True,
    }  # fmt: skip
    folder = tmp_path / "peers" / "name"
    folder.mkdir(parents=True)
    (tmp_path / "labels").mkdir()
    np.savez(tmp_path / "labels" / "name.npz", label=json.dumps(label), **clean)
    np.savez(folder / "simulated.npz", scale=2.0, **{test: 0.0 * one for test, one in clean.items()})
    np.save(folder / "pysindy.npy", np.stack([0.25 * one for one in clean.values()]))
    answer = {"gap": True, "terms": ["x³"], "families": ["friction"], "where": "", "told": 0.8, "corrects": True}
    row = peer_row(tmp_path, "name", "pysindy", {"answer": answer, "code": 0, "seconds": 3.0})
    assert row["measured"] == pytest.approx({"same": 0.75, "group": 0.75, "other": 0.75})
    failed = peer_row(tmp_path, "name", "whiteness", {"answer": None, "code": 1, "seconds": 3.0})
    assert failed["verdict"] == "no result"
    rows = {"mofit": row, "pysindy": row, "whiteness": failed}
    text = page([rows], rows, 1, "diagnosis_peers.py", diagnosis_peers.__doc__)
    assert "| SINDy (pysindy) | gap | friction | 80 % | 75 % | 3.0 |" in text
    assert "| SINDy (pysindy) | terms | by its terms | 0 of 0 | 1 of 1 | 1 of 1 (1) |" in text
    assert "75 % | 75 % | 75 % | 1 of 1 | 0 of 3 kinds | 3 of 3 | 3.0 (3.0) |" in text
    assert measured_shares({}, {}) == {}


@pytest.mark.slow
def test_signals_come_from_the_fitted_model(tmp_path):
    (cell,) = [
        one for one in cells(1, 1)
        if (one.rig, one.excitation, one.noise, CASES[one.case].name) == ("oscillator", "chirp", "white", "none")
    ]  # fmt: skip
    model, name = find_model(make(cell, 0, tmp_path)), name_of(cell, 0)
    campaign, held = (read_campaign(tmp_path / part / f"{name}.nc") for part in ("campaigns", "held_out"))
    simulator = fitted(model, campaign, 0)
    parts, simulated, size = prepared(simulator, campaign, held)
    with np.load(tmp_path / "labels" / f"{name}.npz") as stored:
        truth = np.stack([stored[one.name] for one in held.measurements])
    assert rms(simulated - truth) < 0.01 * rms(truth)
    assert size < 0.1 * rms(truth)
    assert not by_resid.independence(parts["campaign"], parts["campaign"]).gap
    # a force like the input moves a linear rig as the input does, less its offset
    u = inputs(model, campaign)
    offset = simulator.space.from_unit(simulator.point)[simulator.space.index("x_0")]
    expected = simulator.output(campaign) - offset
    assert driven(simulator, campaign, u[None] / 2.0, 2.0)[0] == pytest.approx(expected, abs=1e-3 * rms(expected))
    # a constant force settles at the same output in all records
    assert rms(parts["held_out"].forced[0, :, -1]) == pytest.approx(rms(parts["campaign"].forced[0, :, -1]), rel=1e-3)
    # and the offset itself moves the output by what it changes
    low, high = (simulator.space["x_0"].lower, simulator.space["x_0"].upper)
    assert simulator.moved(campaign)[simulator.space.index("x_0")] == pytest.approx(high - low, rel=1e-6)


def test_what_is_said_of_the_measured_damper_can_be_judged():
    said = {"verdict": "effect", "effects": ["dry_friction"], "families": ["friction"]}
    found = right_of_study(measured.LABEL, said)
    assert {name for name, holds in found.items() if holds} == {"first", "named", "family"}
