"""The configuration: a mirror of the YAML file, built from presets, files, overrides and options.

Names are imported on first use, so that using one file does not import the others.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cylx.config.baselines import JinConfig as JinConfig
    from cylx.config.baselines import LineFitConfig as LineFitConfig
    from cylx.config.baselines import MsacConfig as MsacConfig
    from cylx.config.baselines import TranConfig as TranConfig
    from cylx.config.catalogue_file import Given as Given
    from cylx.config.config import Config as Config
    from cylx.config.config import check_tolerance as check_tolerance
    from cylx.config.config import load_config as load_config
    from cylx.config.faults import describe_fault as describe_fault
    from cylx.config.layers import NAMED_OPTIONS as NAMED_OPTIONS
    from cylx.config.layers import named_options as named_options
    from cylx.config.sections import AveragingConfig as AveragingConfig
    from cylx.config.sections import CandidatesConfig as CandidatesConfig
    from cylx.config.sections import CatalogueEntry as CatalogueEntry
    from cylx.config.sections import ClusteringConfig as ClusteringConfig
    from cylx.config.sections import EllipsesConfig as EllipsesConfig
    from cylx.config.sections import SceneConfig as SceneConfig
    from cylx.config.sections import Section as Section
    from cylx.config.sections import SlicingConfig as SlicingConfig
    from cylx.config.sections import VerificationConfig as VerificationConfig
    from cylx.config.yaml_writer import plain_yaml as plain_yaml

_HOMES = {
    "AveragingConfig": "cylx.config.sections",
    "CandidatesConfig": "cylx.config.sections",
    "CatalogueEntry": "cylx.config.sections",
    "ClusteringConfig": "cylx.config.sections",
    "Config": "cylx.config.config",
    "EllipsesConfig": "cylx.config.sections",
    "Given": "cylx.config.catalogue_file",
    "JinConfig": "cylx.config.baselines",
    "LineFitConfig": "cylx.config.baselines",
    "MsacConfig": "cylx.config.baselines",
    "NAMED_OPTIONS": "cylx.config.layers",
    "SceneConfig": "cylx.config.sections",
    "Section": "cylx.config.sections",
    "SlicingConfig": "cylx.config.sections",
    "TranConfig": "cylx.config.baselines",
    "VerificationConfig": "cylx.config.sections",
    "check_tolerance": "cylx.config.config",
    "describe_fault": "cylx.config.faults",
    "load_config": "cylx.config.config",
    "named_options": "cylx.config.layers",
    "plain_yaml": "cylx.config.yaml_writer",
}

__all__ = sorted(_HOMES)  # noqa: PLE0605  (the names are those above)


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'cylx.config' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return __all__
