from isomatch.cohort import shape_statistics as shape_statistics
from isomatch.cohort.add import added
from isomatch.cohort.collection import Collection
from isomatch.cohort.combine import Agreement, agree, agreement_of, inconsistency
from isomatch.cohort.contacts import Gap, contacts_kept
from isomatch.cohort.entries import Entry, entries_of
from isomatch.cohort.finish import export, finish, surface_as_written, surfaces_written
from isomatch.cohort.jobs import Event
from isomatch.cohort.landmarks import LeftOut, collected_landmarks, draw_landmarks, landmarks_left_out
from isomatch.cohort.map_file import KEPT, PairMaps, changed_files, keep_files, require_unchanged
from isomatch.cohort.outliers import Outlier, mirror_images, outliers, scales_of
from isomatch.cohort.plan import Layout
from isomatch.cohort.report import write_reports, write_table
from isomatch.cohort.rows import (
    CONTRADICTED,
    MapRecord,
    MapSummary,
    PairAgreement,
    PairRow,
    Rows,
    ShapeRow,
    SurfaceRow,
)
from isomatch.cohort.subjects import (
    finish_subjects,
    structures_of,
    subject_collections,
    subject_doubts,
)
from isomatch.cohort.workers import Workers, workers_of

__all__ = [
    "CONTRADICTED",
    "KEPT",
    "Agreement",
    "Collection",
    "Entry",
    "Event",
    "Gap",
    "Layout",
    "LeftOut",
    "MapRecord",
    "MapSummary",
    "Outlier",
    "PairAgreement",
    "PairMaps",
    "PairRow",
    "Rows",
    "ShapeRow",
    "SurfaceRow",
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
    "shape_statistics",
    "structures_of",
    "subject_collections",
    "subject_doubts",
    "surface_as_written",
    "surfaces_written",
    "workers_of",
    "write_reports",
    "write_table",
]
