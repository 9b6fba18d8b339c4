"""CSV files as a damper rig may write them: three strokes of a Zener damper (k = 800 N/m, k_1 = 60 kN/m, tau = 40 ms).

python examples/rig_csv.py my_rig
"""

import sys
from pathlib import Path

import numpy as np

K, K_1, TAU, NOISE = 800.0, 60e3, 0.04, 4.0


def force(time, amplitude, frequency):
    """Response to a sine from rest, in closed form: N from m and Hz."""
    w = 2 * np.pi * frequency
    lag = w * TAU
    branch = K_1 * lag / (1 + lag**2) * (np.cos(w * time) + lag * np.sin(w * time) - np.exp(-time / TAU))
    return amplitude * (K * np.sin(w * time) + branch)


def main(folder):
    """Write one file per test."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(1)
    for frequency in (0.5, 2.0, 8.0):
        time = np.arange(0, 10 / frequency, 0.002)
        stroke = 0.01 * np.sin(2 * np.pi * frequency * time)
        measured = force(time, 0.01, frequency) + rng.normal(0, NOISE, len(time))
        table = np.column_stack([time, 1e3 * stroke, measured])
        head = "time [s];stroke [mm];damper force [N]"
        np.savetxt(folder / f"sine_{frequency:g}Hz.csv", table, "%.6g", ";", header=head, comments="")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
