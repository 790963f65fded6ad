"""A bake's report in words, for people."""

from pathlib import Path

from prt_core.bake.bounce_error import LOCAL

# Lines of a kind that are written out; of more, the gravest.
_MOST = 8
# Metal in what metal mirrors, above which it is said that no error counts it.
_LITTLE_METAL = 0.02


def origin_lines(origin):
    """The scene and frame that a bake or light field is of; nothing where the frame is not known.

    Parameters
    ----------
    origin : dict of str -> str
        See `Bake`.
    """
    frame = (origin or {}).get("frame")
    if frame is not None:
        file = Path(origin["file"]).name if origin.get("file") else "a file without a name"
        yield f"  scene   '{origin.get('scene')}' of {file} at frame {frame}"


def report_lines(path, report, origin=None):
    """Lines on a bake: what it holds, what it cost, how near the truth it is, what it spared.

    Parameters
    ----------
    path : str or Path
    report : dict
        See `bake_steps`; those of older versions have fewer keys.
    origin : dict of str -> str, optional
        See `Bake`.
    """
    seconds, rate = report["seconds"], report["rays_per_second"]
    speed = "" if rate is None else f", {rate / 1e6:.1f} M a second"
    stages = ", ".join(f"{stage} {value:.1f} s" for stage, value in seconds.items())
    yield f"{path}: {report['points']:,} points, {report['directions']:,} directions"
    yield from origin_lines(origin)
    yield f"  rays    {report['rays'] / 1e6:.1f} M by {report['back_end']}{speed}"
    yield f"  time    {sum(seconds.values()):.1f} s ({stages})"
    yield (
        f"  size    {report['bytes'] / 1e6:.1f} MB, peak memory {report['peak_bytes'] / 1e6:.0f} MB"
    )
    if report.get("reused"):
        yield f"  reused  {report['reused']['line']}"
    yield from _traced(report)
    yield from (f"  error   {line}" for line in _errors(report))
    yield from (f"  spared  {line}" for line in _spared(report.get("skipped") or {}))
    messages = report["messages"]
    if messages:
        yield f"  notes   {len(messages)}, those that concern most of the scene first"
    yield from (f"  note    {message}" for message in messages)


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
        error = report["visibility_error"]
        yield f"{error:.2%} of direct light, {_met(report, error)}; at 95 %:"
        ranked = sorted(certificate, key=_worst, reverse=True)
        shown = ranked[:_MOST] if len(ranked) > _MOST else certificate
        for item in shown:
            parts = [("matrix", item["matrix"]), *item["relit"].items()]
            yield f"  {item['name']}: " + ", ".join(
                f"{name} {part['error']:.2%} ({part['low']:.2%} to {part['high']:.2%})"
                for name, part in parts
            )
        if len(ranked) > _MOST:
            yield f"  and {len(ranked) - _MOST} more: at most {_worst(ranked[_MOST]):.2%}"
    else:
        yield "none of direct light"
    for item in report.get("emitters", ()):
        error = item["error"]
        yield f"{error:.2%} of the direct light of '{item['name']}', {_met(report, error)}"
    gloss = report.get("gloss_error")
    if gloss:
        light, error = max(gloss["errors"].items(), key=lambda item: item[1])
        mean = sum(gloss["errors"].values()) / len(gloss["errors"])
        yield (
            f"{mean:.2%} of what {gloss['views']} views show of {gloss['points']:,} glossy points, "
            f"{error:.2%} under '{light}', {_met(report, error)}; by "
            f"{gloss['rays'] / 1e6:.1f} M rays of their own"
        )
        metal = gloss.get("metal", 0)
        if metal > _LITTLE_METAL:
            yield (
                f"  metal seen in metal is not in it ({metal:.0%} of what these points mirror of "
                "the scene): there views may be 5 to 15 % off, most in hollows under bright lamps"
            )
    error = report["error"]
    if error is not None:
        rays = report["rays_a_point"]
        yield (
            f"{error:.2%} of relit colours, from the bounces ({rays} rays a point), "
            f"{_met(report, error)}"
        )
    enclosed = report.get("error_enclosed")
    if enclosed is not None:
        within = "within" if enclosed <= LOCAL * report["tolerance"] else "NOT within"
        yield (
            f"{enclosed:.2%} of the light in enclosed places, from the bounces, {within} "
            f"{LOCAL * report['tolerance']:.2%}"
        )


def _worst(item):
    """The largest relit error of a certificate, that of the matrix where there is no light."""
    return max((part["error"] for part in item["relit"].values()), default=item["matrix"]["error"])


def object_lines(objects, most=_MOST):
    """Lines on the objects of a bake: each, or the largest and a sum of the others.

    Parameters
    ----------
    objects : list of dict
        As a bake's report have them: name, n_corners, receives.
    most : int
        That are written out.
    """

    def role(item):
        return "receives" if item["receives"] else "casts and bounces only"

    shown, rest = objects, []
    if len(objects) > most:
        ranked = sorted(objects, key=lambda item: -item["n_corners"])
        shown, rest = ranked[:most], ranked[most:]
    for item in shown:
        yield f"  object  {item['name']}: {item['n_corners']:,} corners, {role(item)}"
    for kind in ("receives", "casts and bounces only"):
        counts = [item["n_corners"] for item in rest if role(item) == kind]
        if counts:
            yield f"  object  and {len(counts):,} more: {sum(counts):,} corners, {kind}"


def _met(report, error):
    tolerance = report["tolerance"]
    return f"{'within' if error <= tolerance else 'NOT within'} the tolerance of {tolerance:.2%}"


def _spared(skipped):
    if skipped.get("visibility_rays", 0) > 0:
        yield f"{skipped['visibility_rays'] / 1e6:.1f} M shadow rays"
    if skipped.get("gather_rays"):
        yield f"{skipped['gather_rays'] / 1e6:.1f} M bounce rays towards the open sky"
    if "bounces_below" in skipped:
        yield f"all bounces: they add at most {skipped['bounces_below']:.2%}"
    if skipped.get("grey"):
        yield "two of three channels of the bounces where the light is grey: all materials are"


def trial_lines(report):
    """The short table of what was tried on a sample of the points, and why one was chosen."""
    trials = report["trials"]
    width = max((len(trial["settings"]) for trial in trials), default=0)
    head = f"{'settings':{width}}"
    if trials:
        yield f"tried on a sample: method      {head}  error %  worst %       MB      ms"
    for trial in trials:
        if trial.get("failure"):
            figures = f"out: {trial['failure']}"
        else:
            figures = (
                f"{100 * trial['error']:7.2f}  {100 * trial['worst']:7.2f}  "
                f"{trial['megabytes']:7.1f}  {trial['milliseconds']:6.1f}"
            )
        yield f"                   {trial['method']:10}  {trial['settings']:{width}}  {figures}"
    yield f"chosen: {report['method']}, {report['why']}"


def compressed_lines(report):
    """Lines on a compressed form: what it is, how near, how large, how fast."""
    settings = ", ".join(f"{k} {v}" for k, v in report["settings"].items() if v is not None)
    settings = f" ({settings})" if settings else ""
    of = ", of the image" if report.get("of") == "image" else ""
    of += " with gloss" if "rows_error" in report else ""
    of = ", of what views show of gloss" if report.get("of") == "gloss" else of
    yield f"  method  {report['method']}{settings}{of}, {report['seconds']:.1f} s"
    yield (
        f"  error   {report['error']:.2%} of relit colours in the mean over {report['lights']} "
        f"lights{_and_views(report)} it was not chosen under, {report['worst']:.2%} under "
        f"{report['worst_light']}"
        f"{', within the tolerance' if report['tolerance_met'] else ''}"
    )
    if "rows_error" in report:
        yield (
            f"          {report['rows_error']:.2%} of these without any compression: lobes meet "
            "light in texels here, in finer detail on the exact way"
        )
    yield (
        f"  size    {report['bytes'] / 1e6:.1f} MB, {report['bits_a_coefficient']:.2f} bits a "
        "coefficient"
    )
    yield (
        f"  speed   {report['milliseconds']:.1f} ms a light in the median, "
        f"{report['milliseconds_worst']:.1f} ms the slowest"
        + (f"; {report['view_milliseconds']:.1f} ms a view" if "views" in report else "")
    )
    yield from (f"  note    {note}" for note in report.get("notes", ()))
    yield from (f"  MISSED  {line}" for line in missed(report))


def _and_views(report):
    return f" and {report['views']} views" if "views" in report else ""


def gloss_lines(report):
    """Lines on what `auto` made of a bake's gloss: its form, or why there is none."""
    if report.get("stored"):
        yield "gloss:"
        yield from compressed_lines(report)
    else:
        yield (
            f"gloss: by the field of incoming light; {report['method']} would be "
            f"{report['error']:.2%} off, {report['worst']:.2%} under {report['worst_light']}"
        )


def missed(report):
    """What was asked of a compressed form and is not kept, a line each."""
    if report["tolerance_met"] is False:
        yield (
            f"NOT within the tolerance of {report['tolerance']:.2%}: the error is "
            f"{report['error']:.2%}, {report['worst']:.2%} under the worst light; ask for less, "
            "or relight with --form exact"
        )
    asked = (report.get("asked") or {}).get("milliseconds")
    if asked is not None and report["milliseconds"] > asked:
        yield (
            f"NOT within {asked:g} ms: a light takes {report['milliseconds']:.1f} ms in the median"
        )
