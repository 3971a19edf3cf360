"""The logistic regression behind `cylx.evidence`: terms of known sign, and rows that share their weight."""

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

STRENGTH = 2.0
"""Penalty on the squared weights of the standardised terms, halved: what a few rows say is not believed quite."""
FOLDS = 6
CAUTION = 1.2
"""What a false fit weighs beside a true one: the world holds more kinds of things that are none than are made up here,
and a cylinder that is not there does more harm than one that is missed."""


KIND_WEIGHTS = {"plant": 2.0, "thing": 2.0, "depth": 3.0, "wild": 3.0}
"""What racks of pipes, single things, depth-camera scenes and stems count beside other kinds, which count one: they are
what the method is for, and there are few of them."""


class Rows(NamedTuple):
    """Fits that are clearly true or clearly false.

    Parameters
    ----------
    terms : ndarray of shape (N, K)
        Value of each term of the evidence.
    true : ndarray of shape (N,), bool
    scenes : ndarray of shape (N,)
        Name of the scene.
    owners : ndarray of shape (N,)
        Index of the true cylinder in its scene; -1 for false ones.
    """

    terms: np.ndarray
    true: np.ndarray
    scenes: np.ndarray
    owners: np.ndarray

    def subset(self, chosen):
        """Give the chosen rows."""
        return Rows(*(column[chosen] for column in self))

    def without(self, term):
        """Give the rows with one term left out."""
        return self._replace(terms=np.delete(self.terms, term, axis=1))


class Law(NamedTuple):
    """Log-odds as a sum: the bias, and a weight for each term."""

    bias: float
    weights: np.ndarray

    def probability(self, terms):
        """Give the probability of each row of terms to be a cylinder."""
        return 1.0 / (1.0 + np.exp(-np.clip(self.bias + terms @ self.weights, -50.0, 50.0)))


def shared_weights(rows):
    """Let the fits of one true cylinder share the weight of one row; every false fit has its own."""
    _, group = np.unique(
        np.column_stack([rows.scenes.astype(str), rows.owners.astype(str)]), axis=0, return_inverse=True
    )
    group = group.reshape(-1)
    counts = np.bincount(group, rows.true)
    return np.where(rows.true, 1.0 / np.maximum(counts[group], 1.0), 1.0)


def kind_of(scene):
    """Give the kind of a scene from its name: what comes before `_`, or else the name without its number."""
    return scene.split("_")[0] if "_" in scene else scene.rstrip("0123456789")


def origin_of(scene):
    """Give the name of what a scene is of: several scans of one thing, under several noises, differ after `@`."""
    return scene.split("@")[0]


def balanced_weights(rows):
    """Let all kinds of scenes weigh the same, too, but for those of `KIND_WEIGHTS`."""
    share = shared_weights(rows)
    kinds, which = np.unique([kind_of(name) for name in rows.scenes], return_inverse=True)
    totals = np.bincount(which.reshape(-1), share)
    asked = np.array([KIND_WEIGHTS.get(kind, 1.0) for kind in kinds])
    return share * (asked / asked.sum() * share.sum() / totals)[which.reshape(-1)]


def fit_law(rows, signs, strength=STRENGTH, caution=CAUTION):
    """Fit the most likely law whose weights have the given signs, or are zero.

    Parameters
    ----------
    rows : Rows
    signs : ndarray of shape (K,)
        1 or -1 for each term; a weight of zero keeps its sign.
    strength, caution : float
        See `STRENGTH` and `CAUTION`.

    Returns
    -------
    Law
    """
    middle, width = rows.terms.mean(axis=0), rows.terms.std(axis=0)
    width = np.where(width > 0, width, 1.0)  # a term that never changes gets no weight, by the penalty
    standard = (rows.terms - middle) / width
    share = balanced_weights(rows) * np.where(rows.true, 1.0, caution)
    side = np.where(rows.true, 1.0, -1.0)

    def loss(parameters):
        margins = side * (parameters[0] + standard @ parameters[1:])
        pull = -share * side / (1.0 + np.exp(np.clip(margins, -50.0, 50.0)))
        value = share @ np.logaddexp(0.0, -margins) + 0.5 * strength * parameters[1:] @ parameters[1:]
        return value, np.concatenate([[pull.sum()], standard.T @ pull + strength * parameters[1:]])

    bounds = [(None, None), *((0, None) if sign > 0 else (None, 0) for sign in signs)]
    found = minimize(
        loss,
        np.zeros(1 + standard.shape[1]),
        jac=True,
        bounds=bounds,
        method="L-BFGS-B",
        options={"maxiter": 5000, "maxfun": 20000, "ftol": 1e-12, "gtol": 1e-8},
    ).x
    weights = np.copysign(found[1:] / width, signs)
    return Law(float(found[0] - middle @ weights), weights)


def folds_of(scenes, folds=FOLDS, seed=0):
    """Deal the scenes out to folds; give the fold of each row. All scenes of one thing are in one."""
    names, which = np.unique([origin_of(scene) for scene in scenes], return_inverse=True)
    order = np.random.default_rng(seed).permutation(len(names))
    return (order % folds)[which.reshape(-1)]


def cross_validated(rows, signs, folds=FOLDS, caution=CAUTION, strength=STRENGTH):
    """Give the probability of each row by a law that was fitted without its scene."""
    fold = folds_of(rows.scenes, folds)
    probability = np.zeros(len(rows.true))
    for k in np.unique(fold):
        law = fit_law(rows.subset(fold != k), signs, strength, caution)
        probability[fold == k] = law.probability(rows.terms[fold == k])
    return probability
