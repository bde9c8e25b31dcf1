from isomatch.serving.app import PageServer, app_of, require_server
from isomatch.serving.guard import Guard
from isomatch.serving.job import Job
from isomatch.serving.session import Keeper, Pairs, Session

__all__ = ["Guard", "Job", "Keeper", "PageServer", "Pairs", "Session", "app_of", "require_server"]
