"""Processes that go through the same steps side by side."""

import os
import signal
import subprocess
import sys
import textwrap
import time

import pytest

from mofit.errors import InputError
from mofit.runtime.parallel import forked_map, may_fork, shared_map, threads
from mofit.runtime.team import is_first, team

pytestmark = pytest.mark.skipif(not may_fork(), reason="needs fork and two cores")


def test_a_team_shares_the_items_and_all_know_the_results():
    parent = os.getpid()
    with team(2):
        first = forked_map(lambda item: (time.sleep(0.02), item, os.getpid())[1:], [*range(12)], 2)
        # what follows depends on all results, in both
        again = forked_map(lambda item: (item + sum(one for one, _ in first), os.getpid()), [1, 2], 2)
    assert os.getpid() == parent  # only this one leaves
    assert [item for item, _ in first] == [*range(12)]
    assert len({process for _, process in first}) == 2
    assert [item for item, _ in again] == [67, 68]


def test_without_a_team_nothing_is_shared():
    assert {*shared_map(lambda item: os.getpid(), [1, 2, 3], str)} == {os.getpid()}
    with team(1):
        assert {*shared_map(lambda item: os.getpid(), [1, 2, 3], str)} == {os.getpid()}
        assert is_first()


def test_the_items_that_take_longest_begin_first_and_all_are_told_in_turn():
    items, told = ["a", "b", "c", "d"], []
    with team(2):
        begun = forked_map(lambda item: (time.sleep(0.05), time.monotonic())[1], items, 2, items[3:], told.append)
    assert told == [0, 1, 2, 3]
    assert begun[3] < min(begun[1:3])


def test_within_an_item_a_map_is_computed_where_it_is():
    def within(item):
        return {*forked_map(lambda one: os.getpid(), [1, 2, 3], 2)} == {os.getpid()}

    with team(2):
        assert forked_map(within, [1, 2, 3, 4], 2) == [True] * 4
        assert threads(4) == 1
        assert not may_fork()
    assert threads(4) == 4


def test_errors_arrive_whoever_meets_them():
    def fails(item):
        if item == 3:
            raise InputError.of("item 3", "is bad", "Leave it out")
        return item

    with pytest.raises(InputError, match="is bad"), team(2):
        forked_map(fails, [1, 2, 3, 4], 2)
    with team(2):  # and nothing is left of it
        assert forked_map(abs, [-1, -2], 2) == [1, 2]


@pytest.mark.parametrize("loss", ["killed", "unpicklable", "astray"])
def test_what_a_lost_process_leaves_is_computed_here(loss):
    parent = os.getpid()

    def item(number):
        time.sleep(0.02)
        if os.getpid() != parent and loss == "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        return (lambda: number) if os.getpid() != parent and loss == "unpicklable" else number

    def value(one):
        return one() if callable(one) else one

    def name(number):
        return f"{number} {os.getpid()}" if loss == "astray" else f"{number}"

    with team(2):
        found = forked_map(item, [*range(6)], 2, name=name)
        again = forked_map(item, [*range(6)], 2, name=name)
    assert [value(one) for one in found] == [value(one) for one in again] == [*range(6)]


def test_none_outlives_a_parent_that_is_killed(tmp_path):
    program = """
        import os, sys, time
        from mofit.runtime.parallel import forked_map
        from mofit.runtime.team import team
        with team(2):
            forked_map(lambda item: (open(sys.argv[1] + f"/{os.getpid()}", "w").close(), time.sleep(60)), [1, 2], 2)
    """
    process = subprocess.Popen([sys.executable, "-c", textwrap.dedent(program), str(tmp_path)])
    while len(members := [int(file.name) for file in tmp_path.iterdir()]) < 2:
        assert process.poll() is None
        time.sleep(0.05)
    process.kill()
    process.wait()
    (other,) = {*members} - {process.pid}
    until = time.monotonic() + 20
    while time.monotonic() < until:
        try:
            os.kill(other, 0)
        except ProcessLookupError:
            return
        time.sleep(0.05)
    pytest.fail("the other process of the team goes on")


def test_all_but_the_first_are_silent(capfd):
    with team(2):
        forked_map(abs, [1, 2], 2)
        sys.stdout.write("once\n")
        sys.stderr.write("once more\n")
    out, err = capfd.readouterr()
    assert (out, err) == ("once\n", "once more\n")
