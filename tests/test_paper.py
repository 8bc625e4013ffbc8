"""Every equation has a home whose docstring names it, and a test that exists."""

import ast
import json
import re
from pathlib import Path

import pytest

from fullam import paper
from fullam.cli import main
from fullam.exceptions import UnknownName

ROOT = Path(__file__).parents[1]
NUMBERS = range(1, 36)


def numbers_named(docstring):
    """Numbers after "eq." or "eqs.": single, listed, and ranges "(22)-(25)"."""
    named = set()
    flat = " ".join(docstring.split())
    for group in re.findall(r"[Ee]qs?\. (\(\d+\)(?:(?:-|, | and )?\(\d+\))*)", flat):
        for first, last in re.findall(r"\((\d+)\)(?:-\((\d+)\))?", group):
            named |= set(range(int(first), int(last or first) + 1))
    return named


def test_numbers_named_reads_lists_and_ranges():
    assert numbers_named("Eqs. (22)-(25), and eq. (7); also (9).") == {7, 22, 23, 24, 25}
    assert numbers_named("eqs. (1) and (3)") == {1, 3}


def test_the_paper_has_thirty_five_equations():
    assert list(paper.EQUATIONS) == list(NUMBERS)


@pytest.mark.parametrize("number", NUMBERS)
def test_equation_has_a_home_that_names_it(number):
    equation = paper.equation(number)
    assert equation.number == number
    assert equation.statement
    for name, home in zip(equation.functions, equation.resolve(), strict=True):
        assert number in numbers_named(home.__doc__ or ""), f"{name} does not name eq. ({number})"


@pytest.mark.parametrize("number", NUMBERS)
def test_equation_has_a_test(number):
    equation = paper.equation(number)
    assert equation.tests
    for place in equation.tests:
        file, name = place.split("::")
        tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
        assert name in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_errata_name_equations_that_exist_and_differ_from_print():
    for erratum in paper.ERRATA:
        assert set(erratum.equations) <= set(NUMBERS)
        assert erratum.printed != erratum.used
        assert erratum.why


def test_errata_are_found_from_their_equation():
    assert [erratum.where for erratum in paper.equation(4).errata] == ["(4)", "Table 1"]
    assert "(20), force row" in [erratum.where for erratum in paper.equation(20).errata]
    assert paper.equation(8).errata == ()


@pytest.mark.parametrize("number", range(1, 36))
def test_latex_states_what_the_statement_states(number):
    row = paper.equation(number)
    for part in ("=", "{i-1}", "{i+1}", "_{n"):
        assert row.latex.count(part) == row.statement.count(part), part
    assert row.latex.count("{") == row.latex.count("}")
    assert f"tag{{{number}}}" in row._repr_latex_()


def test_symbols_are_listed_once():
    names = [symbol.symbol for symbol in paper.SYMBOLS]
    assert len(names) == len(set(names))
    assert all(symbol.meaning for symbol in paper.SYMBOLS)


def test_unknown_equation_is_refused():
    with pytest.raises(UnknownName, match="36"):
        paper.equation(36)


def test_the_command_line_shows_the_paper(capsys):
    assert main(["equations"]) == 0
    out = capsys.readouterr().out
    assert all(f"({n})" in out for n in range(1, 36))
    assert main(["equations", "20"]) == 0
    out = capsys.readouterr().out
    assert "printed in (20), force row: G_A - f_1" in out
    assert "fullam.dynamics.matrix_system.compensation" in out
    assert "tests/" in out
    assert main(["equations", "36"]) == 2
    assert "unknown equation '36'" in capsys.readouterr().err
    assert main(["equations", "34", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["number"] == 34
