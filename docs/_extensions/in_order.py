"""The order of the examples in a section of the gallery: from what most need to what few do."""

ORDER = [
    *("match_two_meshes", "landmarks", "symmetric_shape", "part_to_whole", "damaged_scan"),
    *("pinned_landmarks", "from_another_map", "prepare_once", "point_cloud", "other_species"),
    *("live_report", "confidence", "where_shapes_differ", "compare_with_pyfm"),
    *(
        "carry_labels",
        "carry_a_texture",
        "one_topology",
        "mean_and_modes",
        "save_and_load",
        "other_programs",
        "blender_shape_keys",
    ),
    *("distances_without_matrix", "canonical_form", "own_engine", "own_descriptor", "own_matcher"),
]


class InOrder:
    """Sort files by their place in the list; what is missing there comes last."""

    def __init__(self, folder):
        pass

    def __call__(self, file):
        """Place of a file."""
        name = file.removesuffix(".py")
        return ORDER.index(name) if name in ORDER else len(ORDER), name
