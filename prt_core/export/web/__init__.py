"""A bake as a web page: opened from disk, relit by the browser."""

from prt_core.export.web.write import WebSettings, write_web_steps

__all__ = ["WebSettings", "write_web_steps"]
