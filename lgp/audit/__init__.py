"""The audit of a plan: what it does is replayed and measured without the code that planned it.

It shares the files of robots, the table of the human body and the interpolation that a plan states with the planner,
and nothing else: kinematics, attachments, pairs of bodies, distances and exemptions are its own.
"""
