"""The table: a row a state, every number as published, its unit in the name of its column."""

from __future__ import annotations

import csv
from pathlib import Path

import pyarrow.parquet
from postures import HANGING, RAISED, motion, person

from arm_ik_service.exports.table import ROWS, SCHEMA, TableWriter
from arm_ik_service.wire.messages import ArmsState


def write(path: Path, states: list[ArmsState]) -> Path:
    writer = TableWriter(path)
    for state in states:
        writer.add(state)
    writer.close()
    return path


def test_csv_read_with_the_standard_library_is_the_published_state(tmp_path: Path) -> None:
    states = motion(20)
    with write(tmp_path / "arms.csv", states).open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 20
    for state, row in zip(states, rows, strict=True):
        assert int(row["sample_time_ns"]) == state.sample_time_ns
        assert row["avatar"] == "ann"
        assert float(row["right_elbow_flexion_rad"]) == state.right.angles.elbow_flexion
        assert float(row["left_pronation_rad_s"]) == state.left.angle_rates.pronation
        assert float(row["left_hand_z_m"]) == state.left.bones.hand.position[2]
        assert float(row["right_upper_arm_qw"]) == state.right.bones.upper_arm.orientation[3]
        assert row["left_tracking"] == "tracked"
        assert row["right_limits"] == "elbow_flexion"


def test_parquet_holds_the_same_as_csv_and_says_what_its_axes_are(tmp_path: Path) -> None:
    states = motion(30)
    table = pyarrow.parquet.read_table(write(tmp_path / "arms.parquet", states))
    assert table.num_rows == 30
    assert table["right_shoulder_abduction_rad"].to_pylist() == [s.right.angles.shoulder_abduction for s in states]
    assert b"y up" in table.schema.metadata[b"axes"]
    with write(tmp_path / "arms.csv", states).open(newline="") as file:
        header = next(csv.reader(file))
    assert header == table.column_names


def test_every_number_has_its_unit_in_its_name_or_is_none() -> None:
    units = ("_m", "_rad", "_rad_s", "_ns", "_ratio", "_confidence", "_iterations", "_qx", "_qy", "_qz", "_qw", "seq")
    for field in SCHEMA:
        assert str(field.type) == "string" or field.name.endswith(units), field.name


def test_a_raised_right_arm_is_up_and_on_the_right(tmp_path: Path) -> None:
    row = pyarrow.parquet.read_table(write(tmp_path / "raised.parquet", [person(HANGING, RAISED)])).to_pylist()[0]
    assert row["right_hand_x_m"] > 0.1
    assert row["right_hand_y_m"] > 1.8
    assert row["left_hand_y_m"] < 1.0


def test_more_rows_than_a_block_come_in_order(tmp_path: Path) -> None:
    state = person()
    writer = TableWriter(tmp_path / "long.parquet")
    import msgspec

    for seq in range(ROWS + 10):
        writer.add(msgspec.structs.replace(state, seq=seq))
    writer.close()
    file = pyarrow.parquet.ParquetFile(tmp_path / "long.parquet")
    assert file.num_row_groups == 2
    assert file.read()["seq"].to_pylist() == list(range(ROWS + 10))
