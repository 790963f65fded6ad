"""`prt bench …`: measure on this machine."""

import importlib
import json
import time
from pathlib import Path

from prt_core.errors import PRTError, expect
from prt_core.light import CubeMap, EnvironmentMap
from prt_core.progress import run
from prt_core.rays import make_caster

_METHODS = ("agreement", "huang")


def add_bench(commands, scene_argument, quiet_arguments, show, in_blender):
    """Add `bench` and its kinds to the commands.

    Parameters
    ----------
    commands : argparse subparsers
    scene_argument, quiet_arguments : callable
        Add what every command has.
    show : namespace
        `Bar(silent)` shows progress, `Hushed()` keeps Blender's lines off stdout.
    in_blender : bool
    """
    bench = commands.add_parser("bench", help="measure on this machine")
    kinds = bench.add_subparsers(required=True, metavar="WHAT")
    rays = kinds.add_parser("rays", help="rays a second of every back-end on a scene")
    scene_argument(rays, in_blender)
    rays.add_argument("--resolution", type=int, default=32)
    rays.add_argument("--points", type=int, default=2048, help="points traced (2048)")
    quiet_arguments(rays)
    rays.set_defaults(run=_bench_rays, show=show)

    sampling = kinds.add_parser(
        "sampling",
        help="ways to sample the visibility against every entry traced: table, plot, report",
    )
    scene_argument(sampling, in_blender)
    sampling.add_argument(
        "--methods", nargs="+", default=list(_METHODS), metavar="NAME[:key=value,…]",
        help="samplers and settings of theirs (agreement huang)",
    )  # fmt: skip
    sampling.add_argument("-o", "--output", required=True, metavar="FOLDER", help="of the report")
    sampling.add_argument("--resolution", type=int, default=32, help="texels along a cube edge")
    sampling.add_argument(
        "--caster", nargs="+", default=["auto"], choices=("auto", "blender", "bvhtree", "embree"),
        help="back-ends, measured one after the other",
    )  # fmt: skip
    sampling.add_argument(
        "--light", nargs="+", metavar="IMAGE", help="environments; default: some of Blender's own"
    )
    sampling.add_argument(
        "--rotate", nargs="+", type=float, default=[0.0, 120.0], help="degrees of each (0 120)"
    )
    sampling.add_argument("--seed", type=int, default=0)
    quiet_arguments(sampling)
    sampling.set_defaults(run=_bench_sampling, show=show)


def _open_scene(path):
    from prt_core.api import import_bpy, open_blend

    if path:
        open_blend(path)
    else:
        import_bpy()
    from prt_core.blender.depsgraph import read_scene

    return read_scene()


def _bench_rays(options):
    from prt_core.evaluate.bench_rays import bench_rays

    with options.show.Hushed():
        rows = bench_rays(_open_scene(options.scene), options.resolution, options.points)
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


def _bench_sampling(options):
    from prt_core.evaluate.bench_sampling import bench_sampling_steps, parse_method
    from prt_core.evaluate.report import expect_folder, write_report
    from prt_core.evaluate.sampling_report import sampling_report

    expect_folder(options.output)
    methods = [parse_method(text) for text in options.methods]
    for method in methods:
        method.made_settings(options.seed)
    cube_map = CubeMap(options.resolution)
    bar = options.show.Bar(options.quiet or options.json)
    rows = []
    with options.show.Hushed():
        name, scene = _scene_named(options.scene)
        lights = _lights(options.light, options.rotate, cube_map)
        for back_end in options.caster:
            caster = make_caster(back_end, scene.vertices, scene.triangles)
            try:
                steps = bench_sampling_steps(
                    scene, cube_map, caster, methods, lights, name, options.seed
                )
                more, results = run(steps, bar)
                rows += more
                report = sampling_report(scene, cube_map, caster, rows, results, lights)
            finally:
                bar.close()
                caster.close()
        page = write_report(options.output, report)
    if options.json:
        print(json.dumps(rows))
        return 0
    _print_rows(rows)
    print(f"{page}: written {time.strftime('%H:%M')}")
    return 0


def _print_rows(rows):
    width = max(len(row["label"]) for row in rows)
    print(f"{'method':{width}}  back-end  object      entries %  seconds   ratio  matrix L2"
          "  interval           worst point  relit L2")  # fmt: skip
    for row in rows:
        interval = f"{row['interval_low']:.2%} to {row['interval_high']:.2%}"
        relit = "" if row["relit_l2"] is None else f"{row['relit_l2']:.2%}"
        print(
            f"{row['label']:{width}}  {row['back_end']:8}  {row['object'][:10]:10}  "
            f"{row['entries_percent']:9.2f}  {row['seconds']:7.2f}  {row['time_ratio']:6.3f}  "
            f"{row['matrix_l2']:9.2%}  {interval:17}  {row['worst_point']:11.1%}  {relit:>8}"
        )


def _scene_named(path):
    """(name, Scene): of a .blend, of the scene that is open, or a measuring scene by its name."""
    if path is None or path.endswith(".blend"):
        return Path(path).stem if path else "open scene", _open_scene(path)
    try:
        scenes = importlib.import_module("tests.benchmarks.sampling_scenes")
    except ImportError as error:
        raise PRTError(
            f"{path}: expected a .blend file; measuring scenes by name need the source tree"
        ) from error
    known = ", ".join(scenes.MODELS)
    expect(path in scenes.MODELS, f"{path}: expected a .blend file or one of {known}")
    return path, scenes.measuring_scene(path)


def _lights(paths, rotations, cube_map):
    """{name: radiance} of each environment at each rotation."""
    if paths is None:
        try:
            from prt_core.api import import_bpy

            import_bpy()
        except PRTError as error:
            raise PRTError(f"light: give images with --light ({error})") from error
        from prt_core.blender.studio import studio_paths

        named = studio_paths()
    else:
        named = {Path(path).stem: path for path in paths}
    images = {name: EnvironmentMap.read(path) for name, path in named.items()}
    return {
        f"{name} at {angle:g}°": image.to_cube_map(cube_map, angle)
        for name, image in images.items()
        for angle in rotations
    }
