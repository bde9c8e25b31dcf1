"""The three pictures that the readme begins with: a pose, two species, a part.

Run ``python docs/images/draw_first.py DATA`` to draw them again, with the folder of remeshed FAUST, SMAL and SHREC'16
cuts as archives. It takes half a minute.
"""

import sys
from pathlib import Path

import numpy as np

from isomatch import Mesh, match
from isomatch.visualization import draw_map

HERE = Path(__file__).parent
AS_IS, OVER = np.eye(3), np.diag([1.0, -1.0, -1.0])  # SMAL's animals lie on their backs


def remeshed(path):
    """Read one shape of its own file."""
    with np.load(path) as arrays:
        return Mesh(arrays["vertices"], arrays["faces"])


def shape(folder, name, turn=AS_IS):
    """Read one shape of an archive, with its vertices in another order: equal indices tell nothing."""
    with np.load(folder / "shapes.npz") as arrays:
        vertices, faces = arrays[name].astype(float) @ turn, arrays[f"{name}_faces"]
    order = np.random.default_rng(0).permutation(len(vertices))
    return Mesh(vertices[order], np.argsort(order)[faces])


def main(data):
    """Draw all three."""
    people, animals, cuts = data / "faust_r", data / "smal", data / "shrec16_cuts"
    pairs = {
        "first_pose": [remeshed(people / f"tr_reg_{name}.npz") for name in ("024", "038")],
        "first_species": [shape(animals, name, OVER) for name in ("lion_04", "cow_01")],
        "first_part": [shape(cuts, name) for name in ("cuts_horse_shape_3", "null_horse")],
    }
    for name, (source, target) in pairs.items():
        result = match(source, target)
        draw_map(source, target, result.map, HERE / f"{name}.png", titles=("", ""), width=900)
        print(f"{name}: {result.outcome.name}", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
