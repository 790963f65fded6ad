"""Pages that tests open, and what they read from them."""

import base64

import numpy as np

_READ = """(() => {
  const bytes = new Uint8Array(PRT.page.gpu.radiance().buffer);
  let text = "";
  for (let i = 0; i < bytes.length; i += 32768)
    text += String.fromCharCode(...bytes.subarray(i, i + 32768));
  return btoa(text);
})()"""


def radiance_on(browser):
    """(n_points, 3) float32: colours of the page's points, read back from the graphics card."""
    data = base64.b64decode(browser.run(_READ))
    return np.frombuffer(data, np.float32).reshape(-1, 4)[:, :3]


def said_on(browser):
    """What the page says in its message."""
    return browser.run("document.getElementById('said').textContent")


def milliseconds(browser, turns):
    """The least time of the processor for a light that is turned, of so many turns."""
    return browser.run(
        f"Math.min(...[...Array({turns}).keys()].map(k => (PRT.page.turn = 7 * k, "
        "PRT.page.relight())))"
    )


def radiance_picture(image):
    """Pixels (height, width, 3) as an .hdr file without runs: its bytes, pixels, codes, header."""
    most = image.max(axis=-1)
    exponent = np.where(most > 0, np.floor(np.log2(np.maximum(most, 1e-30))) + 1, -128)
    codes = np.floor(image / np.exp2(exponent - 8)[..., None])
    coded = np.concatenate([codes, exponent[..., None] + 128], axis=-1).astype(np.uint8)
    back = coded[..., :3] * np.exp2(coded[..., 3:].astype(np.float32) - 136)
    head = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % image.shape[:2]
    return head + coded.tobytes(), back.astype(np.float32), coded, head


def eye_on(browser):
    """(3,) float64: where the page looks from, in the scene's frame."""
    return np.array(browser.run("[...PRT.page.orbit.matrices(1).eye]"))
