"""The list of loops that are compiled ahead. Run as a script, this file records it anew."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

LIST = Path(__file__).parents[1] / "src/isomatch/loading/loops.txt"
HEAD = """\
# The loops of isomatch for the types of arguments that it gives them, in the order of their first calls:
# section (see listed.py), module, name, types. Recorded by `python tests/test_ahead.py`.
"""

RECORDING = '''
import sys
from numba import types
from numba.core import event

def word(type):
    if not isinstance(type, types.Array):
        return "boolean" if type == types.boolean else str(type)
    return f"{word(type.dtype)}:{type.ndim}{type.layout}" + "r" * (not type.mutable)

class Recorder(event.Listener):
    depth = 0
    def on_start(self, event):
        self.depth += 1
    def on_end(self, event):
        self.depth -= 1
        function = event.data["dispatcher"].py_func
        if not self.depth and function.__module__.startswith("isomatch."):
            words = map(word, event.data["args"])
            sys.stderr.write(" ".join(["LOOP", function.__module__, function.__qualname__, *words]) + "\\n")

event.register("numba:compile", Recorder())
'''
PAIR = """
import isomatch
from isomatch.datasets import example_pair
source, target = (shape.mesh for shape in example_pair())
"""
MATCH = PAIR + "isomatch.match(source, target)\n"
FILES = (
    PAIR
    + """
isomatch.write_mesh("source.ply", source)
isomatch.write_mesh("target.ply", target)
from isomatch.cli import main
assert main(["match", "source.ply", "target.ply", "-o", "out"]) == 0
"""
)


def recorded(program, folder):
    """Lines of all loops that a program compiles where nothing is in the cache."""
    env = os.environ | {"NUMBA_CACHE_DIR": str(Path(folder, "cache")), "ISOMATCH_NUM_THREADS": "1"}
    run = subprocess.run(
        [sys.executable, "-c", RECORDING + program], cwd=folder, env=env, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stderr
    return [line.removeprefix("LOOP ") for line in run.stderr.splitlines() if line.startswith("LOOP ")]


if __name__ == "__main__":
    known = {}
    for section, program in {"match": MATCH, "files": FILES}.items():
        with tempfile.TemporaryDirectory() as folder:
            for line in recorded(program, folder):
                known.setdefault(line, section)
    LIST.write_text(HEAD + "".join(f"{section} {line}\n" for line, section in known.items()))
