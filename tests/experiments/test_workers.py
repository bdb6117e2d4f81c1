"""Turns: the least advanced job first, every job to its end, on several threads at once, and never a hang."""

import threading
import time

import pytest

from coachable.experiments.trainers.workers import take_turns


class Counting:
    """A job of so many turns that notes who else was where when it took one."""

    def __init__(self, wanted, jobs, trouble=None):
        self.turns, self.wanted, self.jobs, self.trouble = 0, wanted, jobs, trouble
        self.busy = False
        self.lead = 0

    @property
    def done(self):
        return self.turns >= self.wanted

    def take_turn(self):
        assert not self.busy, "two workers on one job"
        self.busy = True
        waiting = [job.turns for job in self.jobs if not job.busy and not job.done]
        self.lead = max([self.lead, *(self.turns - turns for turns in waiting)])
        if self.trouble is not None and self.turns == 2:
            raise self.trouble
        time.sleep(0.001)
        self.turns += 1
        self.busy = False


def jobs_of(*wanted, trouble=None):
    jobs = []
    jobs += [Counting(turns, jobs, trouble if index == 1 else None) for index, turns in enumerate(wanted)]
    return jobs


def nothing():
    pass


@pytest.mark.parametrize("num_workers", [1, 2, 5])
def test_every_job_gets_all_its_turns_and_none_runs_ahead(num_workers):
    jobs = jobs_of(20, 20, 20, 7)
    take_turns(jobs, num_workers, nothing, every=0.01)
    assert [job.turns for job in jobs] == [20, 20, 20, 7]
    assert max(job.lead for job in jobs) <= 1


def test_a_resumed_job_waits_for_the_others():
    jobs = jobs_of(10, 10)
    jobs[0].turns = 9
    order = []
    for index, job in enumerate(jobs):
        take = job.take_turn
        job.take_turn = lambda index=index, take=take: (order.append(index), take())
    take_turns(jobs, 1, nothing)
    assert order[:9] == [1] * 9


def test_workers_work_at_the_same_time():
    meeting = threading.Barrier(2, timeout=10)

    class Meeting:
        turns, done = 0, False

        def take_turn(self):
            meeting.wait()
            self.done = True

    take_turns([Meeting(), Meeting()], 2, nothing)


def test_no_jobs_and_jobs_already_done_return_at_once():
    take_turns([], 2, nothing)
    take_turns(jobs_of(0, 0), 2, nothing)


@pytest.mark.parametrize("num_workers", [1, 3])
def test_an_error_in_a_turn_stops_everything_and_is_raised(num_workers):
    jobs = jobs_of(10_000, 10_000, 10_000, trouble=OverflowError("out of numbers"))
    with pytest.raises(OverflowError, match="out of numbers"):
        take_turns(jobs, num_workers, nothing, every=0.01)
    assert max(job.turns for job in jobs) < 100
    assert threading.active_count() == 1 or not any(job.busy for job in jobs if job.trouble is None)


def test_ctrl_c_lets_the_turns_under_way_end_and_is_raised():
    jobs = jobs_of(10_000, 10_000)

    def interrupt():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        take_turns(jobs, 2, interrupt, every=0.02)
    assert not any(job.busy for job in jobs)
    turns = [job.turns for job in jobs]
    time.sleep(0.02)
    assert [job.turns for job in jobs] == turns


def test_the_watcher_sees_the_end():
    jobs, seen = jobs_of(3), []
    take_turns(jobs, 1, lambda: seen.append(jobs[0].turns), every=10.0)
    assert seen[-1] == 3
