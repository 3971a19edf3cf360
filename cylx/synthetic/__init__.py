"""Synthetic scenes with known cylinders, used by the tests, the samples and the tutorial.

Every scene is determined by its parameters and its seed. Points lie on the surfaces with even density, are moved by
isotropic Gaussian noise, and come in random order.
"""

from cylx.synthetic.paper import single
from cylx.synthetic.plant import piping
from cylx.synthetic.room import multi
from cylx.synthetic.runs import TrueFitting, TrueRun
from cylx.synthetic.scene import NOISE, OTHER_SURFACE, SyntheticScene, TrueCylinder

__all__ = [
    "NOISE",
    "OTHER_SURFACE",
    "SyntheticScene",
    "TrueCylinder",
    "TrueFitting",
    "TrueRun",
    "multi",
    "piping",
    "single",
]
