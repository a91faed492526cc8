"""pilotfish frames, calibrate and markers: poses of objects from the images of a camera."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from pilotfish.cli.options.execution import FILE
from pilotfish.cli.output.results import (
    CommandResult,
    example_epilog,
    print_result,
    require_finite_option,
    require_writable_file,
)
from pilotfish.cli.output.tables import Table, key_value_table
from pilotfish.cli.output.terminal import print_note, progress_bar
from pilotfish.cli.stream.signals import SIGNAL_EXIT_OFFSET, catch_signals
from pilotfish.errors import InvalidInput
from pilotfish.io import path_exists

if TYPE_CHECKING:
    from pilotfish.vision import Calibration, CalibrationBoard, FrameTrack, FrameTracker, ImageSource

MAX_CALIBRATION_VIEWS = 60
POSITIVE = click.FloatRange(min=0.0, min_open=True)
FORCE = click.option("--force", is_flag=True, help="Replace existing files.")


def source_options(command: Any) -> Any:
    """Add --every, --period and --duration to a command."""
    options = (
        click.option(
            "--every",
            type=click.IntRange(1, 10**6),
            default=1,
            show_default=True,
            help="Take every nth image.",
        ),
        click.option(
            "--period",
            type=POSITIVE,
            callback=require_finite_option,
            help="Time between two images [s]; a folder of images needs it.  [default: that of the video]",
        ),
        click.option(
            "--duration",
            type=POSITIVE,
            callback=require_finite_option,
            default=10.0,
            show_default=True,
            help="Time for which a camera is read [s].",
        ),
    )
    for option in reversed(options):
        command = option(command)
    return command


@click.command(
    epilog=example_epilog(
        "pilotfish frames valve.mp4 --markers markers.toml --out frames.csv",
        "pilotfish frames 0 --markers markers.toml --duration 5 --out frames.csv",
    )
)
@click.argument("source", metavar="VIDEO|FOLDER|CAMERA")
@click.option("--markers", type=FILE, required=True, help="File of markers and camera, markers.toml.")
@click.option("--out", type=FILE, required=True, help="Table of poses to write, as CSV.")
@click.option("--picture", type=FILE, help="Image to write, as .png, with the axes of the frames.")
@source_options
@click.option(
    "--max-error",
    type=POSITIVE,
    callback=require_finite_option,
    default=2.0,
    show_default=True,
    help="Largest reprojection error of an accepted pose [pixels].",
)
@click.option(
    "--max-speed",
    type=POSITIVE,
    callback=require_finite_option,
    default=2.0,
    show_default=True,
    help="Largest plausible speed of a frame [m/s]; a faster move is rejected as a jump.",
)
@FORCE
@print_result
def frames(
    source: str,
    markers: Path,
    out: Path,
    picture: Path | None,
    max_error: float,
    max_speed: float,
    **options: Any,
) -> CommandResult:
    """Estimate the poses of the frames in the images of a video, a folder, or a camera given by its number.

    Each row of the table is the raw estimate of one image. Where a frame is not visible its cells are empty.
    After Ctrl-C the rows so far are written.
    """
    from pilotfish.vision import (
        FrameTracker,
        TrackerSettings,
        frame_tracks,
        open_images,
        read_markers,
        write_frames,
    )

    require_writable_file(out, picture, force=options["force"], inputs=_inputs(source, markers))
    tracker = FrameTracker(read_markers(markers), TrackerSettings(max_error, max_speed))
    images = open_images(source, **{key: options[key] for key in ("every", "period", "duration")})
    times, observations, drawn, signal = _track(tracker, images, picture)
    if not times:
        raise InvalidInput(f"{images.name} gave no image before it was stopped; nothing is written")
    tracks = frame_tracks(times, observations)
    write_frames(out, tracks, overwrite=options["force"])
    if picture is not None:
        _write_picture(picture, drawn, options["force"])
    if signal:
        print_note(f"stopped after {len(times)} images; their rows are written")
    result = _summary(tracks, out)
    return CommandResult(result.blocks, result.data, SIGNAL_EXIT_OFFSET + signal if signal else 0)


def _inputs(source: str, *others: Path) -> tuple[Path, ...]:
    return (*others, Path(source)) if path_exists(source) else others


def _track(
    tracker: "FrameTracker", images: "ImageSource", picture: Path | None
) -> tuple[list[float], list[Any], Any, int]:
    """Return times and observations of the images, a picture, and the signal that stopped them or 0."""
    times: list[float] = []
    observations: list[Any] = []
    drawn, most = None, -1
    with catch_signals() as stop_signal, progress_bar(images.count or 0, "images") as advance:
        for time, image in images.images:
            observed = tracker.observe(image, time)
            times.append(time)
            observations.append(observed)
            visible = sum(each.pose is not None for each in observed.values())
            if picture is not None and visible > most:
                drawn, most = tracker.draw(image, observed), visible
            advance(f"{time:.2f} s, {visible} of {len(observed)} frames")
            if stop_signal():
                return times, observations, drawn, stop_signal()
    return times, observations, drawn, 0


def _write_picture(path: Path, drawn: Any, overwrite: bool) -> None:
    from pilotfish.vision import write_picture

    write_picture(path, drawn, overwrite=overwrite)


def _summary(tracks: "Sequence[FrameTrack]", out: Path) -> CommandResult:
    rows, notes = [], []
    for track in tracks:
        found = float(np.mean(track.visible))
        error = float(np.median(track.errors[track.visible])) if track.visible.any() else None
        gaps = track.gaps
        longest = max((last - first for first, last in gaps), default=0.0)
        rows.append(
            (
                track.name,
                f"{100 * found:.1f} %",
                "-" if error is None else f"{error:.2f}",
                str(len(gaps)),
                f"{longest:.2f}",
                str(track.ambiguous),
                ", ".join(f"{count} {reason}" for reason, count in track.rejections.items()) or "none",
            )
        )
        if not track.visible.any():
            notes.append(f"frame {track.name!r} was never visible; check the ids and sides of its markers")
    header = ("frame", "found", "error [px]", "gaps", "longest [s]", "ambiguous", "images without a pose")
    data = {
        "file": str(out),
        "images": len(tracks[0].times),
        "frames": {track.name: _track_to_json(track) for track in tracks},
    }
    count = f"{len(tracks[0].times)} images, {tracks[0].times[-1]:.2f} s; written to {out}"
    return CommandResult([Table(header, tuple(rows)), *notes, count], data)


def _track_to_json(track: "FrameTrack") -> dict[str, Any]:
    errors = track.errors[track.visible]
    return {
        "found": float(np.mean(track.visible)),
        "median_error": float(np.median(errors)) if len(errors) else None,
        "gaps": [list(gap) for gap in track.gaps],
        "ambiguous": track.ambiguous,
        "rejections": track.rejections,
    }


def parse_board(_: click.Context, parameter: click.Parameter, text: str) -> tuple[int, int]:
    """Return the columns and rows of a text such as 9x6, or raise click.BadParameter."""
    if not (match := re.fullmatch(r"([0-9]{1,3})x([0-9]{1,3})", text)):
        raise click.BadParameter(f"{text!r} is not COLUMNSxROWS, such as 9x6", param=parameter)
    return int(match[1]), int(match[2])


@click.command(
    epilog=example_epilog("pilotfish calibrate views/ --board 9x6 --square 0.025 --out camera.toml")
)
@click.argument("source", metavar="VIDEO|FOLDER|CAMERA")
@click.option(
    "--board",
    required=True,
    callback=parse_board,
    help="Inner corners of the chessboard as COLUMNSxROWS; squares of a ChArUco board.",
)
@click.option(
    "--square", type=POSITIVE, required=True, callback=require_finite_option, help="Side of a square [m]."
)
@click.option(
    "--charuco",
    type=(float, str),
    default=None,
    help="Side of a marker [m] and dictionary of a ChArUco board.",
)
@click.option("--out", type=FILE, required=True, help="Calibration to write, camera.toml.")
@source_options
@FORCE
@print_result
def calibrate(
    source: str,
    board: tuple[int, int],
    square: float,
    charuco: tuple[float, str] | None,
    out: Path,
    force: bool,
    **options: Any,
) -> CommandResult:
    """Calibrate a camera from images of a chessboard or of a ChArUco board.

    The board must be tilted in different directions; views that do not determine the camera are refused.
    """
    from pilotfish.vision import CalibrationBoard, calibrate_camera, open_images, write_camera

    require_writable_file(out, force=force, inputs=_inputs(source))
    model = CalibrationBoard(*board, square, *(charuco or ()))
    period = options["period"] or 1.0 if _is_folder(source) else options["period"]
    images = open_images(source, every=options["every"], period=period, duration=options["duration"])
    views, size, count = _find_views(images, model)
    calibration = calibrate_camera(views, *size)
    write_camera(
        out, calibration.camera, rms_error=calibration.rms_error, views=calibration.views, overwrite=force
    )
    return _calibration_result(calibration, count, out)


def _is_folder(source: str) -> bool:
    from pilotfish.io import is_folder

    return is_folder(source)


def _find_views(images: "ImageSource", board: "CalibrationBoard") -> tuple[list[Any], tuple[int, int], int]:
    """Return the views of the board, the size of the images and their number."""
    from pilotfish.vision import find_board

    views: list[Any] = []
    size, count = (0, 0), 0
    with progress_bar(images.count or 0, "images") as advance:
        for _, image in images.images:
            shape = (image.shape[1], image.shape[0])
            if count and shape != size:
                raise InvalidInput(
                    f"{images.name} has images of {size} and {shape} pixels, expected one size"
                )
            size, count = shape, count + 1
            if (view := find_board(image, board)) is not None:
                views.append(view)
            advance(f"{len(views)} views")
    step = -(-len(views) // MAX_CALIBRATION_VIEWS) or 1
    return views[::step], size, count


def _calibration_result(calibration: "Calibration", count: int, out: Path) -> CommandResult:
    camera = calibration.camera
    deviation = ", ".join(f"{value:.1f}" for value in calibration.focal_deviation)
    rows = [
        ("views", f"{calibration.views} used of {count} images"),
        ("rms error", f"{calibration.rms_error:.3f} px"),
        (
            "focal length",
            f"{camera.fx:.1f}, {camera.fy:.1f} px, standard deviations {deviation}",
        ),
        ("principal point", f"{camera.cx:.1f}, {camera.cy:.1f} px"),
        ("distortion", ", ".join(f"{value:.4g}" for value in camera.distortion)),
        ("largest tilt", f"{calibration.largest_tilt:.0f} degrees"),
        ("file", str(out)),
    ]
    data = {
        "file": str(out),
        "images": count,
        "views": calibration.views,
        "rms_error": calibration.rms_error,
        "fx": camera.fx,
        "fy": camera.fy,
        "cx": camera.cx,
        "cy": camera.cy,
        "distortion": list(camera.distortion),
        "focal_deviation": list(calibration.focal_deviation),
        "largest_tilt": calibration.largest_tilt,
    }
    return CommandResult([key_value_table(rows)], data)


def parse_ids(_: click.Context, parameter: click.Parameter, text: str) -> list[int]:
    """Return the numbers of a text such as 0-5,9, or raise click.BadParameter."""
    numbers: list[int] = []
    for part in text.split(","):
        match = re.fullmatch(r"\s*([0-9]{1,5})(?:-([0-9]{1,5}))?\s*", part)
        if not match or int(match[2] or match[1]) < int(match[1]):
            raise click.BadParameter(f"{text!r} is not a list of numbers, such as 0-5,9", param=parameter)
        numbers += range(int(match[1]), int(match[2] or match[1]) + 1)
    return numbers


@click.command(epilog=example_epilog("pilotfish markers --ids 0-5 --side 0.05 --out markers.pdf"))
@click.option("--ids", required=True, callback=parse_ids, help="Numbers of the markers, such as 0-5,9.")
@click.option(
    "--side",
    type=POSITIVE,
    required=True,
    callback=require_finite_option,
    help="Side of the black square [m].",
)
@click.option("--dictionary", default="apriltag_36h11", show_default=True, help="Dictionary of the markers.")
@click.option(
    "--paper", type=click.Choice(["a4", "letter"]), default="a4", show_default=True, help="Size of the paper."
)
@click.option("--out", type=FILE, required=True, help="File to write, as .pdf.")
@FORCE
@print_result
def markers(
    ids: list[int], side: float, dictionary: str, paper: str, out: Path, force: bool
) -> CommandResult:
    """Write markers to print at their true size; a ruler on each page reveals a scaled print."""
    from pilotfish.vision import write_marker_sheet

    if out.suffix.lower() != ".pdf":
        raise click.UsageError(f"{out} ends in {out.suffix!r}, expected .pdf")
    require_writable_file(out, force=force)
    pages = write_marker_sheet(out, ids, side, dictionary=dictionary, paper=paper, overwrite=force)
    noun = "page" if pages == 1 else "pages"
    text = f"{len(ids)} markers of {1e3 * side:g} mm on {pages} {noun}, written to {out}; print at 100 %"
    return CommandResult(
        [text], {"file": str(out), "pages": pages, "ids": ids, "side": side, "dictionary": dictionary}
    )
