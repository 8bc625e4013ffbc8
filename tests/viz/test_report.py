"""The whole report on short flights: complete, self-contained, judged as the rows say."""

import re
from dataclasses import replace
from html import escape

import pytest

pytest.importorskip("pyarrow", reason="the extra 'campaign' is not installed")

from fullam.analysis import recorded, reproduce
from fullam.analysis.claims import CLAIMS, SCENARIOS, TARGETS, Proof
from fullam.analysis.diagnosis import Finding
from fullam.analysis.evidence import judge
from fullam.analysis.lost import LostFlight
from fullam.analysis.recorded import PUBLISHED, READINGS
from fullam.analysis.reproduce import CONDITIONS, command
from fullam.simulation.scenarios.scenario import load_scenario
from fullam.viz import report_lost
from fullam.viz.report import write_report
from fullam.viz.report_tables import number


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """(folder, result): flights of 1.2 s, and the recorded figures in the place of ours."""
    folder = tmp_path_factory.mktemp("report")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            reproduce, "load_scenario", lambda name: replace(load_scenario(name), duration=1.2)
        )
        patch.setattr(recorded, "compare", lambda task, *_: (PUBLISHED[task.name], []))
        result = reproduce.reproduce(folder, runs=2, driver="fused")
        # What was flown is kept: a second call flies nothing and says the same.
        patch.setattr(reproduce.Campaign, "fly", None)
        again = reproduce.reproduce(folder, runs=2, driver="fused")
    # As text, because a difference without a single complete pair is NaN.
    assert repr(again.findings) == repr(result.findings)
    write_report(result, folder)
    return folder, result


def test_flights_beside_the_recorded_ones_are_flown_once(tmp_path, monkeypatch):
    flown, told = [], []

    def fly(task, reading, seed):
        if len(flown) == 7:
            raise KeyboardInterrupt
        flown.append(seed)
        return PUBLISHED[task.name]

    monkeypatch.setattr(recorded, "fly", fly)
    path = tmp_path / "recorded.journal"
    with pytest.raises(KeyboardInterrupt):
        reproduce._compare_recorded(path, 2, lambda *_: None)
    monkeypatch.setattr(
        recorded, "fly", lambda task, reading, seed: told.append(seed) or PUBLISHED[task.name]
    )
    rows = reproduce._compare_recorded(path, 2, lambda *_: None)
    assert len(told) == 2 * 2 * len(READINGS) - 7
    assert [row.ours[READINGS[0]] for row in rows] == [PUBLISHED["hover"], PUBLISHED["step"]]


def test_every_claim_is_judged_for_every_contender_in_both_weathers(flown):
    _, result = flown
    labels = [entry.contender.label for entry in result.judged]
    assert len(labels) == 2
    for claim in (*CLAIMS, *TARGETS):
        if not isinstance(claim.test, Proof):
            for label in labels:
                for condition in CONDITIONS:
                    assert (claim.key, label, condition.key) in result.findings


def test_a_verdict_on_the_page_is_the_one_of_the_rows(flown):
    folder, result = flown
    claim = CLAIMS[0]
    label = result.judged[0].contender.label
    finding = judge(claim, result.tables["paper"], label, {})
    assert result.findings[claim.key, label, "paper"] == finding
    page = (folder / "index.html").read_text(encoding="utf-8")
    row = page[page.index(claim.says, page.index('id="claims"')) :]
    first = re.search(r'class="chip (\w+)"', row)
    assert first is not None
    assert first.group(1) == finding.verdict


def test_the_page_stands_alone(flown):
    folder, _ = flown
    page = (folder / "index.html").read_text(encoding="utf-8")
    for attribute in re.findall(r'(?:src|href)="([^"]*)"', page):
        assert attribute.startswith(("data:", "#")), attribute
    assert "<script" not in page
    assert "@import" not in page
    assert "url(" not in page
    for anchor in re.findall(r'href="#([^"]*)"', page):
        assert f'id="{anchor}"' in page


def test_every_claim_and_target_is_on_the_page_with_its_command(flown):
    folder, result = flown
    page = (folder / "index.html").read_text(encoding="utf-8")
    for claim in (*CLAIMS, *TARGETS):
        assert escape(claim.says) in page
        assert escape(command(claim, result.judged[0], CONDITIONS[0], 2)) in page


def test_every_figure_is_a_file_in_two_formats(flown):
    folder, _ = flown
    names = {path.stem for path in (folder / "figures").glob("*.svg")}
    assert names == {path.stem for path in (folder / "figures").glob("*.png")}
    for number_ in (3, 4, 5, 6, 7, 9):
        assert any(name.startswith(f"fig{number_}-") for name in names)


def test_the_rows_lie_beside_the_page(flown):
    folder, result = flown
    files = list((folder / "data").glob("*.parquet"))
    assert len(files) == 2 * len(CONDITIONS)
    assert len(result.tables["paper"]) == len(SCENARIOS) * len(result.entries) * 2
    assert len({str(c) for c in result.tables["paper"].column("contender")}) == 3


def test_a_handful_of_seeds_is_called_a_quick_look(flown):
    folder, _ = flown
    assert "A quick look" in (folder / "index.html").read_text(encoding="utf-8")


def test_the_recorded_runs_stand_beside_every_reading(flown):
    _, result = flown
    for row in result.recorded:
        assert set(row.ours) == set(READINGS)
        assert row.published is PUBLISHED[row.task.name]


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (1.234, "s", "1.23"),
        (-12.34, "mm", "−12.3"),
        (0.0123, "deg", "0.012"),
        (123.4, "mm", "123"),
        (-0.0001, "mm", "−1e−04"),
        (0.0, "mm", "0"),
        (float("inf"), "s", "never"),
        (float("nan"), "s", "–"),
    ],
)
def test_numbers_have_three_digits(value, unit, text):
    assert number(value, unit) == text


def test_lost_flights_are_explained_on_the_page(flown, monkeypatch):
    """Short flights are not lost; were they, the page would say which and why."""
    folder, result = flown
    page = (folder / "index.html").read_text(encoding="utf-8")
    assert '<h2 id="lost">Flights that were lost, or swing</h2><p>None.</p>' in page
    finding = Finding("saturation", "rotors <at> their bounds", "less")
    flight = LostFlight("task-1", "dc-pid", 7, "at t = 1 s", (finding,))
    swinging = replace(flight, seed=8, reason="x swings by 200 mm at 1.00 Hz")

    def found(table, most, outcomes):
        return (3, [flight]) if "diverged" in outcomes else (2, [swinging])

    monkeypatch.setattr(report_lost, "lost_flights", found)
    section = report_lost.lost_section(result)
    assert "<b>3 of " in section and "were lost" in section
    assert "<b>2 of " in section and "seed 8: x swings by 200 mm" in section
    assert "dc-pid, task-1, seed 7: at t = 1 s" in section
    assert "rotors &lt;at&gt; their bounds: less" in section
