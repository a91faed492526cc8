"""Diagnostics of demonstrations as lines of text, with the nearest fix on the command line."""

from pilotfish.demonstrations import Diagnostic

IMPORT = "pilotfish data import {source} --out NEW"
FIXES = {
    "held rows": f"{IMPORT} removes the repeated rows",
    "times": f"{IMPORT} resamples to the times; or correct the period in the manifest",
    "units": f"{IMPORT} converts to SI units",
    "size": "If not, state the true unit in the manifest, and convert with " + IMPORT,
    "wrap-around": f"{IMPORT} removes the jumps of angles in rad or deg",
    "quaternion order": f"{IMPORT} --order xyzw reorders those of the tool; reorder those of frames in the "
    "manifest",
    "lost frame": "interpolate the pose over those rows in the recording",
    "held frame": "interpolate the pose over those rows in the recording",
    "far frame": "If so, state the position of the frame in metres in the manifest",
    "missing frame": "record the pose of the object, and add it to the manifest as a frame",
}


def format_diagnostic(diagnostic: Diagnostic, source: object) -> str:
    """Return a diagnostic as a line of text.

    Args:
        diagnostic: From `diagnose`.
        source: Folder of the demonstrations, for the fix.
    """
    line = f"{diagnostic.severity}: {diagnostic.location} {diagnostic.message}"
    fix = FIXES.get(diagnostic.kind, "").format(source=source)
    separator = " " if line.endswith("?") else "; "
    return f"{line}{separator}{fix}" if fix else line
