"""Synthetic scenes with known cylinders, used by the tests, the samples and the tutorial.

Every scene is determined by its parameters and its seed. Points lie on the surfaces with even density, are moved by
isotropic Gaussian noise, and come in random order; those of a forest come stem by stem.
"""

from cylx.synthetic.paper import single
from cylx.synthetic.plant import piping
from cylx.synthetic.plot import Plot, TrueStem
from cylx.synthetic.room import multi
from cylx.synthetic.runs import TrueFitting, TrueRun
from cylx.synthetic.scene import NOISE, OTHER_SURFACE, SyntheticScene, TrueCylinder
from cylx.synthetic.stand import forest

__all__ = [
    "NOISE",
    "OTHER_SURFACE",
    "Plot",
    "SyntheticScene",
    "TrueCylinder",
    "TrueFitting",
    "TrueRun",
    "TrueStem",
    "forest",
    "multi",
    "piping",
    "single",
]
