"""The configuration: a mirror of the YAML file, one frozen model per stage, each value with default, unit and meaning.

Precedence: defaults < preset < YAML file < `--set section.key=value` < named option. `null` means "from the cloud". It
is resolved in one place (`cylx.scene.resolve`), and the resolved configuration is written to every result.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError, model_validator

from cylx.config.baselines import JinConfig, LineFitConfig, MsacConfig, TranConfig
from cylx.config.choices import Method, Preset
from cylx.config.faults import describe_faults
from cylx.config.layers import Layer, file_layer, merge, nested, override_layer, preset_layer
from cylx.config.sections import (
    AveragingConfig,
    CandidatesConfig,
    ClusteringConfig,
    EllipsesConfig,
    SceneConfig,
    Section,
    SlicingConfig,
    VerificationConfig,
)
from cylx.errors import ConfigError


class Config(Section):
    """All settings of a run."""

    preset: Preset = "auto"
    """Default settings: `auto`, the best there are, or `paper`, the paper to the letter."""
    method: Method = "gt"
    """Method: `gt`, the clustering game; the others are the methods that the paper compares it with."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Random seed; the same seed gives the same bytes, on any number of threads."""
    max_cylinders: Annotated[int, Field(ge=1)] | None = None
    """Maximum number of cylinders; null sets no limit."""
    scene: SceneConfig = SceneConfig()
    """Prior knowledge of the cloud."""
    slicing: SlicingConfig = SlicingConfig()
    """Stage 1: planes and their points."""
    ellipses: EllipsesConfig = EllipsesConfig()
    """Stage 2: ellipses in the slices."""
    candidates: CandidatesConfig = CandidatesConfig()
    """Stage 3: cylinder candidates."""
    clustering: ClusteringConfig = ClusteringConfig()
    """Stage 4: the game."""
    averaging: AveragingConfig = AveragingConfig()
    """Stage 5: one cylinder per cluster."""
    verification: VerificationConfig = VerificationConfig()
    """What a cylinder must fulfil to be accepted."""
    msac: MsacConfig = MsacConfig()
    """Sample consensus, used by `method: msac`."""
    line_fit: LineFitConfig = LineFitConfig()
    """A line through the centres of ellipses, used by `method: line-fit`."""
    tran: TranConfig = TranConfig()
    """Growing from seeds, used by `method: tran`."""
    jin: JinConfig = JinConfig()
    """Spheres that roll within a pipe, used by `method: jin`."""

    @model_validator(mode="after")
    def _check_sources(self) -> Config:
        if self.slicing.planes == 0 and set(self.candidates.sources) == {"slices"}:
            raise ValueError("there are no planes, and candidates.sources has slices alone; raise slicing.planes")
        return self


def load_config(
    *,
    path: str | Path | None = None,
    preset: str | None = None,
    overrides: Sequence[str] = (),
    options: Mapping[str, object] | None = None,
    start: Config | None = None,
) -> Config:
    """Build a configuration: defaults < preset < YAML file < overrides < named options.

    Parameters
    ----------
    path : str or Path, optional
        A YAML file.
    preset : str, optional
        Default settings; overrides a preset named in the file or by an override.
    overrides : sequence of str
        Each `section.key=value`, the value written as in YAML; later ones override earlier ones.
    options : mapping of str to object, optional
        Values by dotted key.
    start : Config, optional
        The configuration to change, instead of the defaults.

    Raises
    ------
    ConfigError
        For a file that cannot be read, and for any unknown key, wrong type or impossible value, in one line.

    Examples
    --------
    >>> load_config(preset="paper", overrides=["slicing.planes=20"]).slicing.planes
    20
    """
    given = [Layer("", start.model_dump())] if start is not None else []
    given += [_without_empty_sections(file_layer(path))] if path is not None else []
    given += [override_layer(text) for text in overrides]
    given += [Layer("", nested(key, value)) for key, value in (options or {}).items()]
    given += [Layer("", {"preset": preset})] if preset is not None else []
    for layer in given:
        _validate(layer.values, [layer])
    names = [layer.values["preset"] for layer in given if "preset" in layer.values]
    merged = preset_layer(names[-1] if names else "auto").values
    for layer in given:
        merged = merge(merged, layer.values)
    config = _validate(merged, given)
    _check_known(config.scene)
    if config.slicing.inclination_deg is not None and config.scene.axis is None:
        raise ConfigError("slicing.inclination_deg", "is given without the axis it refers to", "give scene.axis, too")
    _check_method(config)
    return config


def _check_known(scene: SceneConfig) -> None:
    """Check keys of the scene that need or exclude each other; each layer has been validated by itself before."""
    pairs = {
        "known_radius_sd": (scene.known_radius_sd, scene.known_radius, "known_radius"),
        "axis_sd_deg": (scene.axis_sd_deg, scene.axis, "axis"),
    }
    for name, (deviation, value, needed) in pairs.items():
        if deviation is not None and value is None:
            raise ConfigError(f"scene.{name}", f"is given without scene.{needed}", "give that, too")
    if scene.catalogue is not None and scene.known_radius is not None:
        raise ConfigError("scene.catalogue", "contradicts scene.known_radius", "leave one of them out")


def _check_method(config: Config) -> None:
    """Refuse priors for the other methods: they compute no covariance to weigh a prior against."""
    if config.method == "gt":
        return
    for name in ("known_radius", "axis_sd_deg", "catalogue"):
        if getattr(config.scene, name) is not None:
            fault = f"is for method gt alone, and the method is {config.method}"
            raise ConfigError(f"scene.{name}", fault, "leave it out, or use method gt")


def check_tolerance(config: Config, options: Mapping[str, object]) -> None:
    """Refuse a tolerance given by a named option (see `named_options`) if there is no axis.

    Raises
    ------
    ConfigError
        If there is no axis.
    """
    if config.scene.axis is None and "scene.axis_tolerance_deg" in options:
        fault = "is given without the axis it refers to"
        raise ConfigError("axis tolerance", fault, "give --axis X,Y,Z, or scene.axis, too")


def _without_empty_sections(layer: Layer) -> Layer:
    """Drop sections whose keys are all commented out; YAML reads them as null."""
    sections = {name for name, field in Config.model_fields.items() if isinstance(field.default, Section)}
    return Layer(layer.prefix, {key: v for key, v in layer.values.items() if v is not None or key not in sections})


def _validate(values: dict[str, Any], layers: Sequence[Layer]) -> Config:
    """Build the configuration, or report the wrong value and the layer that gave it."""
    try:
        return Config.model_validate(values)
    except ValidationError as error:
        faults = describe_faults(error, Config)
        path, fault, remedy = faults[0]
        prefixes = [layer.prefix for layer in layers if not path or path[0] in layer.values]
        place = (prefixes[-1] if prefixes else "") + ".".join(path)
        failure = ConfigError(place.removesuffix(": ") or "configuration", fault, remedy)
        failure.faults = tuple((".".join(path), fault, remedy) for path, fault, remedy in faults)
        raise failure from None
