"""How strong the effect of a campaign is: what is left of it after a refit, in standard deviations of the noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mofit._typing import FloatArray
from other_rigs_cases.cases import Case
from other_rigs_cases.element import Element, Reach
from other_rigs_cases.excitation import COUNT, SAMPLE, Test
from other_rigs_cases.rig import Motion, Rig, drive_of
from other_rigs_cases.sensor import bent, recorded, with_play
from other_rigs_cases.tyre import standing

#: noise relative to the range of the output; the least that a campaign may have
LEVEL, LEAST = 0.01, 1e-4
#: root mean square of the gap after a refit, in standard deviations of the noise
WEAK, STRONG = 3.0, 10.0
#: relative step of a parameter's derivative; rounds in which the size is found
CHANGE, ROUNDS = 1e-3, 4
#: records without an effect are simulated with these scales, which do not matter there
NOTHING = Reach(1.0, 1.0, 1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Strength:
    """Knob, noise and gap of a campaign."""

    size: float
    noise: float
    gap: float
    """After a refit, in units of the output."""

    @property
    def visible(self) -> bool:
        """Whether the gap is as large as asked."""
        return self.gap >= 0.8 * WEAK * self.noise


class Specimen:
    """A drawn rig with its tests: records by the size of an effect, and what its parameters can follow."""

    def __init__(self, rig: Rig, values: Mapping[str, float], tests: Sequence[Test]) -> None:
        tests = list(tests)
        self.rig, self.values, self.tests = rig, dict(values), tests
        self.dynamic = np.array([test.kind != "step" for test in tests])
        bare, count = Element({}, NOTHING), len(tests)
        moved = self._moved()
        lanes = {key: np.repeat([values[key] for values in moved], count) for key in values}
        usual = rig.respond(lanes, bare, drive_of(tests * len(moved)), {})
        x, v = (np.abs(one[:, :count][:, self.dynamic]).max() for one in (usual.deflection, usual.rate))
        duration = max(test.start for test in tests) + COUNT * SAMPLE
        y = np.abs(usual.output[:, :count][:, self.dynamic]).max()
        self.reach = Reach(float(x), float(v), self.values[rig.stiffness] * float(x), float(y), duration)
        records = recorded(usual.output, tests * len(moved), {}, self.reach, np.random.default_rng(0))
        parts = np.split(records, len(moved), axis=1)
        self.level = LEVEL * float(np.median(np.ptp(parts[0][:, self.dynamic], axis=0)))
        rows = [self._rows(part, {}, values) for part, values in zip(parts, moved, strict=True)]
        self.usual = rows[0]
        columns = np.stack([(row - rows[0]) / np.linalg.norm(row - rows[0]) for row in rows[1:]], axis=1)
        self.basis = np.linalg.svd(columns, full_matrices=False)[0]

    def _moved(self) -> list[dict[str, float]]:
        """The values, then once more per value with this one changed a little."""
        steps = {name: CHANGE * (abs(value) or 1.0) for name, value in self.values.items()}
        return [self.values, *({**self.values, name: self.values[name] + step} for name, step in steps.items())]

    def records(self, knobs: Mapping[str, float], tests: Sequence[Test], rng: np.random.Generator) -> FloatArray:
        """Records (COUNT, tests) of the rig with an effect, without noise."""
        motion = self._motion(knobs, tests)
        return recorded(motion.output, tests, knobs, self.reach, rng)

    def gap(self, knobs: Mapping[str, float], seed: int) -> float:
        """Root mean square of what a refit leaves of the effect in the dynamic tests."""
        with np.errstate(all="ignore"):
            records = self.records(knobs, self.tests, np.random.default_rng(seed))
            change = self._rows(records, knobs, self.values) - self.usual
        if not np.all(np.isfinite(change)):
            return np.inf
        left = change - self.basis @ (self.basis.T @ change)
        return float(np.sqrt(np.mean(left[: COUNT * int(self.dynamic.sum())] ** 2)))

    def _motion(self, knobs: Mapping[str, float], tests: Sequence[Test]) -> Motion:
        drive = drive_of(tests)
        if knobs.keys() & {"play", "hysteretic_play"}:
            u, v = with_play(drive.u, knobs)
            drive = replace(drive, u=u, v=v)
        return self.rig.respond(self.values, Element(knobs, self.reach), drive, knobs)

    def standing(self, knobs: Mapping[str, float], values: Mapping[str, float]) -> FloatArray:
        """Record of the standing tyre, without noise."""
        return bent(standing(values, Element(knobs, self.reach)), knobs, self.reach.output)

    def _rows(self, records: FloatArray, knobs: Mapping[str, float], values: Mapping[str, float]) -> FloatArray:
        """Dynamic records, then the ends of steps and the standing tyre."""
        rows = [records[:, self.dynamic].T.ravel()]
        if self.rig.rolling:
            rows += [records[-COUNT // 4 :, ~self.dynamic].T.ravel(), self.standing(knobs, values)]
        return np.concatenate(rows)


def strengthened(specimen: Specimen, case: Case, target: float, seed: int) -> Strength:
    """The knob at which the gap is ``target`` times the noise of 1 %; where it cannot be, less noise.

    The gap of what the parameters absorb grows slowly; its largest knob then has the noise that shows it.
    """
    size, gap = 0.3 * case.most, 0.0
    for _ in range(ROUNDS):
        gap = specimen.gap({case.knob: size}, seed)
        if not np.isfinite(gap):
            size /= 4
            continue
        wanted = size * target * specimen.level / max(gap, 1e-12)
        if abs(wanted / size - 1) < 0.1 or (size == case.most and wanted > size):
            break
        size = min(wanted, case.most)
    else:
        gap = specimen.gap({case.knob: size}, seed)
    return Strength(size, max(min(specimen.level, gap / target), LEAST / LEVEL * specimen.level), gap)
