"""What is committed of the notebooks is light; `test_book` runs them."""

import json
import re
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))

HEAVIEST = 150_000
"""Size of a committed notebook with its pictures [bytes]."""


def test_the_eight_notebooks_are_there():
    assert [path.stem[:2] for path in NOTEBOOKS] == [f"{k:02d}" for k in range(1, 9)]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_what_is_committed_is_light_and_tells_of_no_machine(path):
    text = path.read_text(encoding="utf-8")
    assert len(text) < HEAVIEST
    notebook = json.loads(text)
    ids = [cell["id"] for cell in notebook["cells"]]
    assert len(set(ids)) == len(ids) and all(i.startswith(f"n{path.stem[:2]}-") for i in ids)
    said = json.dumps([cell.get("outputs", []) for cell in notebook["cells"]])
    assert not re.search(r"/(tmp|work|home|root|Users)/", said)
    assert '"output_type": "error"' not in said


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_links_lead_somewhere(path):
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "markdown":
            for target in re.findall(r"\]\(([^)]+)\)", "".join(cell["source"])):
                assert target.startswith("https://") or (FOLDER / target).is_file(), target
