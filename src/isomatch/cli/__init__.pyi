from isomatch.cli.outputs import say_notes
from isomatch.cli.program import app, main
from isomatch.cli.terminal import TALK, Talk, part, say

__all__ = ["TALK", "Talk", "app", "main", "part", "say", "say_notes"]
