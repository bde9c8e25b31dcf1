"""A match in a process of its own: ``python worker.py FOLDER``.

Blender supports no Python threads beside its own, and this process can be ended at any moment. It is started by `job`,
which writes its order into the folder and finds there how far it is, the result, or the error in words.
"""

import json
import sys
from pathlib import Path


def main(folder: Path) -> None:
    """Carry out the order of a folder."""
    order = json.loads((folder / "order.json").read_text(encoding="utf-8"))
    own = sys.path[1:]  # without the folder of the add-on
    sys.path[:] = [
        *own,
        *(place for place in order["path"] if place not in own),
    ]  # isomatch is where Blender finds it
    import numpy as np

    from isomatch import Config, IsomatchError, match

    def tell(stage: str, share: float) -> None:
        with (folder / "progress.txt").open("a", encoding="utf-8") as file:
            file.write(f"{share} {stage}\n")

    given = dict(np.load(folder / "surfaces.npz"))
    surfaces = [(given[f"{side}_vertices"], given[f"{side}_faces"]) for side in ("source", "target")]
    try:
        config = Config.from_dict(order["config"])
        result = match(*surfaces, landmarks=given.get("landmarks"), config=config, progress=tell)
        result.save(folder / "result.npz")
    except IsomatchError as error:
        (folder / "error.txt").write_text(str(error), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
