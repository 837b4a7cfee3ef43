"""A hand: its subject's files, which layers and frames a scene asks for, their simulation and exports."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.hand import layer_loading
    from handpipe.hand.appearance import colour, opacity, shown, surfaces_once, tissue, vertex_colours
    from handpipe.hand.carried import CarriedTemplate, with_carried_hints
    from handpipe.hand.checks import faults
    from handpipe.hand.continuity import POP, Continuity, Step, continuity_metrics
    from handpipe.hand.exports import surface_triangles, write_glb, write_obj_sequence, write_vtu_series
    from handpipe.hand.frames import (
        UNITS,
        StoredFrames,
        failures_in,
        figure_units,
        finished_frames,
        frame_angles,
        frames_to_follow,
        read_frames,
        read_simulated,
        write_frames,
    )
    from handpipe.hand.labelled import labelled_bones, labelled_muscles, names_of_labels, require_seeds
    from handpipe.hand.layer_loading import load_layers
    from handpipe.hand.moved_image import grid_around, places_in_neutral, skin_of
    from handpipe.hand.part import FINGERS, part_of
    from handpipe.hand.simulation import (
        Failure,
        Simulated,
        SimulatedFrame,
        key_of,
        simulate,
        simulate_frame,
        simulated_ahead,
    )
    from handpipe.hand.subject import (
        joint_limits,
        named_files,
        require_files,
        require_plain,
        require_skin,
    )
else:
    __getattr__ = face(__name__)

__all__ = [
    "CarriedTemplate",
    "Continuity",
    "FINGERS",
    "Failure",
    "POP",
    "Simulated",
    "SimulatedFrame",
    "Step",
    "StoredFrames",
    "UNITS",
    "colour",
    "continuity_metrics",
    "failures_in",
    "faults",
    "figure_units",
    "finished_frames",
    "frames_to_follow",
    "frame_angles",
    "grid_around",
    "joint_limits",
    "key_of",
    "labelled_bones",
    "labelled_muscles",
    "layer_loading",
    "load_layers",
    "named_files",
    "names_of_labels",
    "opacity",
    "part_of",
    "places_in_neutral",
    "read_frames",
    "read_simulated",
    "require_files",
    "require_plain",
    "require_seeds",
    "require_skin",
    "shown",
    "simulate",
    "simulate_frame",
    "simulated_ahead",
    "skin_of",
    "surfaces_once",
    "surface_triangles",
    "tissue",
    "vertex_colours",
    "with_carried_hints",
    "write_frames",
    "write_glb",
    "write_obj_sequence",
    "write_vtu_series",
]
