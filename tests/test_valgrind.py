"""Reports of valgrind and lists of memory of PETSc that must fail a test: otherwise every run would look clean."""

import sys

import pytest
from conftest import MALLOC_DUMP, run
from valgrind_reports import reports, reports_in

LOG = """\
==7== Invalid read of size 8
==7==    at 0x1: strncmp (strcmp-sse2.S:160)
==7==    by 0x2: ??? (in /usr/bin/python3.11)
==7==    by 0x3: (below main) (libc_start_call_main.h:58)
==7==  Address 0x4 is 1 bytes inside a block of size 8 alloc'd
==7==    at 0x5: malloc (in /usr/libexec/valgrind/vgpreload_memcheck-amd64-linux.so)
==7==
==7== Conditional jump or move depends on uninitialised value(s)
==7==    at 0x1: dgemm_ (in /usr/lib/x86_64-linux-gnu/libblas.so.3)
==7==    by 0x2: LatinLocal_Private (/home/latinpc/latinpc/src/local.c:12)
==7==    by 0x3: ??? (in /usr/bin/python3.11)
==7==
==7== 8 bytes in 1 blocks are definitely lost in loss record 1 of 2
==7==    at 0x1: malloc (in /usr/libexec/valgrind/vgpreload_memcheck-amd64-linux.so)
==7==    by 0x2: main (in /tmp/folder/plain_snes)
==7==
==7== 8 bytes in 1 blocks are definitely lost in loss record 2 of 2
==7==    at 0x1: malloc (in /usr/libexec/valgrind/vgpreload_memcheck-amd64-linux.so)
==7==    by 0x2: main (in /usr/bin/orterun)
==7==
"""


def test_reports_on_our_code_count(tmp_path):
    log = tmp_path / "7.log"
    log.write_text(LOG)
    found, end = reports(log, leaks=True)
    assert [report.split()[0] for report in found] == ["Conditional", "8"]
    assert "dgemm_" in found[0] and "plain_snes" in found[1]
    assert reports(log, end, leaks=True) == ([], end)
    log.write_text(LOG + LOG)
    assert reports(log, end, leaks=True)[0] == found
    assert reports(log, end)[0] == found[:1]
    assert len(reports_in(tmp_path, leaks=True)) == 4


@pytest.mark.skipif(not MALLOC_DUMP, reason="for a PETSc with its own checks (make test PETSC=debug)")
def test_memory_that_is_left_counts():
    leave = "import petsc4py; petsc4py.init(['']); from petsc4py import PETSc; PETSc.Vec().createSeq(3).incRef()"
    with pytest.raises(pytest.fail.Exception, match="memory left"):
        run([sys.executable, "-c", leave])
    run([sys.executable, "-c", leave], leaks=False)
