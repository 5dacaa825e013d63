import numpy as np
import pytest

from nat2024.datasets import load_dataset, write_sequence
from nat2024.datasets.writing import encode_image
from nat2024.errors import ArrayContract, UsageError


@pytest.mark.parametrize("extension", [".png", ".bmp"])
def test_what_is_written_is_loaded(tmp_path, make, extension):
    images = [make.image(seed) for seed in range(3)]
    boxes = [np.array([1.25, 2, 3, 4]) + i for i in range(3)]
    file = write_sequence(tmp_path / "d", "a", zip(images, boxes, strict=True), extension)
    assert file == tmp_path / "d" / "anno" / "a.txt"
    sequence = load_dataset(tmp_path / "d")["a"]
    np.testing.assert_array_equal(sequence.boxes, boxes)
    for index, image in enumerate(images):
        assert (sequence.image(index) == image).all()


def test_nothing_is_overwritten_and_names_stay_inside(tmp_path, make):
    frame = (make.image(), np.array([1.0, 2, 3, 4]))
    write_sequence(tmp_path, "a", [frame])
    with pytest.raises(UsageError, match="there already"):
        write_sequence(tmp_path, "a", [frame])
    for name in ("../a", "a/b", "", ".hidden", ".."):
        with pytest.raises(UsageError, match="plain file name"):
            write_sequence(tmp_path, name, [frame])
    with pytest.raises(UsageError, match="no frame"):
        write_sequence(tmp_path, "b", [])
    with pytest.raises(UsageError, match="extension"):
        write_sequence(tmp_path, "e", [frame], ".txt")
    with pytest.raises(ArrayContract):
        write_sequence(tmp_path, "c", [(np.zeros((3, 3)), frame[1])])


@pytest.mark.parametrize("extension", [".png", ".bmp", ".JPG"])
def test_only_jpeg_has_a_quality(make, extension, capfd):
    fine, coarse = (encode_image(make.image(), extension, quality) for quality in (95, 5))
    assert (len(coarse) < len(fine)) == (extension == ".JPG")
    assert capfd.readouterr().err == ""  # OpenCV warns of an option of another kind of file
