"""Ways out of a bake, into what others open: a web page that relights it."""
