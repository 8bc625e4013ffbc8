"""What a store has been given it keeps, and what it reads is what was written."""

import sys
import time
from dataclasses import replace

import pytest

pytest.importorskip("pyarrow", reason="the extra 'campaign' is not installed")

import pyarrow as pa
import pyarrow.parquet as pq

import fullam
from fullam.analysis import campaign_store
from fullam.analysis.campaign import Campaign, sweep
from fullam.analysis.campaign_store import CampaignStore
from fullam.analysis.campaign_table import DIGEST, METADATA, read_campaign
from fullam.exceptions import CampaignError, MissingDependency
from fullam.simulation.scenarios.scenario import load_scenario

BRIEF = replace(load_scenario("position-1"), name="brief", duration=0.1)


@pytest.fixture(scope="module")
def campaign():
    return Campaign((BRIEF,), ("pid",), (0, 1, 2), traces=True)


@pytest.fixture(scope="module")
def written(campaign, tmp_path_factory):
    path = tmp_path_factory.mktemp("store") / "rows.parquet"
    return path, sweep(campaign, path)


@pytest.mark.parametrize("moment", ["table_of", "atomic_path"])
def test_an_interrupt_while_rows_are_written_loses_none(campaign, tmp_path, monkeypatch, moment):
    """Ctrl-C may come inside `flush`, which is then called again on the way out."""
    out = tmp_path / "rows.parquet"

    def interrupted(*_):
        monkeypatch.undo()
        raise KeyboardInterrupt

    with (
        pytest.raises(KeyboardInterrupt),
        campaign_store.open_store(out, campaign.identity(), overwrite=False) as store,
    ):
        for cells in campaign.fly(campaign.keys):
            store._buffer.append(cells)
        monkeypatch.setattr(campaign_store, moment, interrupted)
        store.flush()
    assert CampaignStore(out, campaign.identity(), False).keys == set(campaign.keys)


def test_rows_do_not_wait_for_the_next_ones(campaign, tmp_path):
    out = tmp_path / "rows.parquet"
    with campaign_store.open_store(out, campaign.identity(), overwrite=False) as store:
        store.append(next(iter(campaign.fly(campaign.keys))))
        end = time.monotonic() + 10.0
        while not list(store.parts.glob("part-*")) and time.monotonic() < end:
            time.sleep(0.01)
        assert len(CampaignStore(out, campaign.identity(), False).keys) > 0


def test_rows_that_cannot_be_written_end_the_campaign(campaign, tmp_path, monkeypatch):
    out, fly = tmp_path / "rows.parquet", Campaign.fly

    def full(*_):
        raise OSError(28, "No space left on device")

    def slowly(self, keys, *threads):
        for key in keys:
            time.sleep(campaign_store.FLUSH)
            yield from fly(self, [key], *threads)

    monkeypatch.setattr(Campaign, "fly", slowly)
    monkeypatch.setattr(campaign_store, "atomic_path", full)
    told = []
    with pytest.raises(OSError, match="No space left"):
        sweep(replace(campaign, seeds=range(10)), out, progress=lambda done, _: told.append(done))
    assert max(told) < 5


def rewritten(path, rows):
    """The file with other rows under the same stamp."""
    pq.write_table(rows.replace_schema_metadata(pq.read_schema(path).metadata), path)
    return path


DAMAGE = {
    "a number": lambda t: t.set_column(
        t.column_names.index("rms_position_mm"),
        "rms_position_mm",
        pa.array([0.0, *t.column("rms_position_mm").to_pylist()[1:]]),
    ),
    "a seed": lambda t: t.set_column(4, "seed", pa.array([7, 1, 2])),
    "a trace": lambda t: t.set_column(
        t.num_columns - 1, t.schema.field("trace"), pa.array([[0.0]] * 3, t.schema.types[-1])
    ),
    "a row less": lambda t: t.slice(1),
    "rows in another order": lambda t: t.take([1, 0, 2]),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_changed_row_is_noticed(written, tmp_path, damage):
    path = tmp_path / "rows.parquet"
    path.write_bytes(written[0].read_bytes())
    assert read_campaign(path).rows.equals(written[1].rows)
    rewritten(path, DAMAGE[damage](pq.read_table(path)))
    with pytest.raises(CampaignError, match="digest"):
        read_campaign(path)


def test_a_changed_stamp_is_noticed(written, tmp_path):
    rows, path = pq.read_table(written[0]), tmp_path / "rows.parquet"
    metadata = rows.schema.metadata
    for changed in (
        {METADATA: metadata[METADATA].replace(b'"duration":0.1', b'"duration":0.2')},
        {DIGEST: b"0" * 32},
    ):
        pq.write_table(rows.replace_schema_metadata(metadata | changed), path)
        with pytest.raises(CampaignError, match="digest"):
            read_campaign(path)
    pq.write_table(rows.replace_schema_metadata({METADATA: metadata[METADATA]}), path)
    with pytest.raises(CampaignError, match="digest"):
        read_campaign(path)


def test_columns_stand_in_their_order_and_once(written, tmp_path):
    rows, path = pq.read_table(written[0]), tmp_path / "rows.parquet"
    names = rows.column_names
    swapped = rows.select([names[1], names[0], *names[2:]])
    doubled = rows.append_column("seed", rows.column("seed"))
    for other in (swapped, doubled):
        pq.write_table(other, path)
        with pytest.raises(CampaignError, match="twice, or in another order"):
            read_campaign(path)


def test_the_rows_open_in_pandas_in_one_call(written):
    pandas = pytest.importorskip("pandas", reason="the extra 'export' is not installed")
    path, table = written
    direct, own = pandas.read_parquet(path), fullam.read_campaign(path).to_pandas()
    assert len(direct) == len(own) == len(table) == 3
    for name in ("outcome", "seed", "contender", "rms_position_mm", "z_rms_mm"):
        assert direct[name].tolist() == own[name].tolist() == table.column(name).tolist()
    assert [len(trace) for trace in own["trace"]] == [6 * len(t) for t in table.traces()]
    assert "3 flights (1 scenarios x 1 contenders): 3 completed" in repr(table)


def test_rows_without_traces_have_no_empty_column_of_them(tmp_path):
    pytest.importorskip("pandas", reason="the extra 'export' is not installed")
    table = sweep(Campaign((BRIEF,), ("pid",), (0,)), tmp_path / "rows.parquet")
    assert "trace" not in table.to_pandas()
    assert "trace" in table.rows.column_names


def test_without_pandas_the_message_names_the_extra(written, monkeypatch):
    _, table = written
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingDependency, match=r"fullam\[export\]"):
        table.to_pandas()
