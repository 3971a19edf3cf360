"""The clustering game (sections 3.1 and 3.3): dynamics, payoff, and agreement of candidates with a cylinder."""

from cylx.game.dynamics import SparsePayoff, evolve
from cylx.game.payoff import local_payoff, screw_payoff

__all__ = ["SparsePayoff", "evolve", "local_payoff", "screw_payoff"]
