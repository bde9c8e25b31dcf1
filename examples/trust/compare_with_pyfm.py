"""
Compare with functional maps (pyFM)
===================================

The same pair by pyFM, with the settings that its authors recommend, and by isomatch. It needs
``python -m pip install '.[peers]'``.
"""

import matplotlib.pyplot as plt
import numpy as np

from isomatch import MissingDependencyError, match
from isomatch.datasets import example_pair, ground_truth
from isomatch.evaluation import cumulative_curve, geodesic_errors
from isomatch.visualization import draw_map
from isomatch_lab.baselines import pyfm_zoomout

source, target = example_pair()
maps = {"isomatch": match(source.mesh, target.mesh).map}
try:
    maps["pyFM, ZoomOut"] = pyfm_zoomout(source.mesh, target.mesh)
except MissingDependencyError as missing:
    print(missing)

# %%
# The share of the vertices whose image is nearer to the right place than the threshold.

truth = ground_truth(source, target).vertices
pairs = np.column_stack([np.arange(len(truth)), truth])
thresholds = np.linspace(0, 0.25, 101)
for name, found in maps.items():
    errors = geodesic_errors(target.mesh, found, pairs, n_points=500, seed=0)
    plt.plot(thresholds, 100 * cumulative_curve(errors, thresholds), label=name)
plt.xlabel("geodesic error / √area")
plt.ylabel("vertices, %")
plt.legend()

# %%
# Both maps are right here. Where one is wrong, colours tell.

for name, found in maps.items():
    draw_map(source.mesh, target.mesh, found, f"{name.split(',')[0]}.png", titles=(name, "target"))
