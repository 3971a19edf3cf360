"""The paper's four competitors (section 4.2), with the same interface as its own method.

None of them was published as a program; each module gives the source of its method and our reading of it. They use the
same cloud, limits on radius and direction, extents, labels and outputs. They verify nothing and have no confidence.
"""

from cylx.baselines.jin import find_by_spheres
from cylx.baselines.limits import Limits
from cylx.baselines.line_fit import fit_line_of_centres
from cylx.baselines.msac import find_by_consensus
from cylx.baselines.proposal import Proposal
from cylx.baselines.tran import find_by_growing

__all__ = ["Limits", "Proposal", "find_by_consensus", "find_by_growing", "find_by_spheres", "fit_line_of_centres"]
