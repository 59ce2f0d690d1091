"""Leads with the torque of the driven machine, which stays with the crankshaft."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from laufruhe.extensions.flywheel.channels import IRREGULARITY
from laufruhe.extensions.phase_leads.bounds import LeadSwing
from laufruhe.extensions.phase_leads.model import PhaseLeadModel
from laufruhe.machine import Engine
from laufruhe.numerics.norms import NORMS
from laufruhe.problem.decision import Kind
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Measure, Term
from laufruhe.problem.problem import Problem
from physics.test_load_torque import WORK, problem_of


def test_leads_turn_the_engine_against_the_load() -> None:
    """Check that the load stays in sums of shafts (P13) and in bounds of the irregularity (P14)."""
    problem = problem_of("two-machines-angle", 40.0)
    model = PhaseLeadModel(replace(problem, objective=(Term(WORK),), limits=()))
    measure = Measure(IRREGULARITY, NORMS["mean"])
    swing = LeadSwing(problem, model, measure)
    plain = replace(problem, engine=replace(problem.engine, load_torque=None))
    for lead in (0.4, 2.0):
        exact = evaluate(problem, at_lead(problem, lead))
        bound = swing.minimum_over(np.array([lead]), np.zeros(1))
        assert bound == pytest.approx(exact.value(measure), rel=1e-3)
        rows = model.norm(WORK, np.array([lead]), 1440, False).norm
        assert rows.value(np.zeros(len(rows.slope[0, 0]))) == pytest.approx(exact.value(WORK), rel=1e-3)
    works = [evaluate(p, at_lead(p, 0.4)).value(WORK) for p in (problem, plain)]
    assert abs(works[0] - works[1]) > 0.02 * works[1]


def at_lead(problem: Problem, lead: float) -> Engine:
    return problem.design([lead if d.kind is Kind.LEAD else 0.0 for d in problem.decisions])
