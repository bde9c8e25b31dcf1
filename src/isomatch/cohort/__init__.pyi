from isomatch.cohort import shape_statistics as shape_statistics
from isomatch.cohort.asymmetry import asymmetry
from isomatch.cohort.collection import Collection
from isomatch.cohort.combine import Agreement, agree, agreement_of, inconsistency
from isomatch.cohort.finish import export, finish, surfaces_written
from isomatch.cohort.jobs import Event
from isomatch.cohort.landmarks import (
    LandmarkTables,
    Semilandmarks,
    collected_landmarks,
    write_landmark_tables,
)
from isomatch.cohort.ledger import (
    CONTRADICTED,
    MapRecord,
    MapSummary,
    PairAgreement,
    PairRow,
    Rows,
    ShapeRow,
    SurfaceRow,
)
from isomatch.cohort.map_file import PairMaps
from isomatch.cohort.mode_view import write_modes
from isomatch.cohort.plan import Entry, Layout
from isomatch.cohort.run import Cohort, Reports, Status, reconcile, run
from isomatch.cohort.scoring import add, complete_file, project
from isomatch.cohort.statistics import series, statistics
from isomatch.cohort.statistics_folder import Results
from isomatch.cohort.study_page import write_reports
from isomatch.cohort.subjects import Gap
from isomatch.cohort.unusual_shapes import Outlier, outliers
from isomatch.cohort.workers import Workers

__all__ = [
    "CONTRADICTED",
    "Agreement",
    "Cohort",
    "Collection",
    "Entry",
    "Event",
    "Gap",
    "LandmarkTables",
    "Layout",
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
    "Status",
    "SurfaceRow",
    "Workers",
    "add",
    "agree",
    "agreement_of",
    "asymmetry",
    "collected_landmarks",
    "complete_file",
    "export",
    "finish",
    "inconsistency",
    "outliers",
    "project",
    "reconcile",
    "run",
    "series",
    "shape_statistics",
    "statistics",
    "surfaces_written",
    "write_landmark_tables",
    "write_modes",
    "write_reports",
]
