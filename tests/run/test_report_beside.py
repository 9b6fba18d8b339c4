"""A lost process does not cost the report."""

import os

import pytest

from mofit import report_beside
from mofit.forking import may_fork

pytestmark = pytest.mark.skipif(not may_fork(), reason="needs fork and two cores")


def test_a_report_whose_process_is_lost_is_drawn_here(monkeypatch, tmp_path):
    here, drawn = os.getpid(), []
    monkeypatch.setattr(report_beside, "_get_ready", lambda: None if os.getpid() == here else os._exit(9))
    monkeypatch.setattr(report_beside, "_write", lambda *given: drawn.append((os.getpid(), *given)))
    with report_beside.report_beside() as drawing, drawing("tree", tmp_path):
        pass
    assert drawn == [(here, "tree", tmp_path, 1)]
