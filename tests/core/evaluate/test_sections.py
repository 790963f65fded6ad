from tests.benchmarks.sections import write_section


def test_parts_measured_at_another_time_stay(tmp_path):
    path = tmp_path / "R.md"
    path.write_text("# R\n\n## A\na\n\n### one\n1\n\n### two\n2\n\n### three\n3\n\n## B\nb\n")
    write_section(path, "## A", ["new", "", "### three", "drei", "### one", "eins"], keep=True)
    assert path.read_text() == (
        "# R\n\n## A\nnew\n\n### three\ndrei\n\n### one\neins\n\n### two\n2\n\n## B\nb\n"
    )
    write_section(path, "## A", ["whole"])
    write_section(path, "## C", ["c"], keep=True)
    assert path.read_text() == "# R\n\n## A\nwhole\n\n## B\nb\n\n## C\nc\n"
