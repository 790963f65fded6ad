"""`prt bench rays`: rays a second of every back-end on a scene."""

import json

from prt_core.cli.arguments import quiet_arguments, scene_argument
from prt_core.cli.bench_scenes import open_scene
from prt_core.cli.show import Hushed
from prt_core.errors import expect_whole
from prt_core.sphere import CubeMap


def add_bench_rays(kinds, in_blender):
    """Add `rays` to the kinds of `prt bench`."""
    rays = kinds.add_parser("rays", help="rays a second of every back-end on a scene")
    scene_argument(rays, in_blender)
    rays.add_argument("--resolution", type=int, default=32)
    rays.add_argument("--points", type=int, default=2048, help="points traced (2048)")
    quiet_arguments(rays)
    rays.set_defaults(run=_bench_rays)


def _bench_rays(options):
    from prt_core.evaluate.bench.rays import bench_rays

    CubeMap(options.resolution)
    expect_whole("--points", options.points, 1)
    with Hushed():
        rows = bench_rays(open_scene(options.scene), options.resolution, options.points)
    if options.json:
        print(json.dumps(rows))
        return 0
    print(f"{rows['points']:,} points, {rows['directions']:,} directions, {rows['rays']:,} rays")
    print("back-end   stage M/s   bare M/s   stage/bare   incoherent M/s   disagree")
    for row in rows["back_ends"]:
        print(
            f"{row['back_end']:9}  {row['stage_rays_per_second'] / 1e6:9.2f}  "
            f"{row['bare_rays_per_second'] / 1e6:9.2f}  {row['overhead']:11.2f}  "
            f"{row['incoherent_rays_per_second'] / 1e6:15.2f}  {row['disagree']:9d}"
        )
    return 0
