from isomatch.collections.added import added
from isomatch.collections.agreement import Agreement, agree, agreement_of, inconsistency
from isomatch.collections.cohort import Outlier, mirror_images, outliers, scales_of
from isomatch.collections.collection import Collection
from isomatch.collections.contacts import contacts_kept
from isomatch.collections.finish import export, finish, surface_as_written, surfaces_written
from isomatch.collections.landmarks import LeftOut, collected_landmarks, draw_landmarks, landmarks_left_out
from isomatch.collections.ledger import CONTRADICTED, Rows, state_of
from isomatch.collections.map_file import KEPT, PairMaps, changed_files, keep_files, require_unchanged
from isomatch.collections.page import write_reports, write_table
from isomatch.collections.plan import Layout
from isomatch.collections.run import Event
from isomatch.collections.shapes import Entry, entries_of
from isomatch.collections.subjects import (
    finish_subjects,
    structures_of,
    subject_collections,
    subject_doubts,
)
from isomatch.collections.workers import Workers, workers_of

__all__ = [
    "CONTRADICTED",
    "KEPT",
    "Agreement",
    "Collection",
    "Entry",
    "Event",
    "Layout",
    "LeftOut",
    "Outlier",
    "PairMaps",
    "Rows",
    "Workers",
    "added",
    "agree",
    "agreement_of",
    "changed_files",
    "collected_landmarks",
    "contacts_kept",
    "draw_landmarks",
    "entries_of",
    "export",
    "finish",
    "finish_subjects",
    "inconsistency",
    "keep_files",
    "landmarks_left_out",
    "mirror_images",
    "outliers",
    "require_unchanged",
    "scales_of",
    "state_of",
    "structures_of",
    "subject_collections",
    "subject_doubts",
    "surface_as_written",
    "surfaces_written",
    "workers_of",
    "write_reports",
    "write_table",
]
