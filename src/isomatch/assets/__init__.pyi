from isomatch.assets.asset import Asset
from isomatch.assets.files import read_asset, write_asset

__all__ = ["Asset", "read_asset", "write_asset"]
