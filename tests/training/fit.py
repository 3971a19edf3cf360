"""Fit the weights of `cylx.evidence` to rows of `collect.py`, `real.py`, `things.py` and `arcs.py`.

The terms and their signs are those of `cylx.evidence.weights`, and the weights are fitted anew: of `TERMS` to fits, of
`BLEND_TERMS` and `PROFILE_TERMS` to the arcs of `arcs.py`, without and with the planes that touch them, and of
`UPRIGHT_TERMS` to the short cylinders of that file that were held upright. All tables are
cross-validated by scene: each fit is judged by weights that were found without its scene, and without others of the
same thing, such as a CAD part under another noise. Fits of a true cylinder that need not be found, and those near one
that are neither it nor something else, are counted and left out. So are arcs of CAD parts that go on tangentially,
unless they are false: as cylinders they may be missed.
"""

import argparse
import json
import sys
from collections import Counter
from pathlib import Path

import numpy as np
from labels import FALSE, TRUE
from logistic import STRENGTH, Rows, balanced_weights, cross_validated, fit_law, kind_of
from scores import average_precision, brier, calibration, cylinders_found, log_loss, rates

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
from tables import number, print_header, print_row

from cylx.config import VerificationConfig
from cylx.evidence.weights import BLEND_TERMS, PROFILE_TERMS, TERMS, UPRIGHT_TERMS
from cylx.stages.verification import GOES_ON

LEAST = VerificationConfig().min_inliers
"""Fits of fewer points are refused whatever their confidence, so that it need not be right for them."""
BARS = (0.3, 0.5, 0.7, 0.9)
WITH_ARCS = {"fit4cad"}
"""Kinds of scenes whose arcs go on tangentially as often as not."""
ARC = 3.7
"""Angle (radians) below which a true cylinder of them is one, if it goes on tangentially."""
BLEND_STRENGTH = 0.5
"""Penalty for the weights of blends, as `STRENGTH`: there are fewer rows, and their terms say more."""
LAWS = {
    "BLEND_BIAS": (BLEND_TERMS, "arcs"),
    "PROFILE_BIAS": (PROFILE_TERMS, "arcs with planes"),
    "UPRIGHT_BIAS": (UPRIGHT_TERMS, "held upright"),
}
"""Laws beside that of fits: their terms, and what they are of."""
PICTURE = Path(__file__).parents[2] / "docs" / "pictures" / "calibration.png"


def read_rows(paths):
    """Read the lines of files; a scene that two of them have would count twice, but for its arcs."""
    lines, scenes = [], set()
    for path in paths:
        fresh = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
        there = {(line["scene"], law_of(line)) for line in fresh}
        if there & scenes:
            names = sorted({scene for scene, _ in there & scenes})
            raise SystemExit(f"{path}: {', '.join(names)}: in another file, too; give it once")
        lines, scenes = lines + fresh, scenes | there
    return lines


def law_of(line):
    """Give the law that a line is for: that of fits, or of verdicts on arcs or on what was held upright."""
    if line.get("upright", False):
        return "UPRIGHT_BIAS"
    if line.get("arc", False):
        return "PROFILE_BIAS" if line["measures"]["arc"] > 0.0 else "BLEND_BIAS"
    return "BIAS"


def may_be_missed(line):
    """Tell whether a line is a true arc that goes on tangentially: no cylinder for the result, but nothing else."""
    measures = line["measures"]
    tangential = measures["tangent"] >= GOES_ON and measures["coverage"] < ARC
    return kind_of(line["scene"]) in WITH_ARCS and line["label"] == TRUE and tangential


def table_of(lines, terms=TERMS):
    """Make of lines the rows of the regression: those that are clearly true or false, by the values of the terms."""
    clear = [line for line in lines if line["label"] in {TRUE, FALSE} and line["measures"]["inliers"] >= LEAST]
    values = [[term.value(line["measures"]) for term in terms] for line in clear]
    return Rows(
        terms=np.array(values, dtype=np.float64).reshape(len(clear), len(terms)),
        true=np.array([line["label"] == TRUE for line in clear], dtype=bool),
        scenes=np.array([line["scene"] for line in clear]),
        owners=np.array([-1 if line["cylinder"] is None else line["cylinder"] for line in clear], dtype=np.int64),
    )


def signs_of(terms):
    """Give the sign of each term's weight, a zero having one, too: a term may lose its weight, not its meaning."""
    return np.copysign(1.0, [term.weight for term in terms])


def written(law, rows, terms=TERMS, bias="BIAS"):
    """Write a law as those lines of `cylx/evidence/weights.py` that change; `usual` is the mean over true cylinders."""
    share = balanced_weights(rows) * rows.true
    usual = share @ rows.terms / share.sum()
    lines = [f"{bias} = {law.bias:.3f}"]
    lines += [
        f'    Term("{term.reason}", {weight:.3f}, {mean:.2f}, ...'
        for term, weight, mean in zip(terms, law.weights, usual, strict=True)
    ]
    return "\n".join(lines)


def quality(probability, rows):
    """Give the numbers that two sets of terms are compared by."""
    share = balanced_weights(rows)
    return {
        "log_loss": log_loss(probability, rows.true, share),
        "brier": brier(probability, rows.true, share),
        "average_precision": average_precision(probability, rows.true),
        "false": int(((probability >= 0.5) & ~rows.true).sum()),
    }


def left_out(rows, signs):
    """Give, for each term, the cross-validated probabilities without it."""
    return [cross_validated(rows.without(k), np.delete(signs, k)) for k in range(len(signs))]


def laws_without(rows, signs, terms=TERMS):
    """Give the law of all terms and those of all but one, as JSON for `ablation.py`."""

    def as_json(law, names):
        return {"bias": law.bias, "weights": dict(zip(names, law.weights.tolist(), strict=True))}

    names = [term.reason for term in terms]
    return {
        "all": as_json(fit_law(rows, signs), names),
        "without": {
            name: as_json(fit_law(rows.without(k), np.delete(signs, k)), names[:k] + names[k + 1 :])
            for k, name in enumerate(names)
        },
    }


def print_calibration(probability, rows):
    """Print how often fits of a confidence are true."""
    print_header("confidence", "fits", "mean confidence", "true")
    for low, high, count, mean, share in calibration(probability, rows.true):
        print_row(f"{low:g} to {high:g}", str(count), f"{mean:.3f}", f"{share:.3f}")


def print_sources(probability, rows):
    """Print, for each kind of scene, how far the confidences are right on the whole, and what a bar of 0.5 does."""
    print_header("source", "scenes", "fits", "mean confidence", "true", "Brier", "cylinders found", "false fits")
    kinds = np.array([kind_of(name) for name in rows.scenes])
    for kind in np.unique(kinds):
        own, p = rows.subset(kinds == kind), probability[kinds == kind]
        known = set(zip(own.scenes[own.true].tolist(), own.owners[own.true].tolist(), strict=True))
        print_row(
            kind,
            str(len(set(own.scenes))),
            str(len(p)),
            f"{p.mean():.3f}",
            f"{own.true.mean():.3f}",
            f"{brier(p, own.true, np.ones(len(p))):.4f}",
            f"{len(cylinders_found(p, own, 0.5))} of {len(known)}",
            str(int(((p >= 0.5) & ~own.true).sum())),
        )


def print_rates(probability, rows):
    """Print what several bars find and let through."""
    print_header("bar", "precision of fits", "recall of fits", "true cylinders found", "false fits")
    for bar in BARS:
        precision, recall = (None if rate is None else float(rate) for rate in rates(probability, rows.true, bar))
        found, false = cylinders_found(probability, rows, bar), int(((probability >= bar) & ~rows.true).sum())
        print_row(f"{bar:g}", number(precision), number(recall), str(len(found)), str(false))


def print_ablation(probability, rows, signs, terms=TERMS):
    """Print what becomes of everything without each term."""
    print_header(
        "without", "log-loss", "Brier", "average precision", "false fits at 0.5", "true cylinders lost", "gained"
    )
    full = cylinders_found(probability, rows, 0.5)
    without = [("nothing", probability)]
    without += zip([term.reason for term in terms], left_out(rows, signs), strict=True)
    for name, values in without:
        score, found = quality(values, rows), cylinders_found(values, rows, 0.5)
        print_row(
            name,
            f"{score['log_loss']:.4f}",
            f"{score['brier']:.4f}",
            f"{score['average_precision']:.4f}",
            str(score["false"]),
            str(len(full - found)),
            str(len(found - full)),
        )


def draw(probability, rows, path):
    """Draw the share of true fits by confidence, with two standard errors, over a histogram."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    table = calibration(probability, rows.true, np.linspace(0, 1, 11))
    _, _, counts, means, shares = map(np.array, zip(*table, strict=True))
    errors = 2.0 * np.sqrt(np.maximum(shares * (1 - shares), 1.0 / counts) / counts)
    figure, (top, bottom) = plt.subplots(2, 1, figsize=(5, 6), sharex=True, height_ratios=(3, 1), layout="constrained")
    top.plot([0, 1], [0, 1], color="0.7", linewidth=1)
    top.errorbar(means, shares, np.minimum(errors, [shares, 1 - shares]), fmt="o", color="tab:blue", capsize=3)
    top.set(ylabel="share of fits that are true", xlim=(0, 1), ylim=(-0.02, 1.02))
    bins = np.linspace(0, 1, 21)
    kinds = [probability[rows.true], probability[~rows.true]]
    bottom.hist(kinds, bins, histtype="step", log=True, label=["true", "false"], color=["tab:blue", "tab:orange"])
    bottom.set(xlabel="confidence, from weights found without the scene", ylabel="fits")
    bottom.legend()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100, metadata={"Software": None})
    plt.close(figure)


def parse():
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", nargs="+", type=Path, metavar="ROWS.jsonl")
    parser.add_argument("--ablation", type=Path, metavar="FILE", help="write the weights without each term as JSON")
    parser.add_argument(
        "--plot", nargs="?", type=Path, const=PICTURE, metavar="PNG", help="draw the calibration (docs/pictures)"
    )
    return parser.parse_args()


def print_law(rows, signs, terms, bias, strength):
    """Fit a law and print it, with the tables of how far it can be trusted; give the cross-validated probabilities."""
    print(f"{written(fit_law(rows, signs, strength), rows, terms, bias)}\n")
    probability = cross_validated(rows, signs, strength=strength)
    score = quality(probability, rows)
    print(f"Cross-validated log-loss {score['log_loss']:.4f}, Brier score {score['brier']:.4f}\n")
    print_calibration(probability, rows)
    print()
    print_sources(probability, rows)
    print()
    print_rates(probability, rows)
    print()
    return probability


def main():
    """Fit, and print everything."""
    a = parse()
    lines = read_rows(a.rows)
    fits = [line for line in lines if law_of(line) == "BIAS"]
    if fits:
        rows, signs = table_of([line for line in fits if not may_be_missed(line)]), signs_of(TERMS)
        counts = Counter(line["label"] for line in fits)
        print(f"{len(set(rows.scenes))} scenes, {len(fits)} fits: {', '.join(f'{n} {k}' for k, n in counts.items())}\n")
        probability = print_law(rows, signs, TERMS, "BIAS", STRENGTH)
        print_ablation(probability, rows, signs)
        if a.ablation:
            a.ablation.write_text(json.dumps(laws_without(rows, signs), indent=2) + "\n", encoding="utf-8")
        if a.plot:
            draw(probability, rows, a.plot)
    for bias, (terms, what) in LAWS.items():
        own = [line for line in lines if law_of(line) == bias]
        if own:
            rows, counts = table_of(own, terms), Counter(line["label"] for line in own)
            scenes = len(set(rows.scenes))
            print(f"\n{scenes} scenes, {len(own)} {what}: {', '.join(f'{n} {k}' for k, n in counts.items())}\n")
            print_law(rows, signs_of(terms), terms, bias, BLEND_STRENGTH)
    return 0


if __name__ == "__main__":
    sys.exit(main())
