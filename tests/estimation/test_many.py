"""Many records: a few are searched, all are fitted from there, and alike."""

import numpy as np
import pytest

from driven import task_of
from monodyn.estimation.torque.friction import fit_friction
from monodyn.estimation.torque.many import fit_many
from swings import TIMES, motion, record, scaled

STARTS = [[0.3 * np.cos(k), 0.5 + 0.1 * k] for k in range(8)]


def swings(mechanism, starts=STARTS):
    return [
        record(mechanism, TIMES, motion(mechanism, TIMES, start, [0.0, 1.0]), seed=k)
        for k, start in enumerate(starts)
    ]


@pytest.fixture
def asked():
    """Fit friction, and keep the records of each call."""

    def model(mechanism, task):
        calls.append(task.records)
        return fit_friction(mechanism, task)

    calls = []
    return model, calls


def test_a_few_records_lead_to_the_optimum_of_all(double, truth, asked):
    model, calls = asked
    records = swings(truth)
    task = task_of(records, double)
    found = fit_many(model, double, task)
    assert [[records.index(one) for one in call] for call in calls] == [[0, 2, 4, 7]]
    every = fit_friction(double, task)
    assert found.problem.data.records == 8
    assert found.optimum.cost == pytest.approx(every.optimum.cost, rel=1e-4)
    # both are within the noise of the truth, and much nearer to one another
    values, others = (one.problem.unknowns.named(one.optimum.x) for one in (found, every))
    for name in ("link1.length", "link2.length"):
        assert values[name] == pytest.approx(truth.values[name], rel=0.01)
        assert values[name] == pytest.approx(others[name], rel=1e-4)


@pytest.mark.slow
def test_records_that_are_not_as_the_few_are_searched_with_them(double, truth, asked):
    model, calls = asked
    records = swings(truth)
    other = swings(scaled(truth, link1=1.5, link2=0.7))
    records[1], records[3], records[5], records[6] = other[1], other[3], other[5], other[6]
    fit_many(model, double, task_of(records, double))
    assert [len(call) for call in calls] == [4, 8]


def test_few_records_are_searched_at_once(double, truth, asked):
    model, calls = asked
    fit_many(model, double, task_of(swings(truth, STARTS[:3]), double))
    assert [len(call) for call in calls] == [3]
