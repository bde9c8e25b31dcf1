from isomatch.collections.collection import Collection, Event, state_of
from isomatch.collections.finish import finish
from isomatch.collections.layout import Layout
from isomatch.collections.ledger import Rows
from isomatch.collections.map_file import PairMaps
from isomatch.collections.shapes import Entry
from isomatch.collections.tables import write_table

__all__ = ["Collection", "Entry", "Event", "Layout", "PairMaps", "Rows", "finish", "state_of", "write_table"]
