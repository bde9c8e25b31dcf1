"""
Save a map, and load it again
=============================

A result is saved with everything it knows. The map alone can be saved for other programs.
"""

from pathlib import Path
from tempfile import mkdtemp

import numpy as np

from isomatch import Correspondence, MatchResult, match
from isomatch.datasets import example_pair

folder = Path(mkdtemp())
source, target = (animal.mesh for animal in example_pair())
result = match(source, target)

# %%
# All of it: map, outcome, quality, alternatives, settings.

result.save(folder / "result.npz")
loaded = MatchResult.load(folder / "result.npz")
print(loaded.outcome.name, loaded.quality)

# %%
# The map alone, as arrays or as text with one 0-based target vertex on each line.

result.map.save(folder / "map.npz")
result.map.save(folder / "map.txt")
arrays = np.load(folder / "map.npz")
print({name: array.shape for name, array in arrays.items()})
print(*(folder / "map.txt").read_text(encoding="utf-8").splitlines()[-3:], sep="\n")

# %%
# A map remembers the surfaces it belongs to, by hashes of their contents, and refuses others.

again = Correspondence.load(folder / "map.npz")
again.check_fits(source, target)
try:
    again.check_fits(target, source)
except ValueError as error:
    print(error)
