"""
The report of a match
=====================

:func:`isomatch.visualization.write_report` writes one HTML file that needs no network: the outcome, what to do, both
shapes in 3D and the alternatives. ``isomatch match`` writes it as ``report.html``. Turn the shapes below; click on one,
and its image appears on the other.
"""

from isomatch import match
from isomatch.datasets import example_pair
from isomatch.visualization import write_report

source, target = (animal.mesh for animal in example_pair())
result = match(source, target)
write_report("live_report.html", source, target, result, names=("standing", "running"))
