"""Who only watches does not hold up who waits: seen in real processes."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from harness import may_idle

from arm_ik_service.programs.priority import NICENESS

pytestmark = pytest.mark.skipif(not may_idle(), reason="no such scheduler here, or it is forbidden")

SAY = """
import os, threading
from arm_ik_service.programs.priority import give_way
give_way(entirely={entirely})
say = lambda: print(os.nice(0), os.sched_getscheduler(0))
say()
thread = threading.Thread(target=say)  # as those of Zenoh and Rerun are, which are started later
thread.start(); thread.join()
"""


@pytest.mark.parametrize("entirely", [False, True])
def test_threads_that_start_after_a_process_gave_way_give_way_too(entirely: bool) -> None:
    run = [sys.executable, "-c", SAY.format(entirely=entirely)]
    said = subprocess.run(run, capture_output=True, text=True, check=True).stdout.splitlines()
    policy = os.SCHED_IDLE if entirely else os.sched_getscheduler(0)
    assert said == [f"{os.nice(0) + NICENESS} {policy}"] * 2
