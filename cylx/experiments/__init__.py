"""The paper's experiments (section 4), run again with its method, its competitors, and the default method."""

from cylx.experiments.figures import FIGURES, Cell, Figure
from cylx.experiments.pictures import draw
from cylx.experiments.scans import ObjectScan
from cylx.experiments.study import Summary, run_tasks, summarize, tasks_of
from cylx.experiments.table import Key, Trials, header_line, parse_trials, trial_lines
from cylx.experiments.trials import Outcome, run_trial

__all__ = [
    "FIGURES",
    "Cell",
    "Figure",
    "Key",
    "ObjectScan",
    "Outcome",
    "Summary",
    "Trials",
    "draw",
    "header_line",
    "parse_trials",
    "run_tasks",
    "run_trial",
    "summarize",
    "tasks_of",
    "trial_lines",
]
