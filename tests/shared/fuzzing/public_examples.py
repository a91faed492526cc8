"""Public functions that the fuzzer calls, with valid arguments of each.

`public_functions` walks every package: a new package or function fails tests/fuzz/test_targets.py until it
has arguments here, or a reason why it has none.
"""

import importlib
import inspect
import pkgutil
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Any

import pilotfish
from fuzzing import (
    examples_of_assistance,
    examples_of_fixtures,
    examples_of_links,
    examples_of_models,
    examples_of_motions,
    examples_of_panel,
    examples_of_recordings,
    examples_of_teleop,
    examples_of_values,
    examples_of_vision,
)
from fuzzing.examples_of_values import Examples
from pilotfish import io

EXAMPLES: Mapping[str, Callable[[], Examples]] = {
    "assistance": lambda: {
        **examples_of_assistance.assistance_examples(),
        **examples_of_fixtures.fixture_examples(),
    },
    "geometry": examples_of_values.geometry_examples,
    "demonstrations": lambda: {
        **examples_of_values.demonstrations_examples(),
        **examples_of_recordings.recordings_examples(),
    },
    "gaussians": examples_of_values.gaussians_examples,
    "gaussians.structures": examples_of_values.structures_examples,
    "models": examples_of_models.models_examples,
    "models.online": examples_of_models.online_examples,
    "control": examples_of_motions.control_examples,
    "planning": examples_of_motions.planning_examples,
    "environments": examples_of_motions.environments_examples,
    "environments.robots": examples_of_motions.robots_examples,
    "plots": examples_of_motions.plots_examples,
    "panel": examples_of_panel.panel_examples,
    "teleop": lambda: {**examples_of_links.link_examples(), **examples_of_teleop.teleop_examples()},
    "validation": examples_of_values.validation_examples,
    "vision": examples_of_vision.vision_examples,
}

# Packages whose functions have no arguments here, and why.
EXCLUDED_PACKAGES: Mapping[str, str] = {
    "cli": "the option types and files that it reads are targets of their own",
    "environments.baxter": "functions take models and states of MuJoCo",
    "environments.human": "functions take models and states of MuJoCo",
    "kernels": "tests/fuzz/test_kernels.py compares them with the references",
    "kernels.reference": "tests/fuzz/test_kernels.py compares them with the kernels",
    "cluster": "connects to a scheduler; tests/cluster gives it other arguments",
    "simulation": "functions simulate physics for seconds or write films",
}

# Functions without arguments here, and why.
EXCLUDED: Mapping[str, str] = {
    "environments.robots.solve_posture": "searches for a second where a pose is out of reach",
    **{f"io.{name}": "decoders and readers are targets of their own: see targets.py" for name in io.__all__},
    "demonstrations.pose_layout": "takes no arguments",
    "demonstrations.require_compatible": "returns nothing; `views` calls it",
    "demonstrations.count_at_limits": "`switching_columns` calls it",
    "demonstrations.select_switches": "`switching_columns` calls it",
    "io.readers.read_recordings": "tests/io/readers damages files of every format",
    "io.readers.reader_formats": "takes no arguments",
    "io.writers.export_demonstrations": "writes files of other programs",
    "teleop.start_view": "takes no arguments",
    "teleop.seal_datagram": "`send_from_operator` calls it; it trusts its arguments",
    "models.relevance": "takes a skill and demonstrations only, and a second per call",
    "assistance.calibrate_gate": "takes a function; `coverage_distances` is its loop",
    "assistance.calibrate_intention": "takes a function; `predictive_log_densities` is its loop",
    "models.fit_em": "takes functions; `learn` calls it",
    "models.maximise_likelihood": "takes functions; `learn` calls it",
    **{
        f"environments.{name}": "takes models of MuJoCo or poses of objects"
        for name in ("add_camera", "add_markers", "contact_forces", "linear_path")
    },
    **{
        f"vision.{name}": "reads or writes files: tests/vision damages them"
        for name in (
            *("image_files", "open_images", "parse_markers", "read_camera", "read_image", "read_markers"),
            *("write_camera", "write_frames", "write_marker_sheet", "write_picture"),
        )
    },
    "vision.require_opencv": "takes no arguments",
    "panel.serve": "serves a page until it is stopped: tests/live/test_panel_in_browser.py opens it",
    "plots.draw_ellipses": "draws into axes; the figures call it",
    "validation.shorten_repr": "changes a class of the library when it is defined",
    "plots.state_colour": "takes the index of a state only",
}


def public_packages() -> Iterator[str]:
    """Yield the names of all packages, such as models.online."""
    for module in pkgutil.walk_packages(pilotfish.__path__, "pilotfish."):
        if module.ispkg:
            yield module.name.removeprefix("pilotfish.")


def public_functions() -> Iterator[str]:
    """Yield the names of the public functions of packages that are not excluded, such as geometry.angle."""
    found: set[Callable[..., Any]] = set()
    for package in public_packages():
        if any(package == name or package.startswith(f"{name}.") for name in EXCLUDED_PACKAGES):
            continue
        module = importlib.import_module(f"pilotfish.{package}")
        for name in getattr(module, "__all__", ()):
            function = getattr(module, name)
            if inspect.isfunction(function) and function not in found:
                found.add(function)
                yield f"{package}.{name}"


def function_named(name: str) -> Callable[..., Any]:
    """Return a function or method by its name; manipulation.step and .reset are those of an environment."""
    if name.startswith("manipulation."):
        return getattr(examples_of_motions.new_environment(), name.removeprefix("manipulation."))  # type: ignore[no-any-return]
    package, _, function = name.rpartition(".")
    if package.rpartition(".")[2][0].isupper():  # a class
        return getattr(function_named(package), function)  # type: ignore[no-any-return]
    return getattr(importlib.import_module(f"pilotfish.{package}"), function)  # type: ignore[no-any-return]


@cache
def examples(package: str) -> Examples:
    """Return valid arguments of the functions of one package, by function name."""
    given = EXAMPLES[package]()
    return {f"{package}.{name}" if "." not in name else name: value for name, value in given.items()}
