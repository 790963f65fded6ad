"""Outputs of several lights, one set of each, as lightmaps of a day and a night are used."""

from argparse import Namespace
from pathlib import Path

from prt_core.bake import load
from prt_core.errors import expect
from prt_core.light import EnvironmentMap


def each_light(options, lights, outputs, relight, expect_request):
    """Relight once for each light; outputs have its name behind their own.

    Parameters
    ----------
    options : argparse.Namespace
        Of `prt relight`.
    lights : sequence of str
        Images, or "world".
    outputs : iterable of str
        Names of the options that are paths to write to.
    relight : callable(argparse.Namespace) -> int
    expect_request : callable(argparse.Namespace)
        Refuses what cannot be done.

    Returns
    -------
    int
        The exit code.

    Raises
    ------
    PRTError
        Two lights have the same name, there is only one to be told apart, or an image cannot be
        read; nothing is written then.
    """
    asked = [(Path(light).stem, {"light": light}) for light in lights]
    if options.apart:
        alone = {"lamps": False, "emission": ["none"]}
        if not options.sharp_sun:
            alone["lamp_samples"] = None
        asked = [(name, {**light, **alone}) for name, light in asked] + _apart(options)
    names = [_safe(name) for name, _ in asked]
    # Some systems take capitals for small letters.
    folded = [name.casefold() for name in names]
    twice = sorted({name for name in names if folded.count(name.casefold()) > 1})
    expect(
        not twice,
        f"--light: {', '.join(twice)}: the name of several lights, after which their outputs are "
        "called; rename one",
    )
    requests = []
    for name, (_, changed) in zip(names, asked, strict=True):
        request = Namespace(**{**vars(options), **changed, "apart": False})
        for output in outputs:
            path = getattr(options, output)
            setattr(request, output, None if path is None else str(_named(path, name)))
        requests.append(request)
        # All of them before the work on the first; it fills in what the work asks again.
        expect_request(Namespace(**vars(request)))
    # Of the first it is said at once.
    expect_readable(lights[1:])
    for request in requests:
        relight(request)
    return 0


def expect_readable(environments):
    """Raise `PRTError` where one cannot be read, so that it is said before outputs are written.

    Parameters
    ----------
    environments : iterable
        As `Lighting` takes them: those that are no files are passed over.
    """
    for environment in environments:
        if isinstance(environment, str | Path) and environment != "world":
            EnvironmentMap.read(environment)


def _apart(options):
    """(name, options) of the lamps and of what emits light."""
    asked, rest = [], {"light": None, "rotate": None, "sharp_sun": False, "form": "auto"}
    if options.lamps:
        lamps = [lamp for lamp in load(options.bake).lamps if not lamp.of_world]
        expect(lamps, "--lamps: the baked scene had no lamps that render")
        asked += [
            (lamp.name or f"lamp {number + 1}", {**rest, "lamps": [lamp], "emission": ["none"]})
            for number, lamp in enumerate(lamps)
        ]
    if options.emission:
        asked.append(("emission", {**rest, "lamps": False, "lamp_samples": None}))
    return asked


def _named(path, name):
    path = Path(path)
    return path.with_name(f"{path.stem}_{name}{path.suffix}")


def _safe(name):
    """A name as part of a file's name."""
    return "".join(c if c.isalnum() or c in "-_. " else "_" for c in name).strip() or "light"
