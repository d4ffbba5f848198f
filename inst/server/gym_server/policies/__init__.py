"""Policies that are data: read one, and act by it, without asking a client for each action.

They act as the policies of the R package do (``R/policy-*.R``): the same actions but for the last
bits of sums, which NumPy adds in another order.
"""

from gym_server.policies.acting import Actor, Policy
from gym_server.policies.read import read_policy

__all__ = ["Actor", "Policy", "read_policy"]
