"""The whole method in one call, and its results for other programs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cylx.api.clouds import chosen_cloud
from cylx.api.warmup import compile_kernels
from cylx.config import Config, Given, check_tolerance, load_config, named_options
from cylx.evaluation import Evaluation
from cylx.evaluation import evaluate as evaluate_documents
from cylx.io import read_json
from cylx.pipeline import extract_cylinders
from cylx.records import Crop, Extraction, Observer, PointCloud, SilentObserver
from cylx.results import Result

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def extract(
    points_or_path: ArrayLike | PointCloud | str | PathLike[str],
    *,
    method: str | None = None,
    preset: str | None = None,
    config: Config | str | PathLike[str] | None = None,
    overrides: Sequence[str] = (),
    seed: int | None = None,
    radius: tuple[float | None, float | None] | None = None,
    max_cylinders: int | None = None,
    planes: int | None = None,
    axis: Sequence[float] | str | None = None,
    axis_tolerance_deg: float | None = None,
    axis_sd_deg: float | None = None,
    known_radius: tuple[float, float | None] | None = None,
    catalogue: Given | str | PathLike[str] | None = None,
    min_coverage_deg: float | None = None,
    blends: bool | None = None,
    runs: bool = False,
    crop: Crop | None = None,
    voxel: float | None = None,
    every: int | None = None,
    classes: Sequence[int] | None = None,
    scan: int | None = None,
    threads: int | None = None,
    observer: Observer | None = None,
) -> Extraction:
    """Find the cylinders of a point cloud; the same as `cylx extract`.

    Parameters
    ----------
    points_or_path : array_like of shape (N, 3), PointCloud, str or Path
        Coordinates in any unit, or a file that holds them.
    method : str, optional
        `gt`, the clustering game, or one of its competitors, `msac`, `line-fit`, `tran` and `jin`.
    preset : str, optional
        `auto` or `paper`; by default that of the configuration, or `auto`.
    config : Config, str or Path, optional
        The configuration, or a YAML file.
    overrides : sequence of str
        Each `section.key=value`; they override the configuration.
    seed : int, optional
        Random seed.
    radius : pair of float or None, optional
        Smallest and largest radius, in the unit of the points; None sets no limit.
    max_cylinders : int, optional
        Maximum number of cylinders.
    planes : int, optional
        Number of planes through the whole cloud.
    axis : sequence of float or str, optional
        Direction of the cylinders to find: three numbers, or `x`, `y` or `z`; length and sign do not matter.
    axis_tolerance_deg : float, optional
        Largest angle between a cylinder and `axis`, degrees; 10 by default.
    axis_sd_deg : float, optional
        Standard deviation of the cylinders' tilts from `axis`, degrees: a prior for each fit.
    known_radius : pair of float, optional
        Known radius of the cylinders, in the unit of the points, and its standard deviation (None: a thousandth of the
        radius): a prior for each fit that does not contradict it.
    catalogue : str, Path, or sequence of mapping or float, optional
        Nominal radii, in the unit of the points: a CSV or YAML file, entries with `name`, `radius` and `tolerance` as
        in the configuration, or just radii. The one that a fit supports becomes its prior.
    min_coverage_deg : float, optional
        Smallest angle of the surface that must be seen, about the axis, degrees.
    blends : bool, optional
        Whether to look for arcs that go on tangentially, such as rounds and fillets; they are in `Extraction.blends`.
        By default as configured, and that is yes.
    runs : bool
        Whether to join the cylinders to runs, as `cylx.find_runs` does; they are in `Extraction.piping`.
    crop : pair of triples of float or None, optional
        Smallest and largest coordinates of the points to use; None sets no bound.
    voxel : float, optional
        Side of the cells in which only one point is used, in the unit of the points.
    every : int, optional
        Use only the first of this many rows.
    classes : sequence of int, optional
        Use only points of these classes; for files that have classes, as LAS and LAZ do.
    scan : int, optional
        Number of the scan of an E57 or PTX file to read, from 0; by default all.
    threads : int, optional
        Number of threads; the result does not depend on it. By default one per core.
    observer : Observer, optional
        Receives the progress.

    Returns
    -------
    Extraction

    Raises
    ------
    ConfigError
        If the settings have an unknown key, a wrong type or an impossible value.
    InputError
        If the file cannot be read, or the cloud is unusable.
    ValueError
        If the shape of the array is not (N, 3), or the selection of points is impossible.

    Examples
    --------
    >>> import cylx, cylx.synthetic
    >>> pipe = cylx.synthetic.single(points=2000, seed=1)
    >>> found = cylx.extract(pipe.points)
    >>> [round(fit.cylinder.radius, 1) for fit in found.cylinders]
    [1.0]
    """
    options = named_options(
        method=method,
        seed=seed,
        radius=radius,
        max_cylinders=max_cylinders,
        planes=planes,
        axis=axis,
        axis_tolerance_deg=axis_tolerance_deg,
        axis_sd_deg=axis_sd_deg,
        known_radius=known_radius,
        catalogue=catalogue,
        min_coverage_deg=min_coverage_deg,
        blends=blends,
    )
    settings = load_config(
        path=None if config is None or isinstance(config, Config) else Path(config),
        start=config if isinstance(config, Config) else None,
        preset=preset,
        overrides=overrides,
        options=options,
    )
    check_tolerance(settings, options)
    cloud = chosen_cloud(points_or_path, crop=crop, voxel=voxel, every=every, classes=classes, scan=scan)
    observer = observer or SilentObserver()
    compile_kernels(observer)
    found = extract_cylinders(cloud, settings, threads=threads, observer=observer)
    if not runs:
        return found
    from cylx.api.piping import find_runs  # noqa: PLC0415  for this alone

    return find_runs(found, observer=observer)


def read_result(path: str | PathLike[str]) -> Result:
    """Read the result of `cylx extract`.

    Parameters
    ----------
    path : str or Path
        `NAME.cylinders.json`, or `-` for standard input.

    Raises
    ------
    InputError
        If the file cannot be read, or is not a result of this version of the format.
    """
    return Result.parse(read_json(Path(path)), str(path))


def evaluate(
    truth: Mapping[str, object] | Extraction | Result | str | PathLike[str],
    result: Mapping[str, object] | Extraction | Result | str | PathLike[str],
    *,
    angle_deg: float = 5.0,
    offset: float = 0.25,
    radius: float = 0.15,
) -> Evaluation:
    """Match a result with a truth, one to one, and say how good it is; the same as `cylx evaluate`.

    A pair is admissible if its errors (see `cylx.evaluation.Match`) are all below the given limits. Among the
    admissible pairs as many as possible are matched, at the least sum of errors over limits. True cylinders marked
    `ignore` need not be found. If both list `fittings` and `runs`, as the truth of `cylx.synthetic.piping` does, these
    are scored, too (see `cylx.evaluation.FittingScores` and `cylx.evaluation.RunScore`).

    Parameters
    ----------
    truth, result : mapping, Extraction, Result, str or Path
        JSON objects with a list `cylinders`, the files that hold them, or what was extracted.
    angle_deg : float
        Limit of the axis angle, degrees.
    offset : float
        Limit of the distance from the axis, in true radii.
    radius : float
        Limit of the relative radius error.

    Raises
    ------
    InputError
        If a file cannot be read, either is malformed, or a true cylinder is not finite.
    UsageError
        If a limit is not positive.
    """
    documents = _document(truth), _document(result)
    return evaluate_documents(*documents, angle_deg=angle_deg, offset=offset, radius=radius)


def _document(given: Mapping[str, object] | Extraction | Result | str | PathLike[str]) -> Mapping[str, object]:
    """Return the JSON object that was given, in whatever form."""
    if isinstance(given, str | PathLike):
        return read_json(Path(given))
    found = Result.of(given) if isinstance(given, Extraction) else given
    return found.to_object() if isinstance(found, Result) else found


def to_dict(extraction: Extraction) -> dict[str, Any]:
    """Return an extraction as the JSON object that `cylx extract` writes.

    Parameters
    ----------
    extraction : Extraction

    Examples
    --------
    >>> import cylx, cylx.synthetic
    >>> found = cylx.extract(cylx.synthetic.single(points=2000, seed=1).points)
    >>> [round(cylinder["radius"], 1) for cylinder in cylx.to_dict(found)["cylinders"]]
    [1.0]
    """
    return Result.of(extraction).to_object()


def to_dataframe(found: Extraction | Result) -> Any:  # noqa: ANN401  pandas is an extra
    """Return the cylinders as a pandas data frame, one row each.

    Vectors have a column for each of x, y and z. Keys of inner objects follow the name of the object:
    `uncertainty_radius` is the standard deviation of the radius.

    Parameters
    ----------
    found : Extraction or Result

    Raises
    ------
    UsageError
        If pandas is not installed.
    """
    return (Result.of(found) if isinstance(found, Extraction) else found).to_dataframe()
