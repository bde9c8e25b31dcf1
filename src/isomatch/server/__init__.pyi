from isomatch.server.app import PageServer, require_server
from isomatch.server.session import Keeper, Pairs, Session

__all__ = ["Keeper", "PageServer", "Pairs", "Session", "require_server"]
