"""Read the XML of a robot's description, and keep only what describes links and joints.

A description is text from outside. Document types and entities are refused before the text is parsed, so that
it cannot grow or name other files. Elements and attributes that load files, repeat parts or add plugins are
not copied. Meshes, textures, sensors and so on vanish with them; they are not needed here.
"""

from collections.abc import Callable
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from pilotfish.errors import InvalidInput
from pilotfish.validation import short_repr

MAX_ELEMENTS, MAX_DEPTH, MAX_INCLUDES = 50_000, 100, 50
ACTUATORS = ("general", "motor", "position", "velocity", "intvelocity", "damper")
SOLIDS = ("sphere", "capsule", "ellipsoid", "cylinder", "box")
# Children that are kept of each element; other elements have none.
MJCF_CHILDREN: dict[str, tuple[str, ...]] = {
    "mujoco": ("compiler", "default", "worldbody", "actuator"),
    "default": ("default", "joint", "geom", "site", *ACTUATORS),
    "worldbody": ("body", "frame", "site"),
    "body": ("body", "frame", "joint", "freejoint", "inertial", "geom", "site"),
    "frame": ("body", "frame", "joint", "freejoint", "geom", "site"),
    "actuator": ACTUATORS,
}
URDF_CHILDREN: dict[str, tuple[str, ...]] = {
    "robot": ("link", "joint"),
    "link": ("inertial",),
    "inertial": ("origin", "mass", "inertia"),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
}
COMPILER = (
    "angle", "autolimits", "balanceinertia", "boundinertia", "boundmass", "eulerseq", "inertiafromgeom",
    "inertiagrouprange", "settotalmass",
)  # fmt: skip
DROPPED_ATTRIBUTES = ("material", "plugin", "user")
REFUSED = ("replicate", "attach", "composite", "flexcomp")
ReadIncluded = Callable[[str], bytes]


def parse_description(data: bytes, name: str, read_included: ReadIncluded | None = None) -> Element:
    """Return the links and joints of a description in URDF or MJCF, as an element "robot" or "mujoco".

    Args:
        data: Text of the description.
        name: Name of the file, for messages.
        read_included: Function that reads a file that the description includes; None to refuse them.

    Raises:
        InvalidInput: If the text is not XML, declares entities, is too large, or is another format.
    """
    root = _parse(data, name)
    if root.tag not in ("robot", "mujoco"):
        raise InvalidInput(f"{name} begins with <{short_repr(root.tag)[1:-1]}>, expected <robot> or <mujoco>")
    _expand_includes(root, name, read_included)
    _require_bounded(root, name)
    for element in root.iter():
        if "xacro" in str(element.tag):
            raise InvalidInput(f"{name} holds macros of xacro; expand them: xacro {name} > robot.urdf")
        if element.tag in REFUSED:
            raise InvalidInput(
                f"{name} has <{element.tag}>, which generates bodies; write the model out with "
                "mujoco.mj_saveLastXML and give that file"
            )
    children = URDF_CHILDREN if root.tag == "robot" else MJCF_CHILDREN
    return _copy(root, children)


def _parse(data: bytes, name: str) -> Element:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InvalidInput(f"{name} is not text in UTF-8 ({error.reason}); save it as UTF-8") from error
    lower = text.lower()
    if "<!doctype" in lower or "<!entity" in lower:
        raise InvalidInput(f"{name} declares a document type or entities; remove <!DOCTYPE ...> from it")
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise InvalidInput(f"{name} is not well-formed XML ({error}); give a URDF or MJCF file") from error


def _expand_includes(root: Element, name: str, read_included: ReadIncluded | None) -> None:
    """Put the content of included files in place of <include>, at most 50 files in all."""
    count = 0
    while includes := [
        (parent, child) for parent in root.iter() for child in parent if child.tag == "include"
    ]:
        for parent, child in includes:
            count += 1
            if read_included is None or count > MAX_INCLUDES:
                raise InvalidInput(f"{name} includes other files, more than {MAX_INCLUDES}; write one file")
            file = child.get("file", "")
            included = _parse(read_included(file), file)
            position = list(parent).index(child)
            parent[position : position + 1] = list(included)
        _require_bounded(root, name)


def _require_bounded(root: Element, name: str) -> None:
    """Raise InvalidInput if the tree has too many elements, or is nested too deeply."""
    level, total, depth = [root], 0, 0
    while level:
        total, depth = total + len(level), depth + 1
        if total > MAX_ELEMENTS or depth > MAX_DEPTH:
            raise InvalidInput(
                f"{name} has more than {MAX_ELEMENTS} elements or {MAX_DEPTH} levels; give one robot only"
            )
        level = [child for element in level for child in element]


def _copy(element: Element, children: dict[str, tuple[str, ...]]) -> Element:
    """Return a copy with the elements and attributes that are kept."""
    attributes = {k: v for k, v in element.attrib.items() if k not in DROPPED_ATTRIBUTES}
    if element.tag == "compiler":
        attributes = {k: v for k, v in attributes.items() if k in COMPILER}
    copy = Element(element.tag, attributes)
    for child in element:
        if child.tag in children.get(str(element.tag), ()) and _is_kept(child):
            copy.append(_copy(child, children))
    return copy


def _is_kept(element: Element) -> bool:
    """Return whether an element needs no other file, and moves a joint if it is an actuator."""
    if element.tag == "geom":
        return "mesh" not in element.attrib and element.get("type", SOLIDS[0]) in SOLIDS
    return (
        element.tag not in ACTUATORS or "joint" in element.attrib or not set(element.attrib) & TRANSMISSIONS
    )


TRANSMISSIONS = {"tendon", "site", "body", "cranksite", "slidersite", "jointinparent"}


def joint_limits_of_urdf(root: Element, name: str) -> dict[str, tuple[float, float]]:
    """Return effort [N m] and velocity [rad/s] of each joint of a URDF that has both.

    Args:
        root: Element "robot".
        name: Name of the file, for messages.
    """
    found: dict[str, tuple[float, float]] = {}
    for joint in root.findall("joint"):
        limit = joint.find("limit")
        if limit is None or limit.get("effort") is None or limit.get("velocity") is None:
            continue
        try:
            found[joint.get("name", "")] = float(limit.get("effort", "")), float(limit.get("velocity", ""))
        except ValueError as error:
            raise InvalidInput(
                f"{name}: joint {short_repr(joint.get('name'))} has a limit that cannot be read as a number "
                f"({error})"
            ) from error
    return found


def mimicking_joints(root: Element) -> set[str]:
    """Return the names of the joints of a URDF that follow another joint."""
    return {joint.get("name", "") for joint in root.findall("joint") if joint.find("mimic") is not None}


def continuous_joints(root: Element) -> set[str]:
    """Return the names of the joints of a URDF that turn without end."""
    return {joint.get("name", "") for joint in root.findall("joint") if joint.get("type") == "continuous"}
