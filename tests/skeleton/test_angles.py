import numpy as np
import pytest

from handpipe.core.errors import InputError
from handpipe.skeleton.joints.angles import check_angles, read_angles, write_angles

LIMITS = {"MP2_flexion": tuple(np.radians([-20, 90])), "MP2_abduction": tuple(np.radians([-20, 20]))}
HEADER = "frame,MP2_flexion [deg],MP2_abduction [deg]\n"


def test_round_trip(tmp_path):
    frames = {
        "a": {"MP2_flexion": 0.3, "MP2_abduction": -0.1},
        "b": {"MP2_flexion": 1.0, "MP2_abduction": 0.2},
    }
    write_angles(tmp_path / "f.csv", frames)
    assert (
        (tmp_path / "f.csv")
        .read_text(encoding="utf-8")
        .startswith("frame,MP2_flexion [deg],MP2_abduction [deg]\na,17.18")
    )
    found = read_angles(tmp_path / "f.csv", LIMITS)
    assert list(found) == ["a", "b"]
    for name, angles in frames.items():
        assert found[name] == pytest.approx(angles, abs=1e-14)


def test_columns_may_stand_in_any_order_and_limits_belong(tmp_path):
    path = tmp_path / "f.csv"
    path.write_text("frame, MP2_abduction [deg], MP2_flexion [deg]\nx, -20, 90\n\n")
    assert read_angles(path, LIMITS)["x"] == pytest.approx(
        {"MP2_flexion": np.pi / 2, "MP2_abduction": -np.pi / 9}
    )


def test_an_angle_without_a_column_is_zero(tmp_path):
    path = tmp_path / "f.csv"
    path.write_text("frame,MP2_flexion [deg]\nx,45\n")
    assert read_angles(path, LIMITS) == {"x": pytest.approx({"MP2_flexion": np.pi / 4, "MP2_abduction": 0.0})}
    with pytest.raises(InputError, match="0 deg is outside its limits of 5 to 20 deg"):
        read_angles(path, LIMITS | {"MP2_abduction": tuple(np.radians([5, 20]))})


@pytest.mark.parametrize(
    ("text", "field", "problem"),
    [
        ("", "header", "frame"),
        ("time,MP2_flexion [deg]\n", "header", "frame"),
        ("frame,MP2_flexion,MP2_abduction [deg]\n", "MP2_flexion", "unit"),
        (HEADER.replace("abduction", "twist") + "x,1,2\n", "MP2_twist", "not an angle"),
        ("frame,MP2_flexion [deg],MP2_flexion [deg],MP2_abduction [deg]\n", "MP2_flexion", "twice"),
        (HEADER + "x,1,2\ny,1\n", "row 3", "2 cells"),
        (HEADER + "x,1,2\nx,1,3\n", "row 3, frame", "another frame"),
        (HEADER + "x,one,2\n", "row 2 (frame x), MP2_flexion", "'one' is not a number"),
        (HEADER, "rows", "there are none"),
        (HEADER.replace("[deg]", "[rad]") + "x,1,2\n", "MP2_flexion [rad]", "is in 'rad', not in degrees"),
        (HEADER + "\n\nx,,2\n", "row 4 (frame x), MP2_flexion", "'' is not a number"),
        (HEADER + "x,1_0,2\n", "row 2 (frame x), MP2_flexion", "'1_0' is not a number"),
        (HEADER + 'x,"1,5",2\n', "row 2 (frame x), MP2_flexion", "'1,5' is not a number"),
        (HEADER.replace(",", ";") + "x;1.234,5;2\n", "row 2 (frame x), MP2_flexion", "'1.234,5' is not"),
        (HEADER + "x,-inf,2\n", "row 2 (frame x), MP2_flexion", "finite"),
        (HEADER + "x,1,2,\n", "row 2", "4 cells"),
        (HEADER + '"x\ny",1,2\n', "row 3, frame", "cannot be printed"),
        (HEADER + "x,1,nan\n", "row 2 (frame x), MP2_abduction", "finite"),
        (
            HEADER + "x,1,2\ny,90.5,0\n",
            "row 3 (frame y), MP2_flexion",
            "90.5 deg is outside its limits of -20 to 90",
        ),
    ],
)
def test_errors_say_where_and_what(tmp_path, text, field, problem):
    path = tmp_path / "frames.csv"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        read_angles(path, LIMITS)
    assert error.value.source == str(path)
    assert field in error.value.field
    assert problem in error.value.problem


@pytest.mark.parametrize(
    "text",
    [
        HEADER.replace(",", ";") + "x;12,5;-3\ny;1.5;0\n",
        HEADER.replace(",", "\t") + "x\t12,5\t-3\ny\t1,5\t0\n",
        "\ufeff" + (HEADER + "x,12.5,-3\ny,1.5,0\n").replace("\n", "\r\n"),
        '"frame","MP2_flexion [deg]","MP2_abduction [deg]"\n"x","1.25e1","-3"\n"y","1.5","0"',
        "frame ; MP2_abduction [deg] ; MP2_flexion [deg]\n\n x ; -3,0 ; 12,5 \n;;\ny;0;1,5\n",
    ],
    ids=["semicolons", "tabs", "windows", "quoted", "blanks"],
)
def test_dialects_of_spreadsheets_are_read(tmp_path, text):
    path = tmp_path / "f.csv"
    path.write_bytes(text.encode("utf-8"))
    found = {
        f: {n: np.degrees(a) for n, a in angles.items()} for f, angles in read_angles(path, LIMITS).items()
    }
    assert [*found] == ["x", "y"]
    assert found["x"] == pytest.approx({"MP2_flexion": 12.5, "MP2_abduction": -3.0})
    assert found["y"] == pytest.approx({"MP2_flexion": 1.5, "MP2_abduction": 0.0})


@pytest.mark.parametrize("content", [b"\xff\xfef\x00r\x00", HEADER.encode("latin-1") + b"F\xe4ust,1,2\n"])
def test_other_encodings_are_refused(tmp_path, content):
    (tmp_path / "f.csv").write_bytes(content)
    with pytest.raises(InputError, match="UTF-8"):
        read_angles(tmp_path / "f.csv", LIMITS)


def test_missing_file():
    with pytest.raises(InputError, match="does not exist"):
        read_angles("nowhere.csv", LIMITS)


def test_unknown_and_missing_angles():
    with pytest.raises(InputError, match="PIP2_flexion"):
        check_angles({"MP2_flexion": 0, "MP2_abduction": 0, "PIP2_flexion": 0}, LIMITS, "here")
    with pytest.raises(InputError, match="MP2_abduction: is missing"):
        check_angles({"MP2_flexion": 0}, LIMITS, "here")
