"""The book builds without a warning, its code runs, and it needs no network."""

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlparse

import nbformat
import pytest
from fullam_book import code_blocks, schemas
from fullam_book.cells import as_page
from fullam_book.executed import NOTEBOOKS, executed
from fullam_book.tables import of_maker

import fullam
from fullam.exceptions import FullamError
from fullam.model import definition_keys as keys
from fullam.model.composition import compose
from fullam.model.loading import read_urdf
from fullam.simulation.motions import arm_motion, references
from fullam.simulation.motions.references import from_dict
from fullam.simulation.world import surfaces as world
from fullam.viz.viewer.browser import Browser, chromium_path

ROOT = Path(__file__).parents[1]
SITE = ROOT / "out" / "docs"
PAGES = sorted((ROOT / "notebooks" / "book" / "pages").rglob("*.md"))


# The code in it.


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_from_top_to_bottom(notebook):
    cells = [cell for cell in executed(notebook).cells if cell.cell_type == "code"]
    assert all(cell.execution_count for cell in cells)
    # A warning on stderr is something the reader would have to be told about.
    said = [out.text for cell in cells for out in cell.outputs if out.get("name") == "stderr"]
    # That machine code is compiled is told once on each machine.
    lines = [line for text in said for line in text.splitlines()]
    assert [line for line in lines if not line.startswith("compiling ")] == []


def test_a_page_tells_what_a_notebook_printed_and_not_that_code_was_compiled(tmp_path):
    content = nbformat.read(NOTEBOOKS[0], as_version=4)
    cell = next(cell for cell in content.cells if cell.cell_type == "code")
    streams = {"stderr": "compiling a law; this happens once\n", "stdout": "flown\n"}
    cell.outputs = [nbformat.v4.new_output("stream", name=n, text=t) for n, t in streams.items()]
    page = nbformat.writes(as_page(content, NOTEBOOKS[0], tmp_path, "views"))
    assert "flown" in page
    assert "compiling" not in page


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_the_code_of_a_page_runs(page, tmp_path):
    """In a process of its own: a reader's laws are registered there and nowhere else."""
    command = [sys.executable, code_blocks.__file__, str(page)]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    ran = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout[-2000:] + ran.stderr[-4000:]


def test_code_that_nobody_runs_is_refused():
    with pytest.raises(ValueError, match="'rust'"):
        code_blocks.blocks("```rust\nfn main() {}\n```\n")
    with pytest.raises(ValueError, match="'fulam'"):
        _ = code_blocks.blocks("```sh\nfulam run\n```\n")[0].commands


# Its tables: a reader that is given a key that it does not know lists those that it knows.


def refusal(read, *arguments):
    with pytest.raises(FullamError) as caught:
        read(*arguments)
    return set(re.split(r": |it has |some of ", str(caught.value))[-1].split(", "))


def readers():
    """Heading in the book, and what the reader of that table says that it knows."""
    vehicle = fullam.load_vehicle("fullam")

    def load(**changes):
        definition = vehicle.definition | changes
        read_urdf(definition, Path(vehicle.source))
        return fullam.Vehicle.from_definition(definition, vehicle.urdf)

    defaults = vehicle.definition["rotor_defaults"] | {"?": 1}
    rotor = {"?": 1}
    joints = {"joints": vehicle.definition["arm"], "urdf": "fullam.urdf", "mount": {}}
    design = vehicle.definition["design"] | {"?": 1}
    from_table = fullam.VehicleDesign.from_table
    scenario, settings = fullam.Scenario.from_dict, fullam.SimulationSettings.from_dict
    table = {"name": "x"}
    yield "vehicle", "The file", lambda: load(**{"?": 1})
    yield "vehicle", "`urdf`", lambda: load(urdf={"path": "fullam.urdf", "?": 1})
    yield "vehicle", "`[arm]`", lambda: load(arm=joints | {"?": 1})
    yield (
        "vehicle",
        "`[arm.mount]`",
        lambda: compose(vehicle.urdf, vehicle.urdf, {"mount": {"?": 1}}, vehicle.platform, "x"),
    )
    yield "vehicle", "`[rotor_defaults]`", lambda: load(rotor_defaults=defaults)
    yield "vehicle", "`[[rotor]]`", lambda: load(rotor=[rotor])
    yield "vehicle", "`[servo]`", lambda: load(servo={"?": 1})
    yield "vehicle", "`[[body]]`", lambda: load(body=[{"?": 1}])
    yield "vehicle", "`[design]`", lambda: from_table(design)
    yield "scenario", "The file", lambda: scenario(table | {"?": 1})
    for kind in world.KINDS:
        yield (
            "scenario",
            f'`[[world]]`, `kind = "{kind}"`',
            lambda kind=kind: scenario(table | {"world": [{"kind": kind, "?": 1}]}),
        )
    yield "scenario", "`[[payloads]]`", lambda: scenario(table | {"payloads": [{"?": 1}]})
    yield "scenario", "`[tool]`", lambda: scenario(table | {"tool": {"?": 1}})
    yield (
        "scenario",
        "`[weather.sensors]`",
        lambda: scenario(table | {"weather": {"sensors": {"?": 1}}}),
    )
    for field, kinds in (("reference", references.KINDS), ("arm_motion", arm_motion.KINDS)):
        maker = getattr(
            fullam, "Trajectory" if field == "reference" else "JointTrajectory"
        ).from_csv
        yield (
            "scenario",
            f'`[{field}]`, `kind = "csv"`',
            lambda field=field, maker=maker: from_dict(
                {"csv": maker}, field, {"kind": "csv", "?": 1}
            ),
        )
        for kind in sorted(k for k in kinds if of_maker(kinds[k])):  # some have no further keys
            yield (
                "scenario",
                f'`[{field}]`, `kind = "{kind}"`',
                lambda field=field, kind=kind: scenario(table | {field: {"kind": kind, "?": 1}}),
            )
    yield "scenario", "`[weather]`", lambda: scenario(table | {"weather": {"?": 1}})
    yield (
        "scenario",
        "`[weather.uncertainty]`",
        lambda: scenario(table | {"weather": {"uncertainty": {"?": 1}}}),
    )
    yield "scenario", "`[shaping]`", lambda: scenario(table | {"shaping": {"?": 1}})
    yield "scenario", "Simulation settings", lambda: settings({"?": 1})
    yield "scenario", "Governor", lambda: settings({"governor": {"?": 1}})


def shown_keys(page, heading):
    """The keys in the first table below a heading."""
    section = re.split(r"^#+ ", page, flags=re.MULTILINE)
    found = next(s for s in section if s.startswith(heading + "\n"))
    return set(re.findall(r"^\| `(\w+)` \|", found, re.MULTILINE))


PARTS = list(readers())


@pytest.mark.parametrize(("file", "heading", "read"), PARTS, ids=[f"{p[0]} {p[1]}" for p in PARTS])
def test_every_key_that_a_reader_knows_is_in_the_book_and_none_more(file, heading, read):
    page = schemas.pages()[f"reference/{file}_toml"]
    known = {re.findall(r"[\w-]+", key)[-1] for key in refusal(read)}
    assert shown_keys(page, heading) == known


def test_every_key_of_a_vehicle_has_a_meaning_and_every_number_a_unit():
    tables = (keys.VEHICLE, keys.URDF, keys.ARM, keys.MOUNT, keys.ROTOR, keys.SERVO, keys.BODY)
    for key in (key for table in tables for key in table):
        assert key.meaning.endswith("."), key
        assert key.unit or key.kind not in ("number", "table of numbers"), key


# The site.


@pytest.fixture(scope="module")
def site():
    """The book as `make docs` builds it; what is there already and has not changed stays."""
    command = [sys.executable, str(ROOT / "notebooks" / "book" / "build.py")]
    built = subprocess.run(command, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr[-4000:]
    return SITE


class Addresses(HTMLParser):
    """What a page loads, where it leads to, and the places that it has."""

    def __init__(self, page):
        super().__init__()
        self.loads, self.leads, self.places = [], [], set()
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        named = dict(attributes)
        self.places |= {named.get("id"), named.get("name")}
        self.loads += [named[k] for k in ("src", "data-view") if named.get(k)]
        if named.get("href"):
            is_link = tag == "a" or (
                tag == "link" and named.get("rel") not in ("stylesheet", "icon")
            )
            (self.leads if is_link else self.loads).append(named["href"])


@pytest.fixture(scope="module")
def pages(site):
    return {page: Addresses(page) for page in site.rglob("*.html") if page.parent.name != "views"}


def test_no_page_loads_anything_from_elsewhere(pages):
    assert len(pages) > 100
    for page, found in pages.items():
        for address in found.loads:
            if not address.startswith(("data:", "#")):
                assert "//" not in address, (page, address)
                target = (page.parent / unquote(address.partition("?")[0])).resolve()
                assert target.is_file(), (page, address)


def test_every_link_within_leads_somewhere(pages):
    places = {page.resolve(): found.places for page, found in pages.items()}
    for page, found in pages.items():
        for address in found.leads:
            if re.match(r"\w+:", address):
                continue
            path, _, place = unquote(address).partition("#")
            target = (page.parent / path).resolve() if path else page.resolve()
            assert target.is_file(), (page, address)
            if place and target in places:
                assert place in places[target], (page, address)


def test_every_module_has_a_page_and_every_public_name_a_place(pages):
    of = {page.relative_to(SITE).as_posix(): found.places for page, found in pages.items()}
    everywhere = set().union(*of.values())
    for name in fullam.__all__:
        if not name.startswith("__"):
            target = getattr(fullam, name)
            assert f"{target.__module__}.{target.__qualname__}" in everywhere, name
    for module in (ROOT / "fullam").rglob("*.py"):
        parts = module.relative_to(ROOT).with_suffix("").parts
        if parts[1] not in ("cli", "__main__") and parts[-1] != "__init__":
            assert f"api/{'.'.join(parts)}.html" in of, module


LOOKED_AT = (
    "index.html", "quickstart.html", "howto/vehicle.html", "notebooks/03_position_and_tilt.html",
    "reference/vehicle_toml.html", "reference/equations.html", "reference/commands.html",
    "api/index.html", "api/fullam.control.dc_pid.html",
)  # fmt: skip


@pytest.fixture(scope="module")
def browser():
    if chromium_path() is None:
        yield None  # the tests that use it are skipped by their mark
        return
    with Browser(1300, 900, network=False) as opened:
        yield opened


def show(browser, page, query=""):
    browser.command("Page.navigate", url=page.resolve().as_uri() + query)
    browser.wait_for("document.readyState === 'complete'")


@pytest.mark.browser
@pytest.mark.parametrize("page", LOOKED_AT)
def test_a_page_is_whole_without_a_network_and_fits_its_window(site, browser, page):
    browser.complaints.clear()
    show(browser, site / page)
    assert browser.evaluate("[...document.images].every(i => i.complete && i.naturalWidth)")
    assert browser.evaluate("document.documentElement.scrollWidth") <= 1300
    browser.resize(420, 900)
    assert browser.evaluate("document.documentElement.scrollWidth") <= 420  # a telephone
    browser.resize(1300, 900)
    assert browser.complaints == []


@pytest.mark.browser
def test_search_finds_from_a_file(site, browser):
    browser.complaints.clear()
    show(browser, site / "search.html", "?q=anti_windup")
    # Results come in one by one.
    found = "document.querySelector('#search-results').innerText"
    browser.wait_for(f"{found}.includes('Controllers') && {found}.includes('tracking')")
    assert browser.complaints == []


@pytest.mark.browser
def test_a_still_opens_its_view(site, browser):
    browser.complaints.clear()
    show(browser, site / "notebooks" / "01_vehicle_and_equations.html")
    browser.evaluate("document.querySelector('button.view').click()")
    view = browser.evaluate("document.querySelector('iframe.view').src")
    show(browser, Path(unquote(urlparse(view).path)))
    assert browser.evaluate("document.querySelector('canvas, svg') !== null")
    assert browser.complaints == []
