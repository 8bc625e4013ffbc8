"""What other tools read of a record is the record, bit for bit, at its times, with its units."""

import json
import sys

import numpy as np
import pytest

import fullam
from fullam.cli import main
from fullam.exceptions import MissingDependency, RunFileError
from fullam.simulation.record.run import COLUMNS, Run
from fullam.simulation.record.tables import columns_of, units_of

pandas = pytest.importorskip("pandas", reason="the extra 'export' is not installed")
xarray = pytest.importorskip("xarray", reason="the extra 'export' is not installed")
pytest.importorskip("pyarrow", reason="the extra 'export' is not installed")
pytest.importorskip("mcap", reason="the extra 'export' is not installed")


@pytest.fixture(scope="module")
def run():
    data = fullam.load_scenario("task-2").to_dict() | {"duration": 0.5}
    return fullam.simulate(fullam.Scenario.from_dict(data), seed=3)


@pytest.fixture(scope="module")
def not_finite(run):
    """The record of a flight whose last row is not finite, as that of a diverged one may be."""
    columns = {name: column.copy() for name, column in run.columns.items()}
    columns["velocity"][-1, :3] = np.nan, np.inf, -np.inf
    return Run(columns, run.metadata | {"outcome": "diverged"})


def test_a_file_that_is_there_is_replaced_only_if_it_is_named(tmp_path, capsys):
    """`inspect.npz` must not replace the CSV that the motion came from."""
    run = fullam.simulate(fullam.Scenario("short", duration=0.1), calm=True)
    record, csv = tmp_path / "inspect.npz", tmp_path / "inspect.csv"
    run.save(record)
    csv.write_text("mine")
    line = ["export", str(record), "--to", "csv"]
    assert main(line) == 2
    assert "inspect.csv" in capsys.readouterr().err and csv.read_text() == "mine"
    assert main([*line, "--out", str(csv)]) == 0
    assert csv.read_text().startswith("t,pose_x")


def test_a_table_has_every_number_of_the_record(run):
    table = columns_of(run)
    assert next(iter(table)) == "t"
    assert sum(column[0].size for column in run.columns.values()) == len(table)
    np.testing.assert_array_equal(table["pose_qw"], run.pose[:, 6])
    np.testing.assert_array_equal(table["arm_joint_3"], run.arm[:, 2])
    np.testing.assert_array_equal(table["rotor_speeds_8"], run.rotor_speeds[:, 7])
    np.testing.assert_array_equal(table["command_mz"], run.command[:, 5])
    units = units_of(run)
    assert units.keys() == table.keys()
    assert (units["t"], units["pose_x"], units["pose_qw"]) == ("s", "m", "")
    assert (units["velocity_wz"], units["u_dc_fz"], units["u_dc_mx"]) == ("rad/s", "N", "N m")
    assert (units["u_pid_x"], units["arm_joint_1"], units["saturated"]) == ("m/s^2", "rad", "")


def test_pandas_has_the_times_as_index_and_says_what_was_flown(run):
    frame = run.to_pandas()
    assert frame.index.name == "t"
    np.testing.assert_array_equal(frame.index.to_numpy(), run.t)
    for name, column in columns_of(run).items():
        if name != "t":
            np.testing.assert_array_equal(frame[name].to_numpy(), column)
    assert frame["saturated"].dtype == bool
    assert frame.attrs["scenario"] == "task-2"
    assert frame.attrs["units"] == units_of(run)


def test_a_table_of_pandas_is_the_callers_own(run):
    frame = run.to_pandas()
    frame.loc[:, "pose_x"] = 0.0
    assert run.pose[0, 0] != 0.0


def test_xarray_has_units_and_names(run):
    data = run.to_xarray()
    assert set(data.data_vars) == set(COLUMNS) - {"t"}
    for name, column in run.columns.items():
        np.testing.assert_array_equal(data[name].to_numpy(), column)
        assert data[name].attrs["units"] == run.units[name]
        assert data[name].attrs["long_name"] == COLUMNS[name].meaning
    assert data["pose"].dims == ("t", "pose_component")
    assert data["arm"].dims == ("t", "joint")
    assert data["rotor_speeds"].dims == ("t", "rotor")
    np.testing.assert_array_equal(data["pose"].sel(pose_component="z"), run.pose[:, 2])
    np.testing.assert_array_equal(data["arm"].sel(joint="joint_3"), run.arm[:, 2])
    assert json.loads(data.attrs["metadata"]) == run.metadata


@pytest.mark.parametrize("kind", ["run", "not_finite"])
def test_csv_reads_back_bit_for_bit(kind, request, tmp_path):
    run = request.getfixturevalue(kind)
    path = run.to_csv(tmp_path / "a.csv")
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    table = columns_of(run)
    np.testing.assert_array_equal(rows, np.column_stack(list(table.values())))
    read = pandas.read_csv(path)
    assert list(read.columns) == list(table)
    # Some versions of pandas read the last digits wrong, unless they are told not to.
    np.testing.assert_allclose(read.to_numpy(), rows, rtol=1e-12)
    assert [p.name for p in tmp_path.iterdir()] == ["a.csv"]


@pytest.mark.parametrize("kind", ["run", "not_finite"])
def test_parquet_reads_back_bit_for_bit(kind, request, tmp_path):
    import pyarrow.parquet as pq

    run = request.getfixturevalue(kind)
    path = run.to_parquet(tmp_path / "a.parquet")
    read = pandas.read_parquet(path)
    for name, column in columns_of(run).items():
        np.testing.assert_array_equal(read[name].to_numpy(), column, err_msg=name)
        assert read[name].dtype == column.dtype
    schema = pq.read_schema(path)
    assert schema.field("pose_x").metadata[b"units"] == b"m"
    assert json.loads(schema.metadata[b"fullam-run"]) == run.metadata


@pytest.mark.parametrize("kind", ["run", "not_finite"])
def test_mcap_holds_every_column_at_its_times(kind, request, tmp_path):
    from mcap.reader import make_reader

    run = request.getfixturevalue(kind)
    path = run.to_mcap(tmp_path / "a.mcap")
    found: dict[str, list] = {}
    with path.open("rb") as stream:
        reader = make_reader(stream)
        for schema, channel, message in reader.iter_messages():
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            data = json.loads(message.data)
            assert data.keys() == json.loads(schema.data)["properties"].keys()
            found.setdefault(channel.topic, []).append((message.log_time, data))
        notes = {record.name: record.metadata for record in reader.iter_metadata()}
    assert notes["fullam"]["scenario"] == "task-2"
    frames = {"/frames/platform", "/frames/estimate", "/frames/reference"}
    assert found.keys() == {f"/{name}" for name in COLUMNS if name != "t"} | frames
    table = columns_of(run)
    for topic, messages in found.items():
        # Times are whole nanoseconds.
        np.testing.assert_allclose([t * 1e-9 for t, _ in messages], run.t, rtol=0.0, atol=1e-9)
        if topic in frames:
            continue
        for name in messages[0][1]:
            column = table[topic[1:] if name == "value" else f"{topic[1:]}_{name}"]
            values = np.array([np.nan if m[name] is None else m[name] for _, m in messages])
            expected = np.where(np.isfinite(column), column, np.nan)
            np.testing.assert_array_equal(values, expected, err_msg=f"{topic} {name}")
    time, frame = found["/frames/platform"][-1]
    assert frame["timestamp"] == {"sec": time // 10**9, "nsec": time % 10**9}
    assert [frame["translation"][k] for k in "xyz"] == run.pose[-1, :3].tolist()
    assert [frame["rotation"][k] for k in "xyzw"] == run.pose[-1, 3:].tolist()


@pytest.mark.parametrize("to", ["mcap", "csv", "parquet"])
def test_the_command_writes_beside_the_record_or_where_it_is_told(run, tmp_path, capsys, to):
    record = run.save(tmp_path / "a.npz")
    assert main(["export", str(record), "--to", to]) == 0
    assert (tmp_path / f"a.{to}").stat().st_size > 1000
    out = tmp_path / "sub" / f"b.{to}"
    assert main(["export", str(record), "--to", to, "--out", str(out)]) == 0
    assert out.exists() and str(out) in capsys.readouterr().out
    assert main(["export", str(record), "--to", to, "--out", str(tmp_path / "b.txt")]) == 2
    assert f"does not end in .{to}" in capsys.readouterr().err
    assert main(["export", str(tmp_path / "none.npz"), "--to", to]) == 2


def test_another_suffix_is_refused_and_nothing_is_written(run, tmp_path):
    for write in (run.to_csv, run.to_parquet, run.to_mcap):
        with pytest.raises(RunFileError, match="does not end in"):
            write(tmp_path / "a.txt")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("package", "call"),
    [
        ("pandas", lambda run, folder: run.to_pandas()),
        ("xarray", lambda run, folder: run.to_xarray()),
        ("pyarrow", lambda run, folder: run.to_parquet(folder / "a.parquet")),
        ("mcap.writer", lambda run, folder: run.to_mcap(folder / "a.mcap")),
    ],
)
def test_a_missing_library_is_an_error_that_names_the_extra(
    run, tmp_path, monkeypatch, package, call
):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingDependency, match=r"fullam\[export\]"):
        call(run, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_slide_is_in_metres():
    """The unit of a prismatic joint's column is its own."""
    from fullam.simulation.record.tables import _units

    assert _units("m, rad", ("slide", "turn")) == ("m", "rad")
    assert _units("rad", ("a", "b")) == ("rad", "rad")
    assert _units("", ()) == ("",)
