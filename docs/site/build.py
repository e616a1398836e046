"""Builds the documentation site: lays the repository's Markdown out, executes notebooks that were not, and runs Sphinx.

    python docs/site/build.py OUT [--notebooks DIR] [--rust DIR] [--mathjax FILE]

Links between pages stay as they are in the repository. A link to a source file leads to a page with the file; one that leads nowhere
is an error, as every warning of Sphinx is.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# A link of Markdown that is no address: what stands in brackets, the path, an anchor.
LINK = re.compile(r"(?<=\]\()(?![a-z]+:)([^)#\s]+)(#[^)\s]*)?(?=\))")
LANGUAGES = {".rs": "rust", ".py": "python", ".toml": "toml", ".ts": "typescript", ".tsx": "typescript", ".h": "c", ".c": "c",
             ".json": "json", ".sh": "bash", "": "bash"}
# Folders of what is built.
BUILT = {"target", "node_modules", "__pycache__", "dist"}
PICTURES = {".png", ".svg", ".jpg"}


def tracked() -> list[str]:
    """The files of the repository, new ones among them; of a copy without its history all that were not built."""
    words = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode == 0 and listed.stdout:
        return [file for file in listed.stdout.splitlines() if (ROOT / file).exists()]
    found: list[str] = []
    for folder, folders, files in os.walk(ROOT):
        folders[:] = [name for name in folders if name not in BUILT and not name.startswith(".")]
        found += [str((Path(folder) / name).relative_to(ROOT)) for name in files]
    return found


class Layout:
    """The pages as Sphinx reads them, in the folders of the repository."""

    def __init__(self, source: Path) -> None:
        self.source = source
        self.files = set(tracked())
        self.folders = {str(parent) for file in self.files for parent in Path(file).parents if str(parent) != "."}
        self.problems: list[str] = []

    def write(self, name: str, text: str) -> None:
        """A page."""
        path = self.source / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)

    def page(self, name: str, text: str) -> None:
        """A page of the repository, its links leading to pages of the site."""
        def led(match: re.Match[str]) -> str:
            path, anchor = match.group(1), match.group(2) or ""
            return self.target(name, path) + anchor

        parts = re.split(r"(```.*?```|`[^`\n]*`)", text, flags=re.DOTALL)
        self.write(name, "".join(part if part.startswith("`") else LINK.sub(led, part) for part in parts))

    def target(self, page: str, path: str) -> str:
        """Where a link of a page leads, from that page."""
        place = os.path.normpath(os.path.join(os.path.dirname(page), path))
        suffix = Path(place).suffix
        if place in self.files:
            if suffix in PICTURES:
                (self.source / place).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(ROOT / place, self.source / place)
                return path
            if suffix == ".md":
                return path
            if place.startswith("docs/notebooks/"):
                return re.sub(r"\.py$", ".ipynb", path)
            self.source_page(place)
            return f"{path}.md"
        if place in self.folders:
            self.folder_page(place)
            return f"{path.rstrip('/')}/files.md"
        if place == "LICENSE" or place.startswith("LICENSE-"):
            self.source_page(place)
            return f"{path}.md"
        self.problems.append(f"{page}: ({path}) leads nowhere")
        return path

    def source_page(self, place: str) -> None:
        """A page with a source file."""
        if (self.source / f"{place}.md").exists():
            return
        language = LANGUAGES.get(Path(place).suffix, "text")
        text = (ROOT / place).read_text(errors="replace")
        fence = "`" * (3 + max((len(run) for run in re.findall(r"`{3,}", text)), default=0))
        self.write(f"{place}.md", f"---\norphan: true\n---\n# {place}\n\n{fence}{language}\n{text}\n{fence}\n")

    def folder_page(self, place: str) -> None:
        """A page that lists a folder."""
        page = f"{place}/files.md"
        if (self.source / page).exists():
            return
        inside = sorted(file for file in self.files if Path(file).parent == Path(place))
        lines = [f"- {Path(file).name}" for file in inside]
        for file in (file for file in inside if file.endswith(".md")):
            lines[inside.index(file)] = f"- [{Path(file).name}]({Path(file).name})"
        self.write(page, f"---\norphan: true\n---\n# {place}\n\n" + "\n".join(lines) + "\n")


def lay_out(layout: Layout) -> None:
    """Every page of the repository."""
    for name in sorted(layout.files):
        if name.endswith(".md") and not name.startswith(("docs/site/", "fuzz/")):
            text = (ROOT / name).read_text()
            if name == "docs/INDEX.md":
                # Eight hundred files are not worth a page each: their sentences are.
                text = re.sub(r"\[([^\]]*)\]\(\.\./[^)]*\)", r"`\1`", text)
            if name == "CHANGELOG.md" or name.startswith("docs/decisions"):
                text = text.replace("<!--", "<!-- ")
            layout.page(name, text)
    # It moves up two folders.
    start = (ROOT / "docs/site/index.md").read_text()
    layout.page("index.md", LINK.sub(lambda match: os.path.normpath(os.path.join("docs/site", match.group(1))) + (match.group(2) or ""), start))
    shutil.copytree(ROOT / "crates/python/python/northing", layout.source / "module/northing",
                    ignore=shutil.ignore_patterns("__pycache__", "*.so"))
    shutil.copyfile(ROOT / "docs/site/conf.py", layout.source / "conf.py")


def notebooks(layout: Layout, executed: Path | None) -> None:
    """The notebooks as the tests executed them, otherwise executed here."""
    import jupytext
    import nbformat
    from nbclient import NotebookClient

    for source in sorted((ROOT / "docs/notebooks").glob("*.py")):
        out = layout.source / "docs/notebooks" / f"{source.stem}.ipynb"
        out.parent.mkdir(parents=True, exist_ok=True)
        ready = executed / out.name if executed else None
        if ready and ready.exists() and ready.stat().st_mtime > source.stat().st_mtime:
            shutil.copyfile(ready, out)
            continue
        notebook, folder = jupytext.read(source), layout.source.parent / "notebooks"
        folder.mkdir(exist_ok=True)
        NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(folder)}}).execute()
        nbformat.write(notebook, out)


def rust_page(layout: Layout, out: Path, built: Path | None) -> None:
    """The page of the crates, and their documentation beside it, where it is built."""
    crates = ["northing_core", "northing_recording", "northing_simulation", "northing_evaluation", "northing_experiments",
              "northing_report", "northing_live"]
    lines = ["# The crates", "", "Made by `cargo doc`. Which crate knows what: [ARCHITECTURE](../ARCHITECTURE.md).", ""]
    for crate in crates:
        is_there = built is not None and (built / crate / "index.html").exists()
        shown = f'<a href="rust/{crate}/index.html"><code>{crate}</code></a>' if is_there else f"`{crate}`"
        lines.append(f"- {shown}")
    layout.write("api/rust.md", "\n".join(lines) + "\n")
    if built is not None:
        shutil.copytree(built, out / "api/rust", dirs_exist_ok=True, ignore=shutil.ignore_patterns("src", "*.lock"))


def main() -> int:
    """Builds the site."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("out", type=Path)
    arguments.add_argument("--notebooks", type=Path, help="notebooks that the tests have executed")
    arguments.add_argument("--rust", type=Path, help="what cargo doc has made")
    arguments.add_argument("--mathjax", type=Path, help="tex-svg.js of the package mathjax")
    given = arguments.parse_args()
    source, out = given.out.resolve() / "source", given.out.resolve() / "html"
    shutil.rmtree(source, ignore_errors=True)
    shutil.rmtree(out, ignore_errors=True)
    layout = Layout(source)
    lay_out(layout)
    notebooks(layout, given.notebooks)
    static = source / "_static"
    static.mkdir()
    if given.mathjax:
        shutil.copyfile(given.mathjax, static / "mathjax.js")
    rust_page(layout, out, given.rust)
    if layout.problems:
        print(*layout.problems, sep="\n", file=sys.stderr)
        return 1
    ran = subprocess.run([sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", source, out], check=False)
    pages = len(list(out.rglob("*.html")))
    print(f"site: {out}/index.html, {pages} pages")
    return ran.returncode


if __name__ == "__main__":
    sys.exit(main())
