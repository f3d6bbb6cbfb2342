"""Jobs: the latest counts, and contacts of links are computed by one."""

import threading

import numpy as np
import pytest

from dhkit import Arm
from dhkit.lab.contacts import Contacts, nearest
from dhkit.lab.jobs import Jobs
from waiting import wait_for


def test_a_job_reports_its_progress_and_its_result_is_taken_once():
    states, results = [], []
    jobs = Jobs(states.append)
    jobs.start("count", lambda job: job.progress("half") or 7, results.append)
    wait_for(lambda: states and states[-1] is None)
    assert results == [7]
    assert [state["progress"] for state in states[:-1]] == ["", "half"]
    jobs.close()


def test_only_the_latest_job_counts():
    results, begun = [], threading.Event()

    def endless(job):
        begun.set()
        while True:
            job.wait(0.01)

    jobs = Jobs()
    jobs.start("endless", endless, results.append)
    assert begun.wait(5.0)
    for k in range(5):
        jobs.start("number", lambda job, k=k: k, results.append)
    wait_for(lambda: results)
    jobs.close()
    assert results == [4]


@pytest.mark.parametrize(
    ("error", "text"),
    [(ValueError("no  such"), "no such"), (OSError("disk"), "OSError: Python's log says more")],
)
def test_a_job_that_fails_says_so_in_one_line(error, text):
    states = []

    def fail(job):
        raise error

    jobs = Jobs(states.append)
    jobs.start("fail", fail, lambda result: None)
    wait_for(lambda: states and states[-1] and states[-1]["error"])
    assert states[-1] == {"id": 1, "title": "fail", "progress": "", "running": False, "error": text}
    jobs.close()


def test_contacts_are_known_once_they_are_prepared():
    pytest.importorskip("coal")
    arm, ready = Arm.load("puma560"), threading.Event()
    contacts = Contacts()
    folded = np.radians([0.0, 0.0, 270.0, 0.0, 0.0, 0.0])
    contacts.prepare(arm, ready.set)
    assert contacts.nearest(arm, folded) is None
    assert ready.wait(30.0)
    found = contacts.nearest(arm, folded)
    assert found == nearest(arm, folded)
    assert len(found["links"]) == 2 and found["distance"] is not None
    contacts.close()
