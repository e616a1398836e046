"""The pages of docs/start and docs/websocket.md: what they tell people to type runs, and what they name is there."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

import northing as no
from conftest import REPOSITORY, free_port, run_program

START = REPOSITORY / "docs/start"
WEBSOCKET = REPOSITORY / "docs/websocket.md"


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(), flags=re.DOTALL)


@pytest.mark.parametrize("name", ["python_researcher", "tracking_researcher"])
def test_the_snippets_run(name: str, tmp_path: Path) -> None:
    code = "\n".join(blocks(START / f"{name}.md", "python"))
    ran = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert code and ran.returncode == 0, ran.stderr
    assert ran.stdout


@pytest.mark.parametrize("name", ["student", "teacher"])
def test_the_commands_run(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All but the lab, which goes on until somebody ends it."""
    monkeypatch.chdir(tmp_path)
    template = REPOSITORY / "examples/estimators/mine.py"
    (tmp_path / "examples/estimators").mkdir(parents=True)
    for place in ("mine.py", "examples/estimators/mine.py"):
        shutil.copyfile(template, tmp_path / place)
    lines = [line[2:] for block in blocks(START / f"{name}.md", "console") for line in block.splitlines() if line.startswith("$ ")]
    commands = [shlex.split(line, comments=True) for line in lines]
    commands = [words for words in commands if words[:2] != ["northing", "live"]]
    assert len(commands) >= 2
    for program, *words in commands:
        assert program == "northing"
        run_program(*words)


def test_twelve_lines_read_the_lab() -> None:
    (code,) = blocks(WEBSOCKET, "python")
    assert len(code.splitlines()) <= 12
    port = free_port()
    lab = no.live("--port", str(port), "--local", "--no-open", "--no-recording")
    try:
        code = "import time\n" + code.replace("127.0.0.1:7770", f"127.0.0.1:{port}")
        with subprocess.Popen([sys.executable, "-u", "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as reader:
            limit = threading.Timer(60.0, reader.kill)
            limit.start()
            try:
                found = enough(reader.stdout or iter(()))
            finally:
                limit.cancel()
                reader.kill()
            assert found, reader.stderr.read() if reader.stderr else ""
    finally:
        lab.terminate()
        assert lab.wait(timeout=30) is not None


def enough(lines: Iterator[str]) -> bool:
    """Whether angles and lamps were printed, a second of them."""
    angles, lamps = 0, 0
    for line in lines:
        angles += bool(re.search(r"\d+\.\d\d s \S+ \[[-.\d]+, [-.\de]+, [-.\de]+\] ", line))
        lamps += line.startswith("[('")
        if angles > 30 and lamps > 10:
            return True
    return False


@pytest.mark.parametrize("kind", ["Request", "ToPage"])
def test_the_page_of_the_websocket_has_every_message(kind: str) -> None:
    text = (REPOSITORY / "web/lab/messages.ts").read_text()
    declared = re.search(rf"^export type {kind} = (.*?);\n\n", text, flags=re.DOTALL | re.MULTILINE)
    assert declared
    told = set(re.findall(r'"type": "(\w+)"', declared.group(1)))
    heading = {"Request": "What can be asked for", "ToPage": "What the lab tells"}[kind]
    section = WEBSOCKET.read_text().split(f"## {heading}\n")[1].split("\n## ")[0]
    cells = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    named = {word for cell in cells for word in re.findall(r"`(\w+)`", cell)}
    assert named - {"type"} == told
