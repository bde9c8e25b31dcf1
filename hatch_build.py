"""The readme of the package: README.md with links that lead somewhere outside the repository too."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

LINK = re.compile(r"(!?)\[([^\]]*)\]\((?!\w+:|#)([^)\s]+)\)")


class Readme(MetadataHookInterface):
    """Fills in ``readme``, which is dynamic."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Add the readme of this version."""
        text = Path(self.root, "README.md").read_text(encoding="utf-8")
        source = metadata.get("urls", {}).get("Source")
        readme = with_whole_links(text, source, metadata["version"])
        metadata["readme"] = {"content-type": "text/markdown", "text": readme}


def with_whole_links(text: str, source: str | None, version: str) -> str:
    """Make links to files of the repository lead to those of a version; without an address only their text is left."""

    def whole(link: re.Match[str]) -> str:
        picture, label, path = link.groups()
        if source is None:
            return "" if picture else label
        return f"{picture}[{label}]({source}/{'raw' if picture else 'blob'}/v{version}/{path})"

    return LINK.sub(whole, text)
