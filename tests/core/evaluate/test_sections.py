from tests.benchmarks.sections import write_section


def test_a_section_is_replaced_alone_and_a_new_one_comes_last(tmp_path):
    path = tmp_path / "page.md"
    path.write_text("# P\nabout\n\n## A\n*then*\n\n1\n\n2\n\n## A b\n*then*\n\n3\n")
    write_section(path, "A", ["one", "", "two"], "*now*")
    write_section(path, "C", ["", "four"], "*now*")
    assert path.read_text() == (
        "# P\nabout\n\n## A\n*now*\n\none\n\ntwo\n\n## A b\n*then*\n\n3\n\n## C\n*now*\n\nfour\n"
    )


def test_figures_that_are_still_the_same_keep_their_date(tmp_path):
    path = tmp_path / "page.md"
    path.write_text("# P\n\n## A\n*then*\n\n1\n\n2\n\n## B\n*then*\n\n3\n")
    before = path.read_text()
    write_section(path, "A", ["1", "", "2", ""], "*now*")
    assert path.read_text() == before
    write_section(path, "B", ["4"], "*now*")
    assert path.read_text() == before.replace("*then*\n\n3", "*now*\n\n4")
