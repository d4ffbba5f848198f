"""Policies that are sent as data: read one, and act by it without asking a client.

They act like the policies of the R package (``R/policy-*.R``): the actions are the same except for
the last bits of sums, which NumPy adds in another order.
"""

from gym_server.policies.acting import Actor, Policy
from gym_server.policies.read import read_policy

__all__ = ["Actor", "Policy", "read_policy"]
