"""Effort of agents: the integral of the squared accelerations of their joints, which is the first term of the cost."""

from __future__ import annotations

import numpy as np

from lgp.path.costs import acceleration_quadratic_of
from lgp.plan_record import Plan


def effort_by_agent(plan: Plan) -> dict[str, float]:
    """Return the squared accelerations of each agent of a feasible plan over time [rad^2/s^3, m^2/s^3 of slides].

    A plan without motion has none.
    """
    names = [name.partition(".")[0] for name in plan.joints]
    by_joint = np.zeros(len(names))
    if len(plan.path):
        deviation = plan.path - plan.start
        quadratic = acceleration_quadratic_of(np.diff(plan.time, prepend=0.0), stop=True)
        by_joint = np.einsum("tj,ts,sj->j", deviation, quadratic, deviation, optimize=True)
    return {agent: float(by_joint[[name == agent for name in names]].sum()) for agent in dict.fromkeys(names)}
