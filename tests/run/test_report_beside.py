"""A lost process does not cost the report."""

import os

import pytest

from mofit import report_beside
from mofit.forking import may_fork

pytestmark = pytest.mark.skipif(not may_fork(), reason="needs fork and two cores")


drawn = []


def record(*given):
    """In place of what draws; a function of the module, as it is sent to the process before its loss is noticed."""
    drawn.append((os.getpid(), *given))


def test_a_report_whose_process_is_lost_is_drawn_here(monkeypatch, tmp_path):
    here = os.getpid()
    monkeypatch.setattr(report_beside, "_get_ready", lambda: None if os.getpid() == here else os._exit(9))
    monkeypatch.setattr(report_beside, "_write", record)
    with report_beside.report_beside() as drawing, drawing("tree", tmp_path):
        pass
    assert drawn == [(here, "tree", tmp_path, 1)]
