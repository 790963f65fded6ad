"""`Relighter`: one bake under changing light, keeping what did not change."""

from pathlib import Path

import numpy as np

from prt_core.compress.subject import Subject
from prt_core.errors import (
    expect,
    expect_flag,
    expect_kind,
    expect_number,
    expect_offers,
    expect_one_of,
    expect_whole,
)
from prt_core.evaluate.view import CameraRays
from prt_core.light.images import reads_in_threads
from prt_core.relight.emission import EmittedLight
from prt_core.relight.environments import Environments
from prt_core.relight.fixed_view import FixedView
from prt_core.relight.forms import FormInUse
from prt_core.relight.gloss import Gloss
from prt_core.relight.gloss_form import GlossFormInUse
from prt_core.relight.lamps import LampLight, chosen_lamps, world_suns
from prt_core.relight.lighting import Lighting, lighting_of
from prt_core.relight.sent_light import SentLight, exposed
from prt_core.runtime.main_thread import maybe_in_thread
from prt_core.runtime.progress import run
from prt_core.runtime.renamed import renamed, renamed_keyword
from prt_core.transport import View
from prt_core.transport.incoming_field import FINER

FORMS = ("auto", "exact", "compressed")


class Relighter:
    """Relights one bake again and again: what an animation, a slider or a game loop needs.

    The environment on the cube map, its received light and each lamp's received light are kept
    until what they depend on changes; a new strength, exposure or number of bounces costs only
    the bounces. The colours are those of `relight`, bit by bit, whatever was asked before.

    Parameters
    ----------
    bake : Bake
    caster : str
        For the shadow rays of lamps and sharp suns; made when first needed.
    form : {"auto", "exact", "compressed"}
        What light from far away is multiplied with. `auto`: the compressed form where the bake
        has one that is its own and the bounces are those of the bake, else the bake itself.
    progressive : bool
        Each light adds what changed most since the one before, in a compressed form by Haar
        lighting (see `IncrementalLighting`): colours then depend on what was asked before, and
        come nearer while the light moves little.

    Attributes
    ----------
    used : str
        "exact" or "compressed": what the last colours were made with.
    gloss_used : str
        The method of the compressed gloss that the last view was made with; empty for none.
    why : str
        Why `auto` did not use a compressed form; empty where it did.
    notes : tuple of str
        What is to be said of the image last read (see `read_picture`).
    received : (n_points, 3) float32
        Irradiance / pi, exposed, of the last light that points were shown under: the colours
        without what surfaces make of it. None before there was any.
    """

    @renamed_keyword(transport="form")
    def __init__(self, bake, caster="auto", form="auto", progressive=False):
        # A `Bake`; that module is on a floor above this one.
        parts = "scene", "transport", "make_caster"
        expect_offers("bake", bake, parts, "what `load` returns")
        self.bake, self.form = bake, expect_one_of("form", form, FORMS)
        expect_kind("caster", caster, str, "the name of one")
        self.used, self.gloss_used, self.notes, self.received = "exact", "", (), None
        self._compressed = FormInUse(bake, expect_flag("progressive", progressive))
        self._gloss_form = GlossFormInUse(bake)
        self._environments = Environments(bake)
        self._lamps = LampLight(bake, caster)
        self._emitted = EmittedLight(bake)
        self._caster, self._gloss, self._sent, self._fixed = caster, None, None, None

    def radiance(self, light=None, *, of="points", view=None, **keywords):
        """(n_points, 3) float32 radiance of all points, or (height, width, 3) of the image.

        Parameters
        ----------
        light : Lighting, or what its environment may be, optional
        of : {"points", "image"}
            See `steps`.
        view : View, optional
            See `steps`.
        **keywords
            The other fields of `Lighting`.
        """
        return run(self.steps(lighting_of(light, **keywords), of=of, view=view))

    relight = renamed("relight", "radiance")

    def picture(self, rays, light=None, *, background=None, **keywords):
        """What a camera sees, with gloss of each pixel's own normal and view, and mirrors by rays.

        Parameters
        ----------
        rays : CameraRays
        light : Lighting, or what its environment may be, optional
        background : callable((m, 3) directions) -> (m, 3), optional
            What is behind the scene; default: the image of the light (see `sky`).
        **keywords
            The other fields of `Lighting`.

        Returns
        -------
        (height, width, 3) float32
            Linear Rec.709 radiance.

        Raises
        ------
        PRTError
            The bake has no gloss.
        """
        expect_kind("rays", rays, CameraRays)
        lighting = lighting_of(light, **keywords)
        values = run(self.steps(lighting, view=rays))
        return rays.picture_of(values, background or self.sky(lighting))

    def steps(self, lighting, pace=None, of="points", view=None):
        """Relight, as a generator of `Progress`.

        Parameters
        ----------
        lighting : Lighting
        pace : float, optional
            Seconds a step may take; then the arithmetic runs beside the caller, in a thread.
        of : {"points", "image"}
            What is shown: all points, or the image that was baked. A compressed form of the
            image shows nothing else. A camera's image of a bake with gloss shows that.
        view : View or CameraRays, optional
            From where points are looked at: adds what the lobes of a bake with gloss reflect
            towards it. Of a picture's rays the samples are looked at, not the points. Default:
            only what leaves evenly to all sides, with gloss as a colour.

        Returns
        -------
        (n_points, 3), (height, width, 3) or (n_lit, 3) float32
            Linear Rec.709 radiance; the last of the samples `lit` of a picture's rays.
        """
        expect_kind("lighting", lighting, Lighting)
        if pace is not None:
            expect_number("pace", pace, above=0)
        subject = Subject.of_bake(self.bake, expect_one_of("of", of, ("points", "image")))
        if view is not None:
            expect_kind("view", view, (View, CameraRays))
            expect(of == "points", "view: an image that was baked has its own; leave out the view")
        # Pixels with gloss are worked out as points that the camera sees.
        baked_view = view is None and subject.shows_gloss
        shown, subject = subject, Subject(self.bake.transport) if baked_view else subject
        lamps, image = chosen_lamps(self.bake, lighting), lighting.environment
        apart = pace and isinstance(image, Path) and reads_in_threads(image)
        light = yield from maybe_in_thread(apart, "image", self._environments.read, lighting)
        self.notes = getattr(light, "notes", ())
        evaluator = None
        if light is not None and self.form != "exact":
            unread, work = pace and not self._compressed.is_read, (self.form, lighting.bounces, of)
            evaluator = yield from maybe_in_thread(
                unread, "compressed form", self._compressed.evaluator, *work
            )
        self.used = "exact" if evaluator is None else "compressed"
        work = (self._environments.distant, light, lighting, evaluator)
        distant, sun = yield from maybe_in_thread(pace, "light", *work)
        lamps += [] if sun is None else [sun]
        parts = yield from self._lamps.steps(lamps, lighting.lamp_samples, pace)
        # What belongs to the environment has its strength, and comes last.
        n_suns = len(world_suns(self.bake, lighting)) + (sun is not None)
        factors = [lighting.lamp_factor] * (len(parts) - n_suns) + [lighting.strength] * n_suns
        emitted = yield from maybe_in_thread(pace, "emission", self._emitted.of, lighting)
        if distant is not None and evaluator is None:
            parts, factors = [distant, *parts], [lighting.strength, *factors]
        radiance = pixels = None
        received_in_all = []
        if evaluator is not None:
            own = self._compressed.read().of == of
            if own and baked_view:
                pixels = shown.shaped(exposed(distant, lighting))
            else:
                radiance = (subject.radiance if own else subject.radiance_of_points)(distant)
                received_in_all.append(distant)
        if parts or (evaluator is None and emitted is None):
            # Of what a form of pixels does not hold.
            work = (self._with_bounces, parts, factors, lighting.bounces)
            received = yield from maybe_in_thread(pace, "bounces", *work)
            exact = subject.radiance_of_points(received)
            radiance = exact if radiance is None else exact + radiance
            received_in_all.append(received)
        if emitted is not None:
            shining = subject.radiance_of_points(*emitted)
            radiance = shining if radiance is None else shining + radiance
            received_in_all.append(emitted[0])
        if of == "points":
            self.received = exposed(sum(received_in_all), lighting)
        if pixels is not None and radiance is None:
            return pixels
        gloss_form = None
        if isinstance(view, View) and self.form != "exact" and not (lamps or emitted):
            as_baked = "baked", self.bake.transport.bounces
            applies = light is not None and lighting.bounces in as_baked
            gloss_form = self._gloss_form.read() if applies else None
        self.gloss_used = "" if gloss_form is None else gloss_form.model.name
        if view is not None or baked_view:
            if self._gloss is None and gloss_form is None:
                work = Gloss, self.bake, self._caster
                self._gloss = yield from maybe_in_thread(pace, "gloss", *work)
            first = len(parts) - len(lamps)
            lit = zip(parts[first:], factors[first:], strict=True)
            lit = [part * np.float32(factor) for part, factor in lit]
            lit = self._lamps.shown(lamps, lighting.lamp_samples, lit)
            own = None if emitted is None else emitted[1]
            self._sent = None
            sky = lighting if pixels is None else None
            work = (self._reflecting, radiance, sum(received_in_all), own, lighting, sky, sun, lit,
                    gloss_form)  # fmt: skip
            self._sent = yield from maybe_in_thread(pace, "gloss", *work)
            if isinstance(view, CameraRays):
                # Rays of mirrors may be Blender's, which are cast where the caller is.
                return self._sent.of_pixels(view)
            if not baked_view:
                return (yield from self.view_steps(view, pace))
            radiance = yield from self.view_steps(self._camera_view(), pace)
            # It is the light of what a form does not hold, which no other view is to be under.
            self._sent = self._sent if pixels is None else None
            exact = shown.image.pixels(radiance)
            return exact if pixels is None else pixels + exact
        return subject.shaped(exposed(radiance, lighting))

    def map_views_steps(self, pace=None):
        """Make maps of views of what has wide lobes, for views to come under the light.

        A generator of `Progress`; where it is dropped, the next call goes on. A view is then a few
        look-ups a point (see `transport.view_map`). `pace` and errors: see `view_steps`.
        """
        expect(self._sent is not None, "view: no light is known yet; relight with a view first")
        yield from self._sent.gloss.map_views_steps(pace)

    @property
    def maps_views(self):
        """Whether `map_views_steps` came to its end under the light that is known."""
        return self._sent is not None and self._sent.gloss.maps_views

    def view_steps(self, view, pace=None, every=1, mapped=False):
        """Another view under the same light, as a generator of `Progress`: only lobes are new.

        The light is that of the last `steps` with a view that came to its end; as long as nothing
        is left out or looked up, the colours are those that it would give, bit by bit.

        Parameters
        ----------
        view : View
        pace : float, optional
            As for `steps`.
        every : int
            For a view that moves: evaluate lobes at one of so many points, which others follow.
        mapped : bool
            Look wide lobes up in the maps of views, where these are made (see `map_views_steps`).

        Returns
        -------
        (n_points, 3) float32
            Linear Rec.709 radiance.

        Raises
        ------
        PRTError
            There was no light.
        """
        expect_kind("view", view, View)
        expect_whole("every", every, 1)
        expect_flag("mapped", mapped)
        expect(self._sent is not None, "view: no light is known yet; relight with a view first")
        return (yield from self._sent.toward_steps(view, pace, every, mapped))

    @property
    def lit(self):
        """The `Lighting` that `view_steps` are under; None where no light is known yet."""
        return None if self._sent is None else self._sent.lighting

    @property
    def mirror_rays(self):
        """How many rays the mirrors of the last `picture` cast."""
        return 0 if self._gloss is None else self._gloss.mirror_rays

    def has_lamps(self, lighting):
        """Whether the lamps of a `Lighting` need no shadow rays, having been asked for before.

        Parameters
        ----------
        lighting : Lighting

        Returns
        -------
        bool
            False where a sun of the image has rays of its own.
        """
        expect_kind("lighting", lighting, Lighting)
        lamps = chosen_lamps(self.bake, lighting)
        return not lighting.sharp_sun and self._lamps.has(lamps, lighting.lamp_samples)

    def sky(self, lighting):
        """What is seen behind the scene, as a function of (m, 3) directions to (m, 3) radiance.

        Parameters
        ----------
        lighting : Lighting

        Returns
        -------
        Sky, or None
            For `CameraRays.picture`; None, which is black, where there is no image.
        """
        return self._environments.sky(lighting)

    def compressed(self):
        """The `CompressedForm` that would be used, or None: then `why` says why not."""
        return self._compressed.read()

    @property
    def why(self):
        """Why `auto` did not use a compressed form; empty where it did."""
        return self._compressed.why

    def _with_bounces(self, parts, factors, bounces):
        total = np.zeros((self.bake.transport.n_points, 3), np.float32)
        for part, factor in zip(parts, factors, strict=True):
            total += part if factor == 1 else part * np.float32(factor)
        return self.bake.transport.with_bounces(total, bounces)

    def _camera_view(self):
        if self._fixed is None:
            self._fixed = FixedView(self.bake, self._gloss)
        return self._fixed.view

    def _reflecting(self, radiance, received, own, lighting, distant, sun, lamps, form):
        """The `SentLight` of a light, which lobes reflect from now on.

        `radiance` is what leaves evenly to all sides, with what stands in for gloss; `distant` the
        lighting whose light from far away is reflected, or None; `form` the `GlossForm` that
        reflects it, or None.
        """
        even = radiance - self.bake.transport.materials.stand_in * received
        own = 0 if own is None else own
        if form is not None:
            lit = form.light(self._environments.on_texels(distant))
            return SentLight(even, own, lamps, lighting, lit)
        texels = sky = detailed = None
        if distant is not None:
            # Lights that are lamps here have their highlights from there, not from texels.
            texels = self._environments.on_texels(distant, without_sun=sun is not None)
            sky = self._environments.mirrored_sky(distant) if sun is None else None
            detailed = self._environments.on_texels(distant, sun is not None, FINER)
        sent = radiance + self._gloss.more * received
        self._gloss.light(texels, sent, even, sky, detailed, lamps=lamps)
        return SentLight(even, own, lamps, lighting, self._gloss)

    def replace(self, bake):
        """Relight another state of the bake, as it comes nearer while it is made.

        What does not depend on it is kept: images, and the lamps' light where the points are the
        same; a compressed form and gloss are not.

        Parameters
        ----------
        bake : Bake
        """
        expect_offers("bake", bake, ("scene", "transport", "make_caster"), "a Bake")
        if bake is self.bake:
            return
        self._let_go()
        self._gloss_form, self._compressed = GlossFormInUse(bake), FormInUse(bake)
        self._environments.replace(bake)
        self._lamps.replace(bake)
        self._emitted, self.received, self.bake = EmittedLight(bake), None, bake

    def close(self):
        """Let go of everything."""
        self._let_go()
        self._environments.close()
        self._lamps.close()

    def _let_go(self):
        """Of all that belongs to one state of the bake."""
        for part in (self._gloss, self._gloss_form, self._compressed, self._emitted):
            if part is not None:
                part.close()
        self._gloss = self._sent = self._fixed = None
