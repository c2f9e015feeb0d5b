/*
   Makes one rank fail alone, for tests: preloaded, it lets the allocation number LATINPC_FAIL_AT of PETSc, or the
   first call of the LAPACK routine gesvd, of METIS, or of METIS for halves, fail on rank LATINPC_FAIL_RANK.
*/
#define _GNU_SOURCE
#include <dlfcn.h>
#include <metis.h>
#include <petscmat.h>
#include <string.h>

typedef PetscErrorCode (*Allocate)(size_t, PetscBool, int, const char[], const char[], void **);

static Allocate allocate;
static long     countdown;

static PetscErrorCode Failing(size_t bytes, PetscBool clear, int line, const char function[], const char file[], void **result)
{
  if (countdown > 0 && --countdown == 0) return PetscError(PETSC_COMM_SELF, line, function, file, PETSC_ERR_MEM, PETSC_ERROR_INITIAL, "no memory, as asked by the test");
  return allocate(bytes, clear, line, function, file, result);
}

static int Chosen(void)
{
  int rank, on;

  if (MPI_Initialized(&on) || !on || !getenv("LATINPC_FAIL_RANK")) return 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  return rank == atoi(getenv("LATINPC_FAIL_RANK"));
}

static int Asked(const char what[])
{
  const char *asked = getenv("LATINPC_FAIL");

  return asked && !strcmp(asked, what) && Chosen();
}

/* Called by the test where counting begins; returns how many allocations there have been since */
PETSC_EXTERN long FailFrom(long at)
{
  static long start;
  const long  since = start - countdown;

  if (!allocate) {
    allocate      = PetscTrMalloc;
    PetscTrMalloc = Failing;
  }
  start = countdown = Chosen() ? at : 0;
  return since;
}

int METIS_PartGraphKway(idx_t *n, idx_t *c, idx_t *x, idx_t *a, idx_t *vw, idx_t *vs, idx_t *aw, idx_t *p, real_t *t, real_t *u, idx_t *o, idx_t *e, idx_t *part)
{
  int (*real)(idx_t *, idx_t *, idx_t *, idx_t *, idx_t *, idx_t *, idx_t *, idx_t *, real_t *, real_t *, idx_t *, idx_t *, idx_t *);

  if (Asked("metis")) return METIS_ERROR_MEMORY;
  *(void **)&real = dlsym(RTLD_NEXT, "METIS_PartGraphKway");
  return real(n, c, x, a, vw, vs, aw, p, t, u, o, e, part);
}

int METIS_ComputeVertexSeparator(idx_t *n, idx_t *x, idx_t *a, idx_t *w, idx_t *o, idx_t *size, idx_t *part)
{
  int (*real)(idx_t *, idx_t *, idx_t *, idx_t *, idx_t *, idx_t *, idx_t *);

  if (Asked("halves")) return METIS_ERROR_MEMORY;
  *(void **)&real = dlsym(RTLD_NEXT, "METIS_ComputeVertexSeparator");
  return real(n, x, a, w, o, size, part);
}

void dgesvd_(const char *ju, const char *jv, const int *m, const int *n, double *a, const int *la, double *s, double *u, const int *lu, double *v, const int *lv, double *w, const int *lw, int *info)
{
  void (*real)(const char *, const char *, const int *, const int *, double *, const int *, double *, double *, const int *, double *, const int *, double *, const int *, int *);

  if (Asked("gesvd")) {
    *info = 1;
    return;
  }
  *(void **)&real = dlsym(RTLD_NEXT, "dgesvd_");
  real(ju, jv, m, n, a, la, s, u, lu, v, lv, w, lw, info);
}

PetscErrorCode MatCholeskyFactorNumeric(Mat F, Mat A, const MatFactorInfo *info)
{
  PetscErrorCode (*real)(Mat, Mat, const MatFactorInfo *);
  PetscMPIInt size;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(PetscObjectComm((PetscObject)A), &size));
  PetscCheck(size > 1 || !Asked("local"), PETSC_COMM_SELF, PETSC_ERR_LIB, "a local factorisation fails, as asked by the test");
  PetscCheck(size == 1 || !Asked("coarse"), PETSC_COMM_SELF, PETSC_ERR_LIB, "the coarse factorisation fails, as asked by the test");
  *(void **)&real = dlsym(RTLD_NEXT, "MatCholeskyFactorNumeric");
  PetscCall(real(F, A, info));
  PetscFunctionReturn(0);
}
