"""What the tests of commands share: the shipped pair in files, settings for quick matches, and complaints."""

import isomatch
from isomatch.datasets import example_pair

QUICK = "n_columns = 40\nrank = 20\nn_functions = 60\nn_search = 150\nn_refine = 200\n"
QUICKEST = (
    "n_columns = 40\nrank = 20\nn_functions = 40\nn_search = 100\nn_refine = 100\nrefinement = 'none'\n"
)


def write_pair(folder, names=("source", "target"), settings=QUICK):
    """Write the shipped pair and ``quick.toml`` into a folder; the folder."""
    for name, made in zip(names, example_pair()):
        isomatch.write_mesh(folder / f"{name}.ply", made.mesh)
    (folder / "quick.toml").write_text(settings)
    return folder


def one_line(capsys):
    """Standard error, after seeing that it is one line that starts with the program's name."""
    said = capsys.readouterr().err
    assert said.startswith("isomatch: ")
    assert said.count("\n") == 1
    assert said.endswith("\n")
    return said
