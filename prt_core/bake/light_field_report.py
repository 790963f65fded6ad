"""A light field's report in words, for people."""

from prt_core.bake.report_lines import origin_lines


def light_field_lines(path, report, settings=None, origin=None):
    """Lines on a light field: what it holds, what it cost, and how near the truth it is.

    Parameters
    ----------
    path : str or Path
    report : dict
        See `capture_light_field`.
    settings : dict, optional
        What it was captured with.
    origin : dict of str -> str, optional
        See `LightField`.
    """
    rows, columns = report["angles"]
    lights, speed = report["lights"], report["paths_per_second"]
    yield (
        f"{path}: {report['points']:,} points, {rows} x {columns} directions, "
        f"{len(lights)} light{'s' if len(lights) > 1 else ''} ({', '.join(lights)})"
    )
    rate = "" if speed is None else f", {speed / 1e3:,.0f} k paths a second"
    yield from origin_lines(origin)
    yield (
        f"  paths   {report['paths'] / 1e6:.1f} M by {report['camera']}, {report['samples']} a "
        f"direction{rate}"
    )
    yield f"  time    {report['seconds']:.1f} s"
    yield f"  size    {report['bytes'] / 1e6:.1f} MB"
    met = "; the tolerance is not met" if report["tolerance_met"] is False else ""
    yield f"  noise   {report['noise']:.2%} between two seeds, relative L2 of one{met}"
    if len(lights) > 1:
        yield f"  lights  sum to the whole within {report['apart']:.1e} of its largest value"
    if report["denoised"] is not None:
        yield f"  denoise {report['denoised']:.0%} of points and lights; elsewhere energy was lost"
    if settings is not None:
        text = ", ".join(f"{key} {value}" for key, value in settings.items())
        yield f"  made    by prt {report['versions']['prt_core']} with {text}"
    yield from (f"  note    {message}" for message in report["messages"])


def compressed_field_lines(report):
    """Lines on a light field's compressed form: what it is, how near and how large.

    Parameters
    ----------
    report : dict
        See `compress_light_field_steps`.
    """
    settings = ", ".join(f"{k} {v}" for k, v in report["settings"].items() if v is not None)
    yield f"  method  {report['method']} ({settings}), {report['seconds']:.1f} s"
    if report["psnr"] is None:
        yield "  error   none"
    else:
        yield (
            f"  error   {report['error']:.2%} of the white level, {report['white']:.3g}, for each "
            f"direction; {report['psnr']:.1f} dB below a peak of {report['peak']:.3g} for each "
            f"point, {report['psnr_per_sample']:.1f} dB for each direction"
        )
    raw = report["raw_nbytes"]
    yield (
        f"  size    {report['coded_nbytes'] / 1e6:.3f} MB coded, "
        f"{report['coded_nbytes'] / raw:.2%} of {raw / 1e6:.1f} MB; at fixed width "
        f"{report['nbytes'] / 1e6:.3f} MB, {report['nbytes'] / raw:.2%}"
    )
