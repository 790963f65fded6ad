"""The cameras of a baked scene by name: those of bakes and of light fields."""

from prt_core.errors import expect, expect_kind


class NamedCameras:
    """What has the scene's own `camera`, or None, and all its `cameras` by name."""

    def camera_named(self, name):
        """A camera of the baked scene.

        Parameters
        ----------
        name : str
            Of one of its `cameras`; "camera" is the scene's own.

        Returns
        -------
        Camera

        Raises
        ------
        PRTError
            There is none of that name: the message says which there are.
        """
        expect_kind("camera", name, str, "the name of one")
        if name == "camera" and self.camera is not None:
            return self.camera
        known = ", ".join(f"'{each}'" for each in sorted(self.cameras))
        expect(
            name in self.cameras,
            f"camera: the baked scene has none called '{name}' whose lens is followed; "
            + (f"it has {known}" if known else "it has none by name")
            + (" and 'camera', its own" if self.camera is not None else ""),
        )
        return self.cameras[name]
