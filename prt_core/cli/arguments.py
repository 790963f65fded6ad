"""What several commands take."""

import argparse

_IN_BLENDER = "the scene that is open"


def scene_argument(parser, in_blender):
    if in_blender:
        parser.add_argument("scene", nargs="?", help=f".blend; default: {_IN_BLENDER}")
    else:
        parser.add_argument("scene", help=".blend")


def caster_argument(parser):
    parser.add_argument(
        "--caster", default="auto", choices=("auto", "blender", "bvhtree", "embree"),
        help="who traces rays; auto: Embree where installed, else Blender",
    )  # fmt: skip


def transport_argument(parser):
    parser.add_argument(
        "--transport", default="auto", choices=("auto", "exact", "compressed"),
        help="what distant light is relit from; auto: the compressed form where it is fresh",
    )  # fmt: skip


def quiet_arguments(parser):
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")


def bounces(text):
    if text == "auto":
        return None
    if text == "baked":
        return text
    try:
        value = int(text)
    except ValueError:
        value = -1
    if value < 0:
        raise argparse.ArgumentTypeError(f"expected auto or a number >= 0, got '{text}'")
    return value


def size(text):
    width, _, height = text.partition("x")
    if not (width.isdigit() and height.isdigit() and 0 < int(width) * int(height) < 1 << 28):
        raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT, got '{text}'")
    return int(width), int(height)
