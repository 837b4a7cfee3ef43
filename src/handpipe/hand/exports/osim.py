"""A rig with its bones and tendons as a model of OpenSim."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from handpipe.core import Array, write_text
from handpipe.hand.exports.bone_files import METRE, bone_meshes, numbers, solid, write_bones
from handpipe.skeleton.joints import RigJoint
from handpipe.skeleton.rig import Rig
from handpipe.tissues.tendons import BonePath

MODEL = "skeleton.osim"
VERSION = "40600"  # of the format: OpenSim 4.6
LIGHT = "1e-06"  # kg and kg m²: of a body between the two axes of a saddle


def write_osim(
    folder: str | Path,
    rig: Rig,
    tendons: Sequence[BonePath] = (),
    files: Mapping[str, str] | None = None,
) -> Path:
    """Write the skeleton as `skeleton.osim` and its bones as STL files beside it, m, kg and rad.

    Frames, joints and what is left out are those of `write_mjcf`. A saddle whose axes do not meet has a body
    of 1 mg between them. A tendon is a path actuator of unit force.

    Parameters
    ----------
    folder : path
        Folder to be written; files of the same names are replaced.
    rig : Rig
        Bones and joints.
    tendons : sequence of BonePath
        Tendons, whose points become points of paths.
    files : mapping of str to str, optional
        Files of the bones below the folder, of `write_bones`; by default they are written.

    Returns
    -------
    Path
        The model.
    """
    folder = Path(folder)
    root = ElementTree.Element("OpenSimDocument", Version=VERSION)
    model = ElementTree.SubElement(root, "Model", name="handpipe")
    ElementTree.SubElement(model, "gravity").text = "0 0 0"
    bodies, joints, forces = (_set(model, name) for name in ("BodySet", "JointSet", "ForceSet"))
    files = write_bones(folder, rig) if files is None else files
    meshes = {bone: solid(mesh) for bone, mesh in bone_meshes(rig).items()}
    for bone in rig.bones:
        centre, inertia = meshes[bone].center_mass, meshes[bone].moment_inertia
        values = (*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2])
        body = _body(bodies, bone, numbers(meshes[bone].mass), numbers(*centre), numbers(*values))
        shown = ElementTree.SubElement(ElementTree.SubElement(body, "attached_geometry"), "Mesh", name=bone)
        ElementTree.SubElement(shown, "mesh_file").text = files[bone]
    _joint(joints, "WeldJoint", f"{rig.root}_at_rest", ("/ground", f"/bodyset/{rig.root}"), np.zeros(3))
    for joint in rig.joints:
        _add_joint(bodies, joints, joint)
    for tendon in tendons:
        path = ElementTree.SubElement(forces, "PathActuator", name=tendon.name)
        line = ElementTree.SubElement(path, "GeometryPath", name="path")
        points = ElementTree.SubElement(ElementTree.SubElement(line, "PathPointSet"), "objects")
        for number, (bone, place) in enumerate(zip(tendon.bones, tendon.points, strict=True)):
            point = ElementTree.SubElement(points, "PathPoint", name=f"{tendon.name}_{number}")
            ElementTree.SubElement(point, "socket_parent_frame").text = f"/bodyset/{bone}"
            ElementTree.SubElement(point, "location").text = numbers(*(place * METRE))
        ElementTree.SubElement(path, "optimal_force").text = "1"
    ElementTree.indent(root)
    write_text(folder / MODEL, ElementTree.tostring(root, encoding="unicode") + "\n")
    return folder / MODEL


def _set(model: ElementTree.Element, name: str) -> ElementTree.Element:
    """The objects of a set of the model."""
    return ElementTree.SubElement(ElementTree.SubElement(model, name, name=name.lower()), "objects")


def _body(
    bodies: ElementTree.Element, name: str, mass: str, centre: str, inertia: str
) -> ElementTree.Element:
    body = ElementTree.SubElement(bodies, "Body", name=name)
    for key, text in (("mass", mass), ("mass_center", centre), ("inertia", inertia)):
        ElementTree.SubElement(body, key).text = text
    return body


def _add_joint(bodies: ElementTree.Element, joints: ElementTree.Element, joint: RigJoint) -> None:
    """A joint of the rig: rigid, of up to three angles about one centre, or two of one angle each."""
    fit, ends = joint.fit, (f"/bodyset/{joint.parent}", f"/bodyset/{joint.child}")
    if fit.dof == 0:
        _joint(joints, "WeldJoint", joint.name, ends, fit.centre)
    elif not fit.offset.any():
        made = _joint(joints, "CustomJoint", joint.name, ends, fit.centre)
        _turn(made, joint, fit.axes.order)
    else:
        between = f"{joint.name}_between"
        inertia = f"{LIGHT} {LIGHT} {LIGHT} 0 0 0"
        _body(bodies, between, LIGHT, numbers(*(fit.centre * METRE)), inertia)
        middle, (first, second) = f"/bodyset/{between}", fit.axes.order
        _turn(_joint(joints, "CustomJoint", between, (ends[0], middle), fit.centre), joint, (first,))
        made = _joint(joints, "CustomJoint", joint.name, (middle, ends[1]), fit.centre + fit.offset)
        _turn(made, joint, (second,))


def _joint(
    joints: ElementTree.Element, kind: str, name: str, ends: tuple[str, str], centre: Array
) -> ElementTree.Element:
    """A joint whose frames in both bodies are at its centre (3,) in mm, in neutral axes."""
    made = ElementTree.SubElement(joints, kind, name=name)
    for end in ("parent", "child"):
        ElementTree.SubElement(made, f"socket_{end}_frame").text = f"{name}_{end}"
    if kind == "CustomJoint":
        ElementTree.SubElement(made, "coordinates")
    frames = ElementTree.SubElement(made, "frames")
    for end, body in zip(("parent", "child"), ends, strict=True):
        frame = ElementTree.SubElement(frames, "PhysicalOffsetFrame", name=f"{name}_{end}")
        ElementTree.SubElement(frame, "socket_parent").text = body
        ElementTree.SubElement(frame, "translation").text = numbers(*(centre * METRE))
        ElementTree.SubElement(frame, "orientation").text = "0 0 0"
    return made


def _turn(made: ElementTree.Element, joint: RigJoint, order: Sequence[int]) -> None:
    """The angles of a joint with the numbers of `order`, in which they turn."""
    coordinates = made.find("coordinates")
    assert coordinates is not None
    spatial = ElementTree.SubElement(made, "SpatialTransform")
    axes = _completed(joint.fit.axes.directions[list(order)])
    for turn, axis in enumerate(axes):
        element = ElementTree.SubElement(spatial, "TransformAxis", name=f"rotation{turn + 1}")
        if turn < len(order):
            name, limits = joint.angles[order[turn]], joint.limits[order[turn]]
            coordinate = ElementTree.SubElement(coordinates, "Coordinate", name=name)
            ElementTree.SubElement(coordinate, "range").text = numbers(*limits)
            ElementTree.SubElement(coordinate, "clamped").text = "true"
            ElementTree.SubElement(element, "coordinates").text = name
        ElementTree.SubElement(element, "axis").text = numbers(*axis)
        _function(element, turning=turn < len(order))
    for number, axis in enumerate(np.eye(3), start=1):
        element = ElementTree.SubElement(spatial, "TransformAxis", name=f"translation{number}")
        ElementTree.SubElement(element, "axis").text = numbers(*axis)
        _function(element, turning=False)


def _function(element: ElementTree.Element, turning: bool) -> None:
    """The angle itself, or zero."""
    if turning:
        function = ElementTree.SubElement(element, "LinearFunction", name="function")
        ElementTree.SubElement(function, "coefficients").text = " 1 0"
    else:
        function = ElementTree.SubElement(element, "Constant", name="function")
        ElementTree.SubElement(function, "value").text = "0"


def _completed(axes: Array) -> Array:
    """Three independent axes (3, 3), of which the first are given ones (k, 3)."""
    found = [*axes]
    if len(found) == 1:
        found.append(np.cross(found[0], np.eye(3)[np.argmin(np.abs(found[0]))]))
    if len(found) == 2:
        found.append(np.cross(found[0], found[1]))
    return np.array([axis / np.linalg.norm(axis) for axis in found])
