"""What is drawn at random for several tests."""

import numpy as np


def random_model(rng):
    axes = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    return 5 * rng.standard_normal(3), axes[2], np.exp(rng.uniform(-2, 2)), axes[:2]
