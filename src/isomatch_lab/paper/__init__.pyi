from isomatch_lab.paper.item import Item, Reproduction, Setting, Verdict
from isomatch_lab.paper.reproduce import ITEMS, reproduce

__all__ = ["ITEMS", "Item", "Reproduction", "Setting", "Verdict", "reproduce"]
