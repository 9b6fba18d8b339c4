"""A Gaussian process of the residual over the motion and the simulated output (Kennedy and O'Hagan 2001)."""

from __future__ import annotations

import warnings
from functools import partial

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from diagnosis_peers_cases.answer import Answer, Choice, chosen
from diagnosis_peers_cases.records import Records, distinct, rms
from mofit._typing import FloatArray

#: samples that hyperparameters, and predictions, are conditioned on
FEW, MANY = 300, 900


def gaussian_process(records: Records, held: Records) -> Answer:
    """Hyperparameters by maximum likelihood; kept where tests left out are predicted better than without."""
    names = distinct(records.signals)
    scale = np.array([rms(records.signals[name]) for name in names])
    inputs, outputs = _rows(records, names, scale, FEW)
    kernel = ConstantKernel(1.0, (1e-3, 1e3)) * RBF(np.ones(len(names)), (0.05, 1e3)) + WhiteKernel(0.1, (1e-6, 1e1))
    process = GaussianProcessRegressor(kernel, n_restarts_optimizer=2, random_state=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # an input without influence has no finite length
        process.fit(inputs, outputs)
    predict = partial(_predict, process.kernel_, names, scale)
    number, told = chosen(records, [Choice(1, predict)])
    if number is None:
        return Answer(False, told=told)
    lengths = np.asarray(process.kernel_.k1.k2.length_scale) * np.ones(len(names))
    order = np.argsort(lengths)
    where = ", ".join(f"{names[k]} ({lengths[k]:.2g})" for k in order if lengths[k] < 10)
    return Answer(True, where=f"depends on {where}", told=told, correction=predict(records, held))


def _predict(kernel: object, names: list[str], scale: FloatArray, records: Records, others: Records) -> FloatArray:
    process = GaussianProcessRegressor(kernel, optimizer=None)
    process.fit(*_rows(records, names, scale, MANY))
    return np.asarray(process.predict(_features(others, names, scale)).reshape(others.output.shape))


def _rows(records: Records, names: list[str], scale: FloatArray, most: int) -> tuple[FloatArray, FloatArray]:
    inputs, outputs = _features(records, names, scale), records.residual.ravel()
    picked = np.random.default_rng(0).permutation(len(outputs))[:most]
    return inputs[picked], outputs[picked]


def _features(records: Records, names: list[str], scale: FloatArray) -> FloatArray:
    return np.stack([records.signals[name].ravel() for name in names], axis=1) / scale
