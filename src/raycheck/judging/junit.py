"""Verdicts as JUnit XML, which continuous integration shows: INCONCLUSIVE and SKIP count as skipped."""

from junitparser import Failure, JUnitXml, Skipped, TestCase, TestSuite

from raycheck.judging.cases import Case, Verification
from raycheck.stats.verdict import Outcome


def junit_xml(result: Verification) -> str:
    """One test case for each verdict."""
    suite = TestSuite("raycheck")
    suite.add_testcases([_test_case(case) for case in result.cases])
    xml = JUnitXml()
    xml.add_testsuite(suite)
    return str(xml.tostring().decode("utf-8"))


def _test_case(case: Case) -> TestCase:
    test = TestCase(case.technique, classname=case.scene, time=round(case.seconds, 3))
    if case.verdict is Outcome.FAIL:
        test.result = [Failure(case.reason, "bias")]
    elif case.verdict is Outcome.INCONCLUSIVE:
        test.result = [Skipped(case.reason, "inconclusive")]
    elif case.verdict is Outcome.SKIP:
        test.result = [Skipped(case.reason, "unsupported")]
    return test
