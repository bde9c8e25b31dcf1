from isomatch.cohort import shape_statistics as shape_statistics
from isomatch.cohort.add import Added, add, added
from isomatch.cohort.asymmetry import AsymmetryStudy, asymmetry
from isomatch.cohort.collection import Collection
from isomatch.cohort.combine import Agreement, agree, agreement_of, inconsistency
from isomatch.cohort.completion import complete_file
from isomatch.cohort.contacts import Gap, contacts_kept
from isomatch.cohort.entries import Entry, entries_of
from isomatch.cohort.finish import export, finish, surface_as_written, surfaces_written
from isomatch.cohort.jobs import Event
from isomatch.cohort.landmark_tables import (
    LandmarkTables,
    LeftOutError,
    Semilandmarks,
    Slid,
    write_landmark_tables,
)
from isomatch.cohort.landmarks import LeftOut, collected_landmarks, draw_landmarks, landmarks_left_out
from isomatch.cohort.listener import Warn
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
from isomatch.cohort.run import Cohort, Reports, reconcile, run
from isomatch.cohort.scoring import project
from isomatch.cohort.series import series
from isomatch.cohort.specimens import Specimens, read_groups, read_specimens
from isomatch.cohort.statistics import ShapeStudy, statistics
from isomatch.cohort.statistics_folder import Results
from isomatch.cohort.status import Status, status_of
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
    "Added",
    "Agreement",
    "AsymmetryStudy",
    "Cohort",
    "Collection",
    "Entry",
    "Event",
    "Gap",
    "LandmarkTables",
    "Layout",
    "LeftOut",
    "LeftOutError",
    "MapRecord",
    "MapSummary",
    "Outlier",
    "PairAgreement",
    "PairMaps",
    "PairRow",
    "Reports",
    "Results",
    "Rows",
    "Semilandmarks",
    "ShapeRow",
    "ShapeStudy",
    "Slid",
    "Specimens",
    "Status",
    "SurfaceRow",
    "Warn",
    "Workers",
    "add",
    "added",
    "agree",
    "agreement_of",
    "asymmetry",
    "changed_files",
    "collected_landmarks",
    "complete_file",
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
    "project",
    "read_groups",
    "read_specimens",
    "reconcile",
    "require_unchanged",
    "run",
    "scales_of",
    "series",
    "shape_statistics",
    "statistics",
    "status_of",
    "structures_of",
    "subject_collections",
    "subject_doubts",
    "surface_as_written",
    "surfaces_written",
    "workers_of",
    "write_landmark_tables",
    "write_reports",
    "write_table",
]
