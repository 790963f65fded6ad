"""What a stored compressed form is, how it is read, and what relights from it."""

from dataclasses import dataclass, field

from prt_core.compress import HaarLighting, IncrementalLighting, method_named, method_names
from prt_core.compress.subject import Subject
from prt_core.errors import PRTError, expect, system_errors
from prt_core.runtime.renamed import renamed
from prt_core.store import AGAIN, BakeStore, compressed_attributes, damage_as_error, read_compressed


@dataclass
class CompressedForm:
    """A compressed form in memory.

    Attributes
    ----------
    method : str
    model : Compressor
        Fitted.
    attributes : dict
        Settings, size, error and time (see `compress_steps`).
    """

    method: str
    model: object
    attributes: dict = field(default_factory=dict)

    @property
    def of(self):
        """What it holds: "points" or "image"."""
        return self.attributes.get("of", "points")

    facts = renamed("facts", "attributes")

    def evaluator(self, subject):
        """What gives its `product(light)` quickest, with all bounces; `subject`: what it is of."""
        return method_named(self.method).evaluator(self.model, subject.read_bits)


def load_compressed(bake):
    """The compressed form of a bake, or why there is none to use.

    Returns
    -------
    CompressedForm or None, str
        None where there is none or it is of another bake: the string says so.

    Raises
    ------
    PRTError
        It is damaged.
    """
    if bake.path is None:
        return None, "the bake is not on disk"
    with system_errors(bake.path):
        return _load(bake)


def _load(bake):
    store = BakeStore(bake.path)
    attributes = compressed_attributes(store)
    if attributes is None:
        return None, "there is no compressed form; make one with 'prt compress'"
    if attributes.get("method") not in method_names():
        return None, f"its method {attributes.get('method')!r:.40} is not known here; {AGAIN}"
    of = "image" if attributes.get("of") == "image" and bake.scene.image is not None else "points"
    subject = Subject.of_bake(bake, of)
    if attributes.get("fingerprint") != subject.fingerprint():
        return None, f"the compressed form is of another state of the bake; {AGAIN}"
    state = read_compressed(store, attributes)
    expect(
        (state.get("n_points"), state.get("n_directions"))
        == (subject.n_rows, bake.transport.n_directions),
        f"{bake.path}: its compressed form has another number of points or directions; {AGAIN}",
    )
    with damage_as_error(bake.path, "its compressed form", AGAIN):
        model = method_named(attributes["method"]).kind.from_state(state)
    return CompressedForm(attributes["method"], model, attributes), ""


class FormInUse:
    """The compressed form that one bake is relit from, read when it is first needed.

    Parameters
    ----------
    bake : Bake
    progressive : bool
        See `Relighter`.

    Attributes
    ----------
    why : str
        Why it was not used the last time; empty where it was.
    """

    def __init__(self, bake, progressive=False):
        self._bake, self._progressive, self.why = bake, progressive, ""
        self.close()

    def close(self):
        """Let go of it."""
        self._form = None

    @property
    def is_read(self):
        """Whether it is known if there is one."""
        return self._form is not None

    def read(self):
        """The `CompressedForm`, or None: then `why` says why not."""
        transport = self._bake.transport
        # Materials may be replaced after the bake: then the form is of another one.
        if self._form is None or (
            self._form[0] is not None and self._form[2] is not transport.albedo
        ):
            form, self.why = load_compressed(self._bake)
            evaluator = None if form is None else self._evaluator_of(form)
            self._form = form, evaluator, transport.albedo
        return self._form[0]

    def _evaluator_of(self, form):
        if not self._progressive:
            return form.evaluator(Subject.of_bake(self._bake, form.of))
        expect(
            isinstance(form.model, HaarLighting),
            f"progressive: adds to a compressed form by haar, this one is by {form.method}; "
            "run 'prt compress --method haar' first",
        )
        return IncrementalLighting(form.model)

    def evaluator(self, form, bounces, of="points"):
        """What relights it; None where the exact way is to be taken.

        Parameters
        ----------
        form : {"auto", "compressed"}
            Whether the exact way may be taken.
        bounces
            As `Relighter` takes them.
        of : {"points", "image"}
            What is to be shown. A form of points shows the image as well.
        """
        try:
            loaded = self.read()
        except PRTError as error:
            if form == "compressed":
                raise
            loaded, self.why = None, str(error)
            self._form = None, None, self._bake.transport.albedo
        applies = bounces in ("baked", self._bake.transport.bounces)
        if loaded is not None and not applies:
            loaded, self.why = None, f"it holds the bounces of the bake, not {bounces}"
        if loaded is not None and loaded.of not in (of, "points"):
            loaded, self.why = None, f"it is of the {loaded.of}, not of the {of}"
        expect(
            loaded is not None or form != "compressed",
            f"form: the compressed form cannot be used: {self.why}",
        )
        if loaded is None:
            return None
        self.why = ""
        return self._form[1]
