from isomatch.collections.agreement import Agreement, agree, agreement_of
from isomatch.collections.cohort import Misfit, misfits
from isomatch.collections.collection import Collection
from isomatch.collections.consistency import CONTRADICTED, inconsistency
from isomatch.collections.export import export
from isomatch.collections.finish import finish, surfaces_written
from isomatch.collections.kept import KEPT, changed_files, keep_files, require_unchanged
from isomatch.collections.landmark_sheet import draw_landmarks
from isomatch.collections.landmarks import LeftOut, collected_landmarks, landmarks_left_out
from isomatch.collections.layout import Layout
from isomatch.collections.ledger import Rows
from isomatch.collections.map_file import PairMaps
from isomatch.collections.mirror_images import mirror_images
from isomatch.collections.reports import write_reports
from isomatch.collections.run import Event
from isomatch.collections.shapes import Entry
from isomatch.collections.states import state_of
from isomatch.collections.tables import write_table
from isomatch.collections.units import scales_of

__all__ = [
    "CONTRADICTED",
    "KEPT",
    "Agreement",
    "Collection",
    "Entry",
    "Event",
    "Layout",
    "LeftOut",
    "Misfit",
    "PairMaps",
    "Rows",
    "agree",
    "agreement_of",
    "changed_files",
    "collected_landmarks",
    "draw_landmarks",
    "export",
    "finish",
    "inconsistency",
    "keep_files",
    "landmarks_left_out",
    "mirror_images",
    "misfits",
    "require_unchanged",
    "scales_of",
    "state_of",
    "surfaces_written",
    "write_reports",
    "write_table",
]
