"""Access to Blender, where its module is installed: its files, and the lights it comes with."""

from prt_core.errors import PRTError, expect, expect_path, system_errors
from prt_core.light import EnvironmentMap


def import_bpy():
    """The bpy module, with the core's Blender side loaded.

    Raises
    ------
    PRTError
        It is not installed for this Python.
    """
    try:
        # Makes its ray casters known as well.
        from prt_core.blender import bpy
    except ImportError as error:
        raise PRTError(
            f"bpy: Blender's module cannot be loaded ({error}); pip install 'prt-core[blender]' "
            "or run inside Blender"
        ) from error
    return bpy


def open_blend(path):
    """Open a .blend file in this process's Blender.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    list of str
        What Blender could not read of a file that it opened all the same.

    Raises
    ------
    PRTError
        bpy is not installed, or the file cannot be opened.
    """
    path = expect_blend(path)
    bpy = import_bpy()
    opened = []

    @bpy.app.handlers.persistent
    def note(*_):
        opened.append(True)

    bpy.app.handlers.load_post.append(note)
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path.resolve()), load_ui=False)
    except RuntimeError as error:
        # Blender also raises where it read the file but for a part of it.
        reason = " ".join(str(error).removeprefix("Error: ").split())
        expect(opened, f"{path}: Blender cannot open it ({reason})")
        return [f"{path.name}: Blender opened it, but reports: {reason}"]
    finally:
        bpy.app.handlers.load_post.remove(note)
    return []


def expect_blend(path):
    """The path of a .blend file that is there.

    Raises
    ------
    PRTError
        It is not, or is something else.
    """
    path = expect_path("scene", path)
    with system_errors(path):
        expect(path.is_file(), f"{path}: there is no such .blend file")
    expect(path.suffix == ".blend", f"{path}: expected a .blend file")
    return path


def studio_lights(every=True):
    """The environments that come with Blender (CC0).

    Parameters
    ----------
    every : bool
        All of them, or those that bakes are certified under.

    Returns
    -------
    dict of str -> EnvironmentMap

    Raises
    ------
    PRTError
        Blender's module, or the images, are not there.
    """
    import_bpy()
    from prt_core.blender.studio import ALL, NAMES, studio_paths

    paths = studio_paths(ALL if every else NAMES)
    return {name: EnvironmentMap.read(path) for name, path in paths.items()}
