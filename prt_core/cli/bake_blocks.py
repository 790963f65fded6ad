"""`prt bake-blocks`: blocks of work of a planned bake; and what `prt bake` says of a plan."""

import json

from prt_core.api import finish
from prt_core.bake.blocks import compute, missing_blocks, stages
from prt_core.bake.report_lines import report_lines
from prt_core.bake.stages import BlocksMissing, Stage, ranges_text
from prt_core.cli.arguments import quiet_arguments, share_named
from prt_core.cli.show import working
from prt_core.errors import expect, shown
from prt_core.runtime.progress import Progress
from prt_core.store import BakeStore


def add_bake_blocks(commands):
    """Add `bake-blocks` to the commands."""
    blocks = commands.add_parser(
        "bake-blocks",
        help="compute blocks of a bake that was planned, on any machine that sees it",
        description="Blocks may be computed by anybody, in any order and again, without Blender; "
        "without --stage the stages that are known by now are listed.",
    )
    blocks.add_argument("store", help="NAME.prt of 'prt bake --plan'")
    blocks.add_argument("--stage", metavar="NAME", help="of those that are listed")
    blocks.add_argument(
        "--blocks", metavar="12-20,25", help="numbers of blocks; default: all that are missing"
    )
    blocks.add_argument(
        "--share", metavar="I/N",
        help="the share with number I (from 0) of N, of --stage or of all stages that are known: "
        "for arrays of jobs that all run the same line",
    )  # fmt: skip
    quiet_arguments(blocks)
    blocks.set_defaults(run=_bake_blocks)


def _bake_blocks(options):
    share = None if options.share is None else share_named(options.share)
    expect(
        share is None or options.blocks is None,
        "--share: chooses blocks; leave out one of --share and --blocks",
    )
    expect(
        options.blocks is None or options.stage is not None,
        "--blocks: changes nothing without --stage",
    )
    if options.stage is None and share is None:
        _say_stages(options)
        return 0
    if share is not None and BakeStore(options.store).is_complete:
        # The share of a job that comes late.
        print(json.dumps([]) if options.json else f"{options.store}: finished, nothing is left")
        return 0
    # What is asked for is checked before the first block.
    known = {stage.name: stage for stage in stages(options.store)}
    expect(
        options.stage is None or options.stage in known,
        f"--stage: expected one of {', '.join(known)}, got {shown(options.stage)}; further stages "
        f"are opened by 'prt bake --finish {options.store}'",
    )
    asked = known.values() if options.stage is None else [known[options.stage]]
    store, done = BakeStore(options.store), []
    with working(options.quiet or options.json) as bar:
        for stage in asked:
            if options.blocks is None:
                chosen = missing_blocks(options.store, stage)
            else:
                chosen = blocks_named(options.blocks, stage)
            if share is not None:
                # By number, and not by what is missing now: that changes while others work.
                chosen = [index for index in chosen if index % share[1] == share[0]]
            for count, index in enumerate(chosen):
                done.append(compute(store, stage, index))
                bar(Progress(stage.name, count + 1, len(chosen)))
    if options.json:
        print(json.dumps([vars(each) for each in done]))
    else:
        for each in done:
            what = "was there" if each.again else f"{each.rays:,} rays"
            print(f"{each.stage} {each.index}: {each.seconds:.2f} s, {what}")
    return 0


def blocks_named(text, stage):
    """Numbers of blocks of a text as 12-20,25.

    Parameters
    ----------
    text : str
    stage : Stage

    Returns
    -------
    list of int

    Raises
    ------
    PRTError
        It is no such text, or the stage has not so many blocks.
    """
    chosen = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        good = first.isdecimal() and (last.isdecimal() if dash else True)
        good = good and int(first) <= int(last or first)
        expect(good, f"--blocks: expected numbers and ranges as 12-20,25, got {shown(text)}")
        # Before the range is made: it may be a long one.
        expect(
            int(last or first) < stage.blocks,
            f"--blocks: stage '{stage.name}' has blocks 0 to {stage.blocks - 1}, got {shown(text)}",
        )
        chosen += range(int(first), int(last or first) + 1)
    return chosen


def _say_stages(options):
    rows = []
    for stage in stages(options.store):
        missing = missing_blocks(options.store, stage)
        rows.append({"stage": stage.name, "blocks": stage.blocks, "missing": ranges_text(missing)})
    if options.json:
        print(json.dumps(rows))
        return
    for row in rows:
        missing = f"missing {row['missing']}" if row["missing"] else "all there"
        print(f"{row['stage']:12} {row['blocks']:,} blocks, {missing}")


def say_plan(options, output, known):
    """Print the stages of a plan, dicts of name and blocks, and what to do next."""
    if options.json:
        print(json.dumps({"bake": str(output), "stages": known}))
        return
    print(f"{output}: planned; the scene is in it, blocks need no Blender")
    for stage in known:
        stage = Stage(**stage)
        print(
            f"  {stage.name}  {stage.blocks:,} blocks: prt bake-blocks {output} --stage "
            f"{stage.name} --blocks {ranges_text(range(stage.blocks))}"
        )
    print(f"  then: prt bake --finish {output}, which opens further stages where they are needed")


def finish_planned(options):
    """`prt bake --finish`: close a planned bake as far as its blocks allow."""
    asked = {"memory": options.memory, "compute": options.compute, "dask": options.dask}
    try:
        with working(options.quiet or options.json) as bar:
            report = finish(options.scene, **asked, report=bar)
    except BlocksMissing as missing:
        if not options.open:
            raise
        print(missing)
        return 0
    if options.json:
        print(json.dumps({"bake": str(options.scene), **report}))
    else:
        origin = BakeStore(options.scene).attributes["origin"]
        print(*report_lines(options.scene, report, origin), sep="\n")
    return 0
