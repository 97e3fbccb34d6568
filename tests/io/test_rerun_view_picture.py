"""What a person would see, judged by its structure: whose arm is where. Needs a Vulkan driver; software will do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import rerun
from people import SKELETON, answer
from PIL import Image

from arm_ik_service.errors import ViewError
from arm_ik_service.io.rerun_view import write_picture, write_recording

pytestmark = pytest.mark.slow

Mask = npt.NDArray[np.bool_]


def write(recording: Path, picture: Path, frame: int | None = None) -> None:
    try:
        write_picture(recording, picture, frame=frame, width=1200, height=700)
    except ViewError as error:
        if "Vulkan" in str(error):
            pytest.skip(str(error))
        raise


def sleeves(picture: Path) -> tuple[Mask, Mask]:
    """Where the 3D view of a picture shows the left sleeve, which is blue, and the right one, which is orange."""
    image = np.asarray(Image.open(picture).convert("RGB"), float)
    red, green, blue = np.moveaxis(image[: int(0.85 * image.shape[0]), : image.shape[1] // 2], -1, 0)
    left = (blue > 1.6 * red) & (blue > 1.2 * green) & (blue > 60)
    right = (red > 2.2 * blue) & (red > 1.3 * green) & (green > 0.35 * red) & (red > 60)
    return left, right


def centre(mask: Mask) -> tuple[float, float]:
    """Right and down, in parts of the view."""
    rows, columns = np.nonzero(mask)
    assert len(rows) > 500, "the sleeve is not to be seen"
    return float(columns.mean()) / mask.shape[1], float(rows.mean()) / mask.shape[0]


def test_a_person_faces_us_upright_and_the_arm_that_is_raised_is_raised_in_the_picture(tmp_path: Path) -> None:
    recording, picture = tmp_path / "view.rrd", tmp_path / "view.png"
    write_recording(recording, [answer(0, lifts=(0.3, 0.3)), answer(1, lifts=(0.3, 2.4))], SKELETON)
    write(recording, picture, 0)
    left, right = sleeves(picture)
    write(recording, picture, 1)
    left_after, right_after = sleeves(picture)
    assert centre(left)[0] > centre(right)[0] + 0.1, "facing us, the left arm is at our right"
    assert centre(right_after)[1] < centre(right)[1] - 0.15, "the raised arm is higher"
    assert np.allclose(centre(left_after), centre(left), atol=0.01), "the other one stays"


def test_a_picture_is_of_the_last_frame_unless_another_is_asked_for(tmp_path: Path) -> None:
    recording, last, named = tmp_path / "view.rrd", tmp_path / "last.png", tmp_path / "named.png"
    write_recording(recording, [answer(seq, lifts=(0.2 + 0.05 * seq, 0.2)) for seq in range(40)], SKELETON)
    write(recording, last)
    write(recording, named, 39)
    assert centre(sleeves(last)[0]) == pytest.approx(centre(sleeves(named)[0]), abs=1e-3)


def test_a_recording_that_is_missing_or_is_not_ours_is_a_view_error(tmp_path: Path) -> None:
    with pytest.raises(ViewError, match="No such file"):
        write_picture(tmp_path / "none.rrd", tmp_path / "a.png")
    foreign = tmp_path / "foreign.rrd"
    with rerun.RecordingStream("foreign") as stream:
        stream.save(foreign)
        stream.log("a", rerun.Scalars(1.0))
    other = tmp_path / "other.rrd"
    other.write_text("RIFF")
    with pytest.raises(ViewError, match="no Rerun recording"):
        write_picture(other, tmp_path / "a.png")
    with pytest.raises(ViewError, match="not written by this view"):
        write(foreign, tmp_path / "a.png")
