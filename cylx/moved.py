"""Old module names of earlier versions: they lead to the new modules for one release, with a warning."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType

MOVED = {
    "cylx.catalogue": "cylx.fits.nominal_radius",
    "cylx.cautions": "cylx.scene.cautions",
    "cylx.consensus": "cylx.game.agreement",
    "cylx.fitting": "cylx.pipeline.segmented",
    "cylx.geometry.bounds": "cylx.fits.cramer_rao",
    "cylx.geometry.conditioning": "cylx.fits.conditioning",
    "cylx.geometry.cylinder_fit": "cylx.fits.robust",
    "cylx.geometry.mixture_fit": "cylx.fits.likelihood",
    "cylx.measures": "cylx.evidence.measures",
    "cylx.noise": "cylx.scene",
    "cylx.payoff": "cylx.game.payoff",
    "cylx.rejections": "cylx.results.rejected",
    "cylx.selection": "cylx.scene.selection",
    "cylx.tables": "cylx.results.table",
}
"""Old and new names of the modules that the pages of an earlier version named or linked to."""


class _OldNames:
    """A finder that the import system asks for a module when all others have failed."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Handle the names that have moved."""
        return ModuleSpec(name, self) if name in MOVED else None  # type: ignore[arg-type]  # it is loader enough

    def create_module(self, spec: ModuleSpec) -> None:
        """Leave the creation to the import system."""

    def exec_module(self, module: ModuleType) -> None:
        """Forward every name of the module to the new one."""
        new = MOVED[module.__name__]
        fault = f"{module.__name__} is {new} now; the old name goes with the next release"
        warnings.warn(fault, DeprecationWarning, stacklevel=2)
        home = import_module(new)
        module.__dict__["__getattr__"] = lambda name: getattr(home, name)


def follow_old_names() -> None:
    """Make the import system find modules by their old names."""
    if not any(isinstance(finder, _OldNames) for finder in sys.meta_path):
        sys.meta_path.append(_OldNames())
