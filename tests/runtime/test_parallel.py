"""Processes beside: they answer, hand over their errors, and are gone when nobody waits for them."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mofit.errors import InputError
from mofit.runtime.parallel import beside, forked_map, may_fork, processor_time, ready_beside, threads

pytestmark = pytest.mark.skipif(not may_fork(), reason="needs fork and two cores")


def test_the_answer_comes_from_another_process():
    known = object()  # needs no pickling on the way there
    with beside(lambda: (os.getpid(), known is not None)) as result:
        process, seen = result()
    assert process != os.getpid()
    assert seen
    assert not multiprocessing.active_children()


def test_without_fork_it_is_computed_here():
    with beside(os.getpid, fork=False) as result:
        assert result() == os.getpid()


def test_a_lost_process_is_replaced_by_this_one():
    parent = os.getpid()

    def lost():
        if os.getpid() != parent:
            os._exit(9)
        return parent

    with beside(lost) as result:
        assert result() == parent


def test_errors_arrive_with_their_issues():
    def failing():
        raise InputError.of("here", "it is wrong", "Mend it")

    with beside(failing) as result, pytest.raises(InputError, match=r"here: it is wrong\. Mend it\.") as caught:
        result()
    assert caught.value.issues[0].hint == "Mend it"


def test_after_an_error_nobody_waits():
    begin = time.monotonic()
    with pytest.raises(KeyError), beside(lambda: time.sleep(60)):
        raise KeyError
    assert time.monotonic() - begin < 30
    assert not multiprocessing.active_children()


prepared = []


def computed(number):
    return number, os.getpid(), list(prepared), may_fork()


def test_what_is_ready_computes_what_is_sent_later():
    with ready_beside(lambda: prepared.append("fonts")) as start:
        number, process, seen, may = start(computed, 3)()
    assert (number, seen, may) == (3, ["fonts"], True)
    assert process != os.getpid()
    assert not prepared


def test_what_was_to_be_ready_and_is_lost_is_replaced_by_this_process():
    with ready_beside(lambda: os._exit(9)) as start:
        assert start(computed, 4)()[:2] == (4, os.getpid())


def test_a_map_keeps_the_order_and_the_items_that_take_longest_begin_first():
    items = [object() for _ in range(5)]  # needs no pickling on the way there
    begun = forked_map(lambda item: (items.index(item), os.getpid(), time.monotonic()), items, 2, first=items[3:])
    assert [number for number, *_ in begun] == [0, 1, 2, 3, 4]
    assert os.getpid() not in {process for _, process, _ in begun}
    for worker in {process for _, process, _ in begun}:
        own = [number for number, process, _ in sorted(begun, key=lambda one: one[2]) if process == worker]
        assert own == sorted(own, key=[3, 4, 0, 1, 2].index)


def test_a_map_computes_here_what_lost_processes_leave():
    parent = os.getpid()
    assert forked_map(lambda item: item if os.getpid() == parent else os._exit(9), [1, 2, 3], 2) == [1, 2, 3]


SCRIPT = """
import os, time
from mofit.runtime.parallel import beside

def work():
    print(os.getpid(), flush=True)
    time.sleep(600)

with beside(work):
    time.sleep(600)
"""


def test_none_outlives_a_parent_that_is_killed():
    parent = subprocess.Popen([sys.executable, "-c", SCRIPT], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    parent.stdout.close()
    deadline = time.monotonic() + 30
    while _alive(child) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not _alive(child)


def _alive(process: int) -> bool:
    status = Path(f"/proc/{process}/stat")
    try:
        return status.read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.parametrize("processes", [1, 2])
def test_a_map_tells_of_every_item_in_order(processes):
    told = []
    assert forked_map(lambda item: item + 1, [1, 2, 3], processes, tell=told.append) == [2, 3, 4]
    assert told == [0, 1, 2]


def test_the_time_of_processes_beside_counts():
    def busy(_):
        begun = time.process_time()
        while time.process_time() < begun + 0.2:
            pass

    before, own = processor_time(), time.process_time()
    forked_map(busy, [1, 2], 2)
    assert processor_time() - before > time.process_time() - own + 0.3


def test_processes_of_a_map_take_one_thread_each():
    assert forked_map(threads, [4, 4], 2) == [1, 1]
    assert forked_map(threads, [4, 4], 1) == [4, 4]
    assert threads(4) == 4
