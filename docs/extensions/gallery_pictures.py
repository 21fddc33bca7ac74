"""What sphinx-gallery is told of our examples: their pictures, their order, and a quiet start."""

import warnings

from sphinx_gallery.scrapers import figure_rst

_SHOWN = []

ORDER = (
    "two_blocks", "masonry_wall", "wall_earthquake", "wall_hit", "cohesive_panel", "tilting_facade", "arch", "falling_arch",
    "stack", "boxes", "granular", "rocks",
    "hertz", "cattaneo_mindlin", "press_and_shear", "two_cubes", "impact_bar",
    "bracket", "seal", "stamped_sheet", "slider_crank", "shaft",
)  # fmt: skip


SECTIONS = ("masonry", "rigid", "verification", "machines")


def by_section(folder):
    """The sections of the gallery in the order of SECTIONS; one that is not there comes last, by its name."""
    name = str(folder).rstrip("/").rsplit("/", 1)[-1]
    return (SECTIONS.index(name) if name in SECTIONS else len(SECTIONS), name)


def by_difficulty(file_name):
    """Examples in the order of ORDER; one that is not there comes last, by its name."""
    stem = file_name.rsplit("/", 1)[-1].removesuffix(".py")
    return (ORDER.index(stem) if stem in ORDER else len(ORDER), stem)


def scrape(block, block_vars, gallery_conf):
    """Take every `fcsim.view.Picture` that a block left in a name, each once."""
    from fcsim.view import Picture

    paths = []
    for value in list(block_vars["example_globals"].values()):
        if isinstance(value, Picture) and not any(value is shown for shown in _SHOWN):
            _SHOWN.append(value)
            paths.append(value.save(next(block_vars["image_path_iterator"])))
    return figure_rst([str(path) for path in paths], gallery_conf["src_dir"])


def quiet_start(gallery_conf, file_name):
    """Before each example: no warnings of other packages between the lines, and plots that look like fcsim's."""
    import matplotlib as mpl

    from fcsim.view.style import STYLE

    warnings.simplefilter("ignore")
    mpl.use("agg")
    mpl.rcParams.update(STYLE | {"figure.figsize": (8.0, 4.2), "figure.dpi": 110, "figure.autolayout": True})
