"""Prediction of any record from a run: a band of parameters, noise and model error, and how well it holds."""

from mofit.prediction.predict import predict
from mofit.prediction.records import FITTED, HELD_OUT, PREDICTED, predict_records
from mofit.prediction.result import prediction_groups

__all__ = ["FITTED", "HELD_OUT", "PREDICTED", "predict", "predict_records", "prediction_groups"]
