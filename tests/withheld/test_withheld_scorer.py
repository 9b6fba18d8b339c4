"""The scorer of the blind test: counting against labels that are opened last."""

import json
from dataclasses import replace

import numpy as np
import pytest
from blinded_labels import add_label
from hidden import Slot, case_of, setting
from respond import respond
from score import actual, main
from shares import interval, upper_bound
from tally import Pairing, confusion, figures


def said(verdict, *names, size=1.0, shrinkage=None, score=100.0, **more):
    effects = [{"name": n, "size": size, "size_low": 0.9 * size, "size_high": 1.1 * size} for n in names]
    more = {"candidate_models": [names], **more}
    tested = [{"name": n, "statistic": score} for n in ("delay", "drift", "speed", "wheel_order")]
    return {"verdict": verdict, "effects": effects, "group": [], "shrinkage": shrinkage, "seconds": 3.0,
            "candidates": tested, **more}  # fmt: skip


def hidden(case, *names, strength=100.0, beyond=0.0, size=1.0, noise="white", others=500.0, next_pair=500.0):
    causes = [
        {"name": n, "named": n, "size": size, "unit": "1", "knobs": {"x": size}, "strength_beside_others": strength,
         "strength": strength} for n in names
    ]  # fmt: skip
    separation = {**dict.fromkeys(names, 0.0), "other": others}
    return {"case": case, "cause": names[0] if len(names) == 1 else "", "noise": noise, "causes": causes,
            "strength": strength, "beyond_library": beyond, "beyond_others": others, "next_pair": next_pair,
            "separation": separation}  # fmt: skip


def pairs(*rows):
    return [Pairing(str(i), *row) for i, row in enumerate(rows)]


def test_bounds_are_those_of_clopper_and_pearson():
    assert upper_bound(0, 400) == pytest.approx(1 - 0.05 ** (1 / 400), rel=1e-9)
    assert upper_bound(3, 3) == 1.0
    low, high = interval(5, 10)
    assert (low, high) == pytest.approx((0.1871, 0.8129), abs=1e-4)
    assert interval(0, 10)[0] == 0.0


def test_false_alarms_are_all_that_is_not_none():
    rows = pairs(
        (hidden("none"), said("none")),
        (hidden("none", noise="level"), said("unknown")),
        (hidden("none", noise="level"), said("effect", "delay")),
        (hidden("none"), said("none")),
    )
    found = figures(rows)["none"]
    assert found["false_alarms"]["hits"] == 2
    assert found["by_noise"]["level"]["share"] == 1.0
    assert found["by_noise"]["white"]["share"] == 0.0


def test_naming_by_score():
    rows = pairs(
        (hidden("effect", "delay"), said("effect", "delay")),
        (hidden("effect", "delay"), said("group", "delay", "speed", group=["delay", "speed"])),
        (hidden("effect", "delay"), said("effect", "speed")),
        (hidden("effect", "delay", strength=20.0), said("several", "drift", "delay")),
        (hidden("effect", "delay"), said("none", score=20.0)),
        (hidden("effect", "delay"), said("effect", "delay", score=20.0)),
        (hidden("effect", "delay", strength=5.0), said("none", score=5.0)),
        (hidden("effect", "delay"), said("unknown", candidates=[])),
    )
    found = figures(rows)
    strong = found["strong"]
    assert strong["first"]["hits"] == 2
    assert strong["exact"]["hits"] == 1
    assert strong["exact"]["count"] == 4
    assert strong["in_set"]["hits"] == 3
    assert strong["set_size"] == pytest.approx((1 + 2 + 1 + 2) / 4)
    assert found["weaker"]["in_set"]["share"] == 0.5
    assert found["weakest"]["reported_none"]["share"] == 0.5
    assert found["strong_in_truth"]["first"]["count"] == 6
    assert found["weaker_in_truth"]["in_set"]["share"] == 1.0
    assert found["by_effect"]["delay"]["exact"]["share"] == 0.25


@pytest.mark.parametrize("cosine", [0.0, 0.8, 0.98])
def test_how_often_the_truth_is_first_at_best_is_what_noise_leaves(cosine):
    """An effect and a competitor at an angle, in noise, many times."""
    rng = np.random.default_rng(1)
    sine = np.sqrt(1 - cosine**2)
    residual = np.array([4.0, 0.0]) + rng.standard_normal((100_000, 2))
    first = np.mean(residual[:, 0] ** 2 > (residual @ [cosine, sine]) ** 2)
    rows = pairs((hidden("effect", "delay", strength=16.0, others=16.0 * sine**2), said("effect", "delay")))
    assert figures(rows)["strong_first_at_best"] == pytest.approx(first, abs=0.006)


def test_the_unmodelled_count_only_where_the_library_cannot_explain_them():
    rows = pairs(
        (hidden("unmodelled", "gear_mesh", beyond=200.0), said("unknown", "delay")),
        (hidden("unmodelled", "gear_mesh", beyond=200.0), said("effect", "delay")),
        (hidden("unmodelled", "gear_mesh", beyond=10.0), said("effect", "delay")),
    )
    found = figures(rows)["unmodelled"]
    assert found["reported_unknown"]["hits"] == found["confidently_wrong"]["hits"] == 1
    assert found["reported_unknown"]["count"] == 2


def test_two_at_once():
    rows = pairs(
        (hidden("pair", "delay", "drift"), said("several", "drift", "delay")),
        (hidden("pair", "delay", "drift"), said("several", "delay", "speed")),
        (hidden("pair", "delay", "drift"), said("unknown", "delay")),
        (hidden("pair", "delay", "drift", next_pair=20.0), said("several", "speed", "drift", candidate_models=[
            ("speed", "drift"), ("delay", "drift")])),
    )  # fmt: skip
    found = figures(rows)
    assert found["pairs"]["both_named"]["hits"] == 2
    assert found["pairs"]["both_first"]["hits"] == 1
    assert (found["pairs"]["precision"]["hits"], found["pairs"]["precision"]["count"]) == (5, 7)
    assert found["pairs_distinguishable"]["both_named"]["count"] == 3


def test_partly_is_right_if_the_family_is():
    law = {"candidates": [{"name": "delay", "family": "lag"}, {"name": "sensor_lowpass", "family": "lag"}]}
    lag = {"effects": [{"name": "sensor_lowpass", "family": "lag", "size": 1.0}]}
    rows = pairs(
        (hidden("variant", "delay"), said("partly", "delay")),
        (hidden("variant", "delay"), said("partly", "sensor_lowpass", **law) | lag),
        (hidden("variant", "delay"), said("effect", "sensor_lowpass", **law) | lag),
        (hidden("variant", "delay"), said("partly", "drift")),
        (hidden("unmodelled", "gear_mesh", beyond=200.0), said("partly", "drift")),
    )
    found = figures(rows)
    assert (found["variants"]["in_set"]["hits"], found["variants"]["in_set"]["count"]) == (2, 4)
    assert found["variants"]["reported_partly"]["hits"] == 3
    assert found["variants"]["exact"]["hits"] == 0
    assert found["unmodelled"]["confidently_wrong"]["hits"] == found["unmodelled"]["reported_partly"]["hits"] == 1
    _, across, counts = confusion(rows)
    assert counts[:, across.index("partly with it")].sum() == 2
    assert counts[:, across.index("partly without")].sum() == 2


def test_shrinkage_and_size_of_what_was_named_exactly():
    alone = {"kind": "test", "share": 0.94, "low": 0.93, "high": 0.97}
    shrinkage = {"predicted": 0.9, "kinds": [alone]}
    entry = hidden("effect", "delay", size=2.0)
    rows = [
        Pairing("a", entry, said("effect", "delay", size=2.1, shrinkage=shrinkage), 0.95),
        Pairing("b", entry, said("effect", "delay", size=4.0, shrinkage=shrinkage), 0.85),
        Pairing("c", entry, said("effect", "speed", size=9.0, shrinkage=shrinkage), 0.1),
    ]
    found = figures(rows)
    assert found["shrinkage"]["predicted_off"]["median"] == pytest.approx(0.05)
    assert found["shrinkage"]["covered"]["hits"] == 1
    assert found["size"]["error"]["max"] == pytest.approx(1.0)
    assert found["size"]["covered"]["hits"] == 1


def test_sizes_of_two_parts_are_compared_part_by_part():
    entry = hidden("effect", "wheel_order", size=5.0)
    entry["causes"][0]["knobs"] = {"A_wc": 3.0, "A_ws": 4.0}
    result = said("effect", "wheel_order", size=5.0)
    result["effects"][0]["parameters"] = {"A_wc": -3.0, "A_ws": 4.0}
    found = figures([Pairing("a", entry, result)])["size"]
    assert found["error"]["max"] == pytest.approx(6 / 5)


def test_the_removed_effect_and_the_next_test():
    group = said("group", "delay", "speed", next_experiment={"resolves": True, "power": 0.99})
    unsure = said("group", "delay", "speed", next_experiment={"resolves": False, "power": 0.49})
    rows = pairs(*[(hidden("effect", "delay"), one) for one in (group, group, group, group, unsure)])
    after = pairs(
        (hidden("effect", "delay"), said("effect", "delay")),
        (hidden("effect", "delay"), said("group", "delay", "drift")),
        (hidden("effect", "delay"), said("group", "delay", "speed")),
        (hidden("effect", "delay"), said("effect", "drift")),
        (hidden("effect", "delay"), said("effect", "delay")),
    )
    without = pairs(
        (hidden("effect", "delay"), said("unknown")),
        (hidden("effect", "delay"), said("effect", "speed")),
        (hidden("effect", "delay", others=20.0), said("effect", "other")),
    )
    second = [replace(after[2], result=said("effect", "delay"))]
    found = figures(rows, [after, second], without)
    assert found["next_experiment"]["claimed"] == 4
    assert found["next_experiment"]["resolved"]["hits"] == 1
    assert found["next_experiment"]["discriminated"]["hits"] == 2
    assert (found["next_experiment"]["all"]["hits"], found["next_experiment"]["all"]["count"]) == (2, 5)
    assert found["next_experiment"]["all_expected"] == pytest.approx(0.89)
    assert found["next_tests_run"] == [5, 1]
    assert found["strong_with_next_test"]["exact"]["hits"] == 3
    assert found["without_the_true_one"]["reported_unknown"]["count"] == 2
    assert found["without_the_true_one"]["confidently_wrong"]["hits"] == 1


def test_confusion_counts_every_campaign_once():
    rows = pairs(
        (hidden("none"), said("none")),
        (hidden("effect", "delay"), said("effect", "delay")),
        (hidden("effect", "speed"), said("effect", "delay")),
        (hidden("effect", "speed"), said("group", "delay", group=["delay", "speed"])),
        (hidden("unmodelled", "gear_mesh"), said("unknown")),
        (hidden("pair", "delay", "speed"), said("several", "delay", "speed")),
    )
    down, across, counts = confusion(rows)
    assert down == ["no effect", "delay", "speed", "gear_mesh", "two effects"]
    assert counts.sum() == len(rows)
    where = {(row, column): counts[i, j] for i, row in enumerate(down) for j, column in enumerate(across)}
    assert where["delay", "delay"] == where["speed", "delay"] == where["speed", "group with it"] == 1
    assert (
        where["two effects", "several, all right"] == where["gear_mesh", "unknown"] == where["no effect", "none"] == 1
    )


def test_true_shrinkage_comes_from_predictions_where_there_are_any(tmp_path):
    slot = Slot(3, "effect", "force_gain", 0)
    specimen, tests = setting(slot)
    entry = {
        "seed": 3, "case": "effect", "cause": "force_gain", "number": 0, "specimen": specimen,
        "causes": [{"knobs": {"g_F": 0.02}, "place": ["sine"]}], "shrinkage": {"share": 0.9},
    }  # fmt: skip
    assert actual(entry, tmp_path / "none.npz") == 0.9
    test = next(t for t in tests if t.name == "sine_2_00Hz")
    true, bare = respond([(case_of(entry), test), (case_of(entry, bare=True), test)])
    arrays = {"start": 50, "before": bare[50:], "after": 0.9 * true[50:] + 0.1 * bare[50:]}
    np.savez(tmp_path / "a.npz", **{f"sine_2_00Hz/{key}": value for key, value in arrays.items()})
    assert actual(entry, tmp_path / "a.npz") == pytest.approx(0.99, abs=1e-9)


def test_command_writes_page_figures_and_picture(tmp_path, monkeypatch, capsys):
    labels, results = tmp_path / "labels.blinded", tmp_path / "results"
    results.mkdir()
    for name, entry, result in (
        ("a", hidden("none"), said("none")),
        ("b", hidden("effect", "delay"), said("effect", "delay")),
        ("c", hidden("effect", "delay"), None),
    ):
        add_label(labels, name, entry)
        if result:
            (results / f"{name}.json").write_text(json.dumps(result))
    arguments = ["score.py", str(labels), str(results), "--out", str(tmp_path / "report")]
    monkeypatch.setattr("sys.argv", arguments)
    main()
    found = json.loads((tmp_path / "report" / "figures.json").read_text())
    assert found == json.loads(capsys.readouterr().out)
    assert found["not_diagnosed"] == 1
    assert found["strong"]["exact"]["share"] == 1.0
    assert [r["verdict"] for r in json.loads((tmp_path / "report" / "rows.json").read_text())] == ["none", "effect"]
    text = (tmp_path / "report" / "README.md").read_text()
    assert "| no effect: false alarms | 0/1 = 0.0 % (0.0 % to 97.5 %) | ≤ 1 % |" in text
    assert (tmp_path / "report" / "confusion.png").read_bytes().startswith(b"\x89PNG")
    monkeypatch.setattr("sys.argv", [*arguments[:2], str(tmp_path), *arguments[3:]])
    with pytest.raises(SystemExit, match="run the diagnosis first"):
        main()
