"""The arrows between the rooms of cylx: held against its imports, and written into docs/design.md."""

MAY_IMPORT = {
    "__main__": {"cli"},
    "cylx": {
        "api", "config", "errors", "evaluation", "geometry", "io", "moved", "pipeline", "records", "report", "results",
        "version",
    },
    "cli": {
        "api", "config", "errors", "evaluation", "experiments", "export", "harmless", "io", "optional", "palette",
        "pipeline", "records", "report", "results", "scene", "synthetic", "tiles", "version", "wording",
    },
    "api": {
        "config", "evaluation", "fits", "geometry", "io", "pipeline", "records", "results", "runs", "scene", "stages",
        "tiles",
    },
    "runs": {"fits", "geometry", "records"},
    "tiles": {"config", "errors", "geometry", "io", "optional", "pipeline", "records", "scene"},
    "experiments": {"config", "fits", "geometry", "optional", "pipeline", "records", "synthetic", "version"},
    "pipeline": {
        "baselines", "config", "errors", "evidence", "fits", "game", "geometry", "records", "scene", "segments",
        "stages",
    },
    "stages": {"config", "evidence", "fits", "game", "geometry", "records", "segments"},
    "segments": {"fits", "geometry", "records"},
    "report": {"config", "errors", "geometry", "optional", "palette", "records", "results"},
    "export": {"errors", "geometry", "harmless", "optional", "results", "version"},
    "scene": {"config", "errors", "fits", "geometry", "records"},
    "game": {"geometry", "records"},
    "baselines": {"config", "errors", "fits", "geometry", "optional", "records"},
    "results": {"config", "errors", "geometry", "harmless", "optional", "records", "version", "wording"},
    "io": {"errors", "optional", "palette", "records"},
    "evidence": {"geometry", "records"},
    "records": {"config", "fits", "geometry", "wording"},
    "synthetic": {"errors", "geometry"},
    "evaluation": {"errors", "geometry", "harmless"},
    "config": {"errors"},
    "optional": {"errors"},
    "fits": {"geometry"},
    "geometry": set(),
    "errors": set(),
    "harmless": set(),
    "moved": set(),
    "palette": set(),
    "version": set(),
    "wording": set(),
}  # fmt: skip
"""The rooms from the top floor to the ground; each imports from those below it only."""
