"""The light that a command is given: `Lighting` of its flags."""

from prt_core.cli.arguments import bounces
from prt_core.errors import PRTError, expect
from prt_core.relight.lighting import Lighting

# Flags of the light that change nothing without others (see `expect_used`).
LIGHT_NEEDS = {
    "rotate": (("light",), "--light IMAGE"),
    "sharp_sun": (("light",), "--light IMAGE"),
    "lamp_samples": (("lamps", "sharp_sun"), "--lamps or --sharp-sun"),
}
# Flags that are not called as what they fill in of `Lighting`.
_FLAGS = {"rotation": "rotate"}


def lighting_arguments(parser, several=False):
    """Add the flags of a light; of `several`, each of which has outputs of its own."""
    if several:
        parser.add_argument(
            "--light", metavar="IMAGE", nargs="+",
            help=".exr or .hdr, or 'world'; of several each has outputs of its own, with its name",
        )  # fmt: skip
    else:
        parser.add_argument("--light", metavar="IMAGE", help=".exr or .hdr, or 'world'")
    parser.add_argument("--rotate", type=float, help="degrees about z")
    parser.add_argument("--strength", type=float, default=1.0, help="factor on the light (1)")
    parser.add_argument("--exposure", type=float, default=0.0, help="stops, of every output (0)")
    parser.add_argument(
        "--sharp-sun", action="store_true", help="cast the shadow rays of the image's sun"
    )
    parser.add_argument("--lamps", action="store_true", help="add the lamps of the scene")
    parser.add_argument("--lamp-samples", type=int, help="shadow rays a lamp (256)")
    parser.add_argument(
        "--emission", nargs="+", metavar="NAME=HOW",
        help="of materials that emit light: all (default), none, or NAME=2.5, NAME=#ff8800, "
        "NAME=#ff8800:2 for a factor, a colour or both",
    )  # fmt: skip
    parser.add_argument(
        "--bounces", type=bounces, default="baked", help="default: as baked; 0 is direct light"
    )


def expect_light(options, command):
    """Refuse a command line on which nothing shines."""
    expect(
        options.light is not None or options.lamps or options.emission,
        f"{command}: no light; give --light IMAGE, --light world, --lamps or --emission all",
    )


def lighting_of(options):
    """The `Lighting` of the command line; what is wrong with it is said by the names of flags."""
    samples = options.lamp_samples
    try:
        return Lighting(
            options.light,
            rotation=options.rotate,
            strength=options.strength,
            sharp_sun=options.sharp_sun,
            lamps=options.lamps,
            lamp_samples=Lighting.lamp_samples if samples is None else samples,
            bounces=options.bounces,
            exposure=options.exposure,
            emission=_emission(options.emission),
        )
    except PRTError as error:
        field, _, said = str(error).partition(":")
        flag = _FLAGS.get(field, field).replace("_", "-")
        raise PRTError(f"--{flag}:{said}") from error


def _emission(words):
    """What `Lighting` takes of the words after --emission."""
    if words is None or words == ["all"]:
        return words and "all"
    settings = {}
    for word in words:
        name, sign, how = word.rpartition("=")
        if word == "none":
            settings["*"] = 0.0
        elif word != "all":
            expect(
                sign and name and how,
                f"emission: expected all, none or NAME=HOW, got '{word}'; HOW is a factor, "
                "#rrggbb or #rrggbb:factor",
            )
            expect(name not in settings, f"emission: '{name}' is there twice; leave one out")
            settings[name] = how
    return settings
