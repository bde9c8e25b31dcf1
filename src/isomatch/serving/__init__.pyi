from isomatch.serving.app import PageServer, require_server
from isomatch.serving.session import Keeper, Pairs, Session

__all__ = ["Keeper", "PageServer", "Pairs", "Session", "require_server"]
