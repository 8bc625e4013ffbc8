"""Every notebook runs from top to bottom without a display, and what is committed is light."""

import json
import re
from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")

FOLDER = Path(__file__).resolve().parents[1] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))

LONGEST = 60.0
"""No notebook may keep its reader waiting longer than this [s]."""

HEAVIEST = 150_000
"""Size of a committed notebook with its pictures [bytes]."""


def test_the_seven_notebooks_are_there():
    assert [path.stem[:2] for path in NOTEBOOKS] == ["01", "02", "03", "04", "05", "06", "07"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_runs_from_top_to_bottom(path, tmp_path, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path))
    notebook = nbformat.read(path, as_version=4)
    client = nbclient.NotebookClient(
        notebook,
        kernel_name="python3",
        timeout=LONGEST,
        resources={"metadata": {"path": str(tmp_path)}},
    )
    client.execute()
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert all(cell.execution_count for cell in code)
    # A warning on stderr is something the reader would have to be told about.
    said = [out.text for cell in code for out in cell.outputs if out.get("name") == "stderr"]
    assert said == []


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
