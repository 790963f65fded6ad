"""A bake's report in words, for people."""


def report_lines(path, report):
    """Lines on a bake: what it holds, what it cost, how near the truth it is, what it spared.

    Parameters
    ----------
    path : str or Path
    report : dict
        See `bake_steps`; those of older versions have fewer keys.
    """
    seconds, rate = report["seconds"], report["rays_per_second"]
    speed = "" if rate is None else f", {rate / 1e6:.1f} M a second"
    stages = ", ".join(f"{stage} {value:.1f} s" for stage, value in seconds.items())
    yield f"{path}: {report['points']:,} points, {report['directions']:,} directions"
    yield f"  rays    {report['rays'] / 1e6:.1f} M by {report['back_end']}{speed}"
    yield f"  time    {sum(seconds.values()):.1f} s ({stages})"
    yield (
        f"  size    {report['bytes'] / 1e6:.1f} MB, peak memory {report['peak_bytes'] / 1e6:.0f} MB"
    )
    yield from _traced(report)
    yield from (f"  error   {line}" for line in _errors(report))
    yield from (f"  spared  {line}" for line in _spared(report.get("skipped") or {}))
    yield from (f"  note    {message}" for message in report["messages"])


def _traced(report):
    if report.get("certificate"):
        yield (
            f"  traced  {report['entries_percent']:.2f} % of all entries, "
            f"{report['hemisphere_percent']:.2f} % of those above the horizon, "
            f"by the method '{report['method']}'"
        )
    else:
        yield "  traced  every entry"


def _errors(report):
    certificate = report.get("certificate")
    if certificate:
        met = "within" if report["tolerance_met"] else "NOT within"
        yield f"{report['visibility_error']:.2%} of direct light, {met} the tolerance; at 95 %:"
        for item in certificate:
            parts = [("matrix", item["matrix"]), *item["relit"].items()]
            yield f"  {item['name']}: " + ", ".join(
                f"{name} {part['error']:.2%} ({part['low']:.2%} to {part['high']:.2%})"
                for name, part in parts
            )
    else:
        yield "none of direct light"
    if report["error"] is not None:
        rays = report["rays_a_point"]
        yield f"{report['error']:.2%} of relit colours, from the bounces ({rays} rays a point)"


def _spared(skipped):
    if skipped.get("visibility_rays", 0) > 0:
        yield f"{skipped['visibility_rays'] / 1e6:.1f} M shadow rays"
    if skipped.get("gather_rays"):
        yield f"{skipped['gather_rays'] / 1e6:.1f} M bounce rays towards the open sky"
    if "bounces_below" in skipped:
        yield f"all bounces: they add at most {skipped['bounces_below']:.2%}"
    if skipped.get("grey"):
        yield "two of three channels of the bounces where the light is grey: all materials are"


def trial_lines(facts):
    """The short table of what was tried on a sample of the points, and why one was chosen."""
    trials = facts["trials"]
    width = max(len(trial["settings"]) for trial in trials)
    head = f"{'settings':{width}}"
    yield f"tried on a sample: method      {head}  error %  worst %       MB      ms"
    for trial in trials:
        yield (
            f"                   {trial['method']:10}  {trial['settings']:{width}}  "
            f"{100 * trial['error']:7.2f}  {100 * trial['worst']:7.2f}  "
            f"{trial['megabytes']:7.1f}  {trial['milliseconds']:6.1f}"
        )
    yield f"chosen: {facts['method']}, {facts['why']}"


def compressed_lines(facts):
    """Lines on a compressed form: what it is, how near, how large, how fast."""
    settings = ", ".join(f"{k} {v}" for k, v in facts["settings"].items() if v is not None)
    yield f"  method  {facts['method']} ({settings}), {facts['seconds']:.1f} s"
    verdict = {None: "", True: ", within the tolerance", False: ", NOT within the tolerance"}
    yield (
        f"  error   {facts['error']:.2%} of relit colours in the mean over {facts['lights']} "
        f"lights it was not chosen under, {facts['worst']:.2%} under {facts['worst_light']}"
        f"{verdict[facts['tolerance_met']]}"
    )
    yield (
        f"  size    {facts['bytes'] / 1e6:.1f} MB, {facts['bits_a_coefficient']:.2f} bits a "
        "coefficient"
    )
    yield (
        f"  speed   {facts['milliseconds']:.1f} ms a light in the median, "
        f"{facts['milliseconds_worst']:.1f} ms the slowest"
    )
