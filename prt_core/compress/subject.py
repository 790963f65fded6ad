"""What a compressed form is of: all points of a bake, or the pixels of its image.

All that tells the two apart is here. A form of points holds what they receive, and their albedo
comes after it. A pixel shows several points, so that their albedo is part of its row
(see `ImageRows`): what a form of pixels gives is radiance already. Pixels of a camera's image show
gloss as well, for their view is known (see `ViewRows`).
"""

import hashlib
import json
from dataclasses import dataclass

import numpy as np

from prt_core.errors import expect


@dataclass(frozen=True)
class Subject:
    """The points of a transport, or the pixels of an image that shows some of them.

    Attributes
    ----------
    transport : Transport
        Of all points.
    image : PointImage, optional
    reflections : tuple of Reflections
        What its points see, where they are to show gloss to the image's camera.
    """

    transport: object
    image: object = None
    reflections: tuple = ()

    @classmethod
    def of_bake(cls, bake, of):
        """That of a `bake`: its "points" or its "image".

        Raises
        ------
        PRTError
            The bake has no image.
        """
        expect(
            of == "points" or bake.scene.image is not None,
            "image: this bake holds none; bake with --camera-pixels, --geometry-image or --atlas",
        )
        if of == "points":
            return cls(bake.transport)
        image = bake.scene.image
        # An image of a surface is looked at by nobody.
        seen = getattr(bake, "reflections", ()) if image.camera is not None else ()
        return cls(bake.transport, image, tuple(seen))

    @property
    def shows_gloss(self):
        """Whether the view is baked in."""
        return bool(self.reflections)

    @property
    def name(self):
        """ "points" or "image"."""
        return "points" if self.image is None else "image"

    @property
    def n_rows(self):
        """How many points or pixels there are."""
        if self.image is None:
            return self.transport.n_points
        return self.image.height * self.image.width

    @property
    def read_bits(self):
        """The `Transport` whose bits a form may look up: None for pixels, which have none."""
        return self.transport if self.image is None else None

    def fingerprint(self):
        """A digest of all that the colours depend on: the same for the same subject only."""
        digest = self.transport.fingerprint()
        if self.image is None:
            return digest
        digest = f"{digest} {self.image.digest()}"
        return f"{digest} {self._seen_digest()}" if self.reflections else digest

    def _seen_digest(self):
        digest = hashlib.blake2b(digest_size=16)
        digest.update(json.dumps(self.image.camera.to_dict()).encode())
        for part in self.reflections:
            for array in (part.points, part.start, part.block, part.met, part.share):
                digest.update(np.ascontiguousarray(array))
        return digest.hexdigest()

    def radiance(self, product):
        """The view stage of a form: radiance of what its `product` gives.

        Parameters
        ----------
        product : (n_rows, 3) float32

        Returns
        -------
        (n_rows, 3) float32
            Linear Rec.709.
        """
        return self.transport.exit_radiance(product).toward() if self.image is None else product

    def radiance_of_points(self, received, sent=None):
        """What is seen of it, from what all points of the transport receive.

        Parameters
        ----------
        received : (n_points, 3) float32
            With all bounces.
        sent : (n_points, 3) float32, optional
            Radiance that points send out of their own.

        Returns
        -------
        (n_rows, 3) float32
        """
        radiance = self.transport.exit_radiance(received).toward()
        radiance = radiance if sent is None else radiance + sent
        return radiance if self.image is None else self.image.pixels(radiance).reshape(-1, 3)

    def shaped(self, radiance):
        """Radiance of rows, as an image where it is one: (height, width, 3)."""
        if self.image is None:
            return radiance
        return self.image.finished(radiance.reshape(self.image.height, self.image.width, -1))
