"""The documentation site builds without a warning, and no link of it leads nowhere."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import REPOSITORY

# Side by side with others, but one after the other: the site shows the notebooks.
pytestmark = pytest.mark.xdist_group("notebooks")

BUILD = REPOSITORY / "docs/site/build.py"


def test_the_site_builds_and_its_links_lead_somewhere(tmp_path: Path) -> None:
    """With the notebooks as the tests executed them, if they did."""
    executed = os.environ.get("NORTHING_NOTEBOOKS")
    words = [sys.executable, str(BUILD), str(tmp_path), *(["--notebooks", executed] if executed else [])]
    ran = subprocess.run(words, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    html = tmp_path / "html"
    start = (html / "index.html").read_text()
    for page in ("docs/start/student", "docs/websocket", "docs/notebooks/mekf_from_scratch", "api/python/northing/index"):
        assert f'href="{page}.html"' in start and (html / f"{page}.html").exists(), page
    api = (html / "api/python/northing/index.html").read_text()
    assert all(f'id="northing.{name}"' in api for name in ("attitude", "GnssIns", "SchmidtKalman", "montecarlo", "Estimator"))
    notebook = (html / "docs/notebooks/mekf_from_scratch.html").read_text()
    assert "<img" in notebook, "no picture"


def test_a_link_that_leads_nowhere_is_told(tmp_path: Path) -> None:
    sys.path.insert(0, str(BUILD.parent))
    try:
        from build import Layout
    finally:
        sys.path.pop(0)
    layout = Layout(tmp_path)
    layout.page("docs/x.md", "[a](python.md) [b](nowhere.md) `[c](none.md)` [d](https://example.org) [e](../crates/core)")
    assert layout.problems == ["docs/x.md: (nowhere.md) leads nowhere"]
