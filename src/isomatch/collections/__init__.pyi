from isomatch.collections.collection import Collection, Event, state_of
from isomatch.collections.layout import Layout
from isomatch.collections.ledger import Rows
from isomatch.collections.map_file import PairMaps
from isomatch.collections.shapes import Entry

__all__ = ["Collection", "Entry", "Event", "Layout", "PairMaps", "Rows", "state_of"]
