"""How good probabilities are: calibrated or not, and what a bar on them finds and lets through."""

import numpy as np

EDGES = (0.0, 0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.97, 1.0)


def log_loss(probability, true, share):
    """Give the mean of -log(probability of what was so), weighted by `share`."""
    right = np.clip(np.where(true, probability, 1.0 - probability), 1e-15, 1.0)
    return float(-(share @ np.log(right)) / share.sum())


def brier(probability, true, share):
    """Give the mean squared difference of probability and outcome, weighted by `share`."""
    return float(share @ (probability - true) ** 2 / share.sum())


def average_precision(probability, true):
    """Give the precision at each true row, those above it counted, averaged; ties count as one step."""
    if not true.any():
        return float("nan")
    order = np.argsort(-probability, kind="stable")
    hits, last = np.cumsum(true[order]), np.append(np.diff(probability[order]) != 0, True)
    found, taken = hits[last], np.flatnonzero(last) + 1
    return float((np.diff(found, prepend=0) * found / taken).sum() / true.sum())


def calibration(probability, true, edges=EDGES):
    """Give (low, high, rows, mean probability, share of true ones) of each bin that is not empty."""
    index = np.clip(np.searchsorted(edges, probability, side="right") - 1, 0, len(edges) - 2)
    return [
        (edges[k], edges[k + 1], int(inside.sum()), float(probability[inside].mean()), float(true[inside].mean()))
        for k in range(len(edges) - 1)
        if (inside := index == k).any()
    ]


def rates(probability, true, bar):
    """Give precision and recall of the fits that reach a bar; None where there is nothing to divide by."""
    taken = probability >= bar
    hits = int((taken & true).sum())
    return hits / int(taken.sum()) if taken.any() else None, hits / int(true.sum()) if true.any() else None


def cylinders_found(probability, rows, bar):
    """Give the true cylinders, as (scene, index), of which some fit reaches a bar."""
    taken = (probability >= bar) & rows.true
    return set(zip(rows.scenes[taken].tolist(), rows.owners[taken].tolist(), strict=True))
